#include "engine/scene/body_ball.h"

#include <algorithm>
#include <cmath>

#include "engine/hull/primitive.h"

namespace clearance {

LinkBall ball_around(const Body& body) {
  constexpr double kUp = 1 + 0x1p-40;
  Vec3d low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high = -low;
  for (const ConvexPartPtr& piece : body.pieces)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], piece->centre[k] - piece->half[k]);
      high[k] = std::max(high[k], piece->centre[k] + piece->half[k]);
    }
  LinkBall ball;
  if (body.pieces.empty()) return ball;
  ball.centre = body.pieces.size() == 1 ? body.pieces[0]->centre : low * 0.5 + high * 0.5;
  for (const ConvexPartPtr& piece : body.pieces)
    ball.radius = std::max(ball.radius, norm(piece->centre - ball.centre) + piece->spread + piece->radius);
  ball.radius = (ball.radius + std::max(body.model_error, body.model_inner)) * kUp;
  return ball;
}

double extent_of(const Body& body) {
  double extent = 0;
  for (const ConvexPartPtr& piece : body.pieces)
    extent = std::max(extent, is_half_space(*piece) ? HUGE_VAL : piece->rho + piece->radius);
  return extent;
}

}  // namespace clearance
