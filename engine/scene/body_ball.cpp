#include "engine/scene/body_ball.h"

#include <algorithm>
#include <cmath>

#include "engine/hull/primitive.h"

namespace clearance {

LinkBall ball_around(const Body& body) {
  constexpr double kUp = 1 + 0x1p-40;
  Vec3d low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high = -low;
  for (const ConvexPartPtr& part : body.parts)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], part->centre[k] - part->half[k]);
      high[k] = std::max(high[k], part->centre[k] + part->half[k]);
    }
  LinkBall ball;
  if (body.parts.empty()) return ball;
  ball.centre = body.parts.size() == 1 ? body.parts[0]->centre : low * 0.5 + high * 0.5;
  for (const ConvexPartPtr& part : body.parts)
    ball.radius = std::max(ball.radius, norm(part->centre - ball.centre) + part->spread + part->radius);
  ball.radius = (ball.radius + std::max(body.model_error, body.model_inner)) * kUp;
  return ball;
}

double extent_of(const Body& body) {
  double extent = 0;
  for (const ConvexPartPtr& part : body.parts)
    extent = std::max(extent, is_half_space(*part) ? HUGE_VAL : part->rho + part->radius);
  return extent;
}

}  // namespace clearance
