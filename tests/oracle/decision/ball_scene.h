// Scenes of balls: their covers take milliseconds, and 60 digits give their distances.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/scene/scene.h"
#include "engine/scene/scene_robot.h"
#include "tests/engine/robot/exact_robot.h"
#include "tests/oracle/decision/near_shapes.h"

namespace clearance::exact {

struct OneBall {
  Vec3d centre;
  double radius;
};
using Balls = std::vector<OneBall>;

/// A link of balls, and the joint that moves it. The first link of a robot has none.
struct BallLink {
  Balls balls;
  std::uint32_t parent = 0;
  std::string joint = {};  ///< attributes and elements: turning(), sliding()
};
std::string turning(const Vec3d& at, const Vec3d& axis);
std::string sliding(const Vec3d& at, const Vec3d& axis, double lower, double upper);

/// Bodies of balls: the links "r/l0", "r/l1", ... of one robot, and the bodies that are added, some of other shapes.
class BallScene {
 public:
  BallScene(const std::vector<BallLink>& links, engine::RobotOptions options = {});

  std::uint32_t add_obstacle(const Balls& balls, const Pose& X, const Uncertainty& uncertainty = {});
  std::uint32_t add_tool(const Balls& balls, const std::string& link, const Pose& X);

  /// Adds a shape that stays, or that a link carries.
  /// \param link name, or empty
  std::uint32_t add_shape(const NearShape& shape, const Pose& X, const std::string& link = {});

  const engine::Scene& scene() const { return scene_; }
  std::uint32_t link(std::size_t l) const { return scene_.find_body("r/l" + std::to_string(l)); }
  const Balls& balls(std::uint32_t body) const { return balls_[body]; }
  /// Of all bodies in the world.
  std::vector<test::RealFrame> frames(std::span<const double> positions) const;
  /// With padding and uncertain positions, but not those of bodies that a body follows. One of the bodies is of balls;
  /// the distance from another shape is exact but for the rounding of coordinates in float64.
  double distance(BodyPair pair, std::span<const test::RealFrame> frames) const;
  /// By how much uncertain positions of bodies that they follow can shorten the distance of a pair, in metres.
  double uncertainty(BodyPair pair) const { return uncertainty_[pair.a] + uncertainty_[pair.b]; }

 private:
  void keep(std::uint32_t body, const Balls& balls, double (*from)(const Vec3d&) = nullptr);
  std::uint32_t add(const Balls& balls, Body body);
  double to_shape(std::uint32_t body, std::uint32_t shape, std::span<const test::RealFrame> frames) const;

  engine::Scene scene_;
  std::vector<Balls> balls_;                        // by body, with padding and uncertain position
  std::vector<double> uncertainty_;                 // likewise: of the body that it follows
  std::vector<double (*)(const Vec3d&)> distance_;  // likewise: of points from it; null for balls
};

test::RealVec point_of(const test::RealFrame& X, const Vec3d& p);
double distance_of(const test::RealVec& a, const test::RealVec& b);

}  // namespace clearance::exact
