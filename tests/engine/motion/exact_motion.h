// Oracle: motions of balls and plates on and around robots, to 60 digits. It shares only the input numbers with the
// code under test.
#pragma once

#include <map>
#include <vector>

#include "tests/engine/motion/motion_test.h"
#include "tests/engine/robot/exact_curve.h"
#include "tests/engine/robot/exact_robot.h"

namespace clearance::test {

inline Real real_dot(const RealVec& a, const RealVec& b) {
  return a.x[0] * b.x[0] + a.x[1] * b.x[1] + a.x[2] * b.x[2];
}
inline Real real_length(const RealVec& v) {
  return sqrt(real_dot(v, v));
}
inline RealVec operator-(const RealVec& a, const RealVec& b) {
  return {{a.x[0] - b.x[0], a.x[1] - b.x[1], a.x[2] - b.x[2]}};
}

/// Pose at a time of a body that moves straight from one pose to another and rotates at constant speed, the shorter
/// way: slerp by its definition.
RealFrame real_between(const Pose& from, const Pose& to, const Real& t);

/// A scene of balls and plates: one robot, and bodies on and around it.
struct ExactScene {
  /// A ball, or a box around its body's origin.
  struct Shape {
    Vec3d centre{0, 0, 0};  ///< of the ball, body frame
    double radius = 0;      ///< of the ball
    Vec3d half{0, 0, 0};    ///< of the box: half its lengths
    double position = 0;    ///< uncertainty of the body's position, in metres
    double angle = 0;       ///< uncertainty of its rotation about its origin, in radians
    bool is_box = false;
    bool is_unsure() const { return position > 0 || angle > 0; }
  };
  /// Pose of a body at a time.
  struct Placed {
    RealFrame X;
    RealVec centre;
    Real growth = 0;
  };
  using Moment = std::map<std::uint32_t, Placed>;

  const engine::Scene* scene = nullptr;
  std::vector<RealFrame> origins;             ///< real_origins() of the robot
  std::map<std::uint32_t, Shape> shapes;      ///< by body
  std::map<std::uint32_t, Pose> poses;        ///< of bodies that nothing moves, X_wb or X_pb
  std::map<std::uint32_t, std::uint32_t> on;  ///< parent of such a body

  Moment at(const Motions& motions, std::uint32_t motion, const Real& t) const;
  /// The least possible distance of the shapes within their uncertainty; below 0 if they overlap. Not for two boxes,
  /// and only for one uncertain body at most.
  Real distance(const Moment& moment, BodyPair pair) const;
  /// The same, rounded, with an error of less than 1e-9 m within 1e5 m of the world's origin.
  double rough_distance(const Moment& moment, BodyPair pair) const;
  /// Returns whether distance() supports the pair.
  bool answers(BodyPair pair) const;
};

}  // namespace clearance::test
