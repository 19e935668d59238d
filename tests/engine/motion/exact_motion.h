// Motions of balls and plates on robots and beside them, to 60 digits: the judge. It shares nothing with what it judges
// but the numbers that go in.
#pragma once

#include <map>
#include <vector>

#include "tests/engine/motion/motion_test.h"
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

/// The pose at a time of a body that goes straight from one pose to another and turns at constant speed, the shorter
/// way: slerp, by its definition.
RealFrame real_between(const Pose& from, const Pose& to, const Real& t);

/// A scene of balls and plates: one robot, and bodies beside and on it.
struct ExactScene {
  /// A ball, or a box around its body's origin.
  struct Shape {
    Vec3d centre{0, 0, 0};  ///< of the ball, body frame
    double radius = 0;      ///< of the ball
    Vec3d half{0, 0, 0};    ///< of the box: half its lengths
    double position = 0;    ///< metres that the body may be off
    double angle = 0;       ///< radians that it may be turned by, about its origin
    bool is_box = false;
    bool is_unsure() const { return position > 0 || angle > 0; }
  };
  /// Where a body is at a time.
  struct Placed {
    RealFrame X;
    RealVec centre;
  };
  using Moment = std::map<std::uint32_t, Placed>;

  const Scene* scene = nullptr;
  std::vector<RealFrame> origins;             ///< real_origins() of the robot
  std::map<std::uint32_t, Shape> shapes;      ///< by body
  std::map<std::uint32_t, Pose> poses;        ///< of bodies that nothing moves, X_wb or X_pb
  std::map<std::uint32_t, std::uint32_t> on;  ///< what such a one follows

  Moment at(const Motions& motions, std::uint32_t motion, const Real& t) const;
  /// The least that the shapes' distance can be, with all that they may be off; below 0 where they overlap. Not of two
  /// boxes, and at most one of the two may be off.
  Real distance(const Moment& moment, BodyPair pair) const;
  /// The same rounded, with an error of less than 1e-9 m within 1e5 m of the world's origin.
  double rough_distance(const Moment& moment, BodyPair pair) const;
  /// Whether distance() answers.
  bool answers(BodyPair pair) const;
};

}  // namespace clearance::test
