#include "tests/oracle/states/exact_state.h"

#include <algorithm>
#include <cmath>

#include "tests/engine/robot/exact_robot.h"

namespace clearance::exact {
namespace {

using test::RealFrame;

constexpr double kRounding = 1e-12;  // metres: far above that of coordinates of a few metres

std::vector<Vec3d> placed(const RealFrame& X, std::span<const Vec3d> points) {
  std::vector<Vec3d> world;
  for (const Vec3d& p : points) {
    Vec3d v;
    for (int k = 0; k < 3; ++k)
      v[k] = static_cast<double>(X.t.x[k] + X.R[k][0] * p.x + X.R[k][1] * p.y + X.R[k][2] * p.z);
    world.push_back(v);
  }
  return world;
}

struct Ball {
  Vec3d centre{0, 0, 0};
  double radius = 0;
};

Ball ball_of(std::span<const Vec3d> points, double radius) {
  Ball ball;
  for (const Vec3d& p : points) ball.centre += p * (1.0 / static_cast<double>(points.size()));
  for (const Vec3d& p : points) ball.radius = std::max(ball.radius, norm(p - ball.centre));
  ball.radius += radius;
  return ball;
}

/// The distance of two parts less `distance`, a sign. Balls around them answer for parts that are far apart.
int compare(std::span<const Vec3d> a, double radius_a, std::span<const Vec3d> b, double radius_b, double distance) {
  const Ball p = ball_of(a, radius_a), q = ball_of(b, radius_b);
  if (norm(p.centre - q.centre) * (1 - 1e-12) > p.radius + q.radius + distance + kRounding) return 1;
  return exact_distance(ConvexPartView{a, radius_a}, Pose{}, ConvexPartView{b, radius_b}, Pose{}, false)
      .distance.compare(distance);
}

}  // namespace

std::vector<PlacedBody> placed_bodies(const RobotScene& made, const engine::Engine& engine,
                                      std::span<const double> positions) {
  const std::vector<Body>& bodies = made.scene.bodies();
  const SceneRobot& robot = *made.scene.robots()[0];
  const Pose roots[] = {engine.body_state(robot.base).X_wb};
  const std::vector<RealFrame> links = test::real_links(robot.model, positions.data(), robot.kinematics.roots(), roots);
  std::vector<RealFrame> frames(bodies.size());
  std::vector<PlacedBody> result(bodies.size());
  for (std::uint32_t i = 0; i < bodies.size(); ++i) {
    if (bodies[i].robot != kNone) {
      frames[i] = links[bodies[i].link];
    } else if (bodies[i].parent != kNone) {
      frames[i] = frames[bodies[i].parent] * test::real_frame(*bodies[i].pose);
    } else {
      const BodyState now = engine.body_state(i);
      frames[i] = test::real_frame(now.X_wb);
      if (now.parent != kNone)  // attached: where it is in its parent, but for rounding
        frames[i] =
            frames[now.parent] * (test::real_inverse(test::real_frame(engine.body_state(now.parent).X_wb)) * frames[i]);
    }
    for (const PartBounds& part : made.exact_parts[i])
      result[i].parts.push_back({placed(frames[i], part.outer), placed(frames[i], part.inner), part.radius, part.turn});
  }
  return result;
}

bool is_nearer(const PlacedBody& a, const PlacedBody& b, double distance) {
  for (const PartBounds& p : a.parts)
    for (const PartBounds& q : b.parts)
      if (compare(p.inner, p.radius, q.inner, q.radius, distance - kRounding) <= 0) return true;
  return false;
}

bool is_farther(const PlacedBody& a, const PlacedBody& b, double distance) {
  if (a.parts.empty() || b.parts.empty()) return false;
  for (const PartBounds& p : a.parts)
    for (const PartBounds& q : b.parts)
      if (compare(p.outer, p.radius + p.turn, q.outer, q.radius + q.turn, distance + kRounding) <= 0) return false;
  return true;
}

}  // namespace clearance::exact
