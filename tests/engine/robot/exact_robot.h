// Kinematics in real arithmetic, to 60 digits: the oracle of kinematics. Written from URDF's definition, with matrices
// throughout, and shares with the tested code only the model's numbers.
#pragma once

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <vector>

#include "engine/pose/pose.h"
#include "engine/robot/kinematics.h"

namespace clearance::test {

using Real = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<60>, boost::multiprecision::et_off>;

struct RealVec {
  Real x[3] = {0, 0, 0};
};
struct RealFrame {
  Real R[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  RealVec t;

  friend RealFrame operator*(const RealFrame& a, const RealFrame& b) {
    RealFrame c;
    for (int i = 0; i < 3; ++i) {
      c.t.x[i] = a.t.x[i];
      for (int k = 0; k < 3; ++k) c.t.x[i] += a.R[i][k] * b.t.x[k];
      for (int j = 0; j < 3; ++j) {
        c.R[i][j] = 0;
        for (int k = 0; k < 3; ++k) c.R[i][j] += a.R[i][k] * b.R[k][j];
      }
    }
    return c;
  }
};

inline RealFrame real_turn(const Vec3d& axis, const Real& angle) {  // Rodrigues
  const Real n = sqrt(Real(axis.x) * axis.x + Real(axis.y) * axis.y + Real(axis.z) * axis.z);
  const Real a[3] = {axis.x / n, axis.y / n, axis.z / n};
  const Real s = sin(angle), c = cos(angle);
  const Real K[3][3] = {{0, -a[2], a[1]}, {a[2], 0, -a[0]}, {-a[1], a[0], 0}};
  RealFrame X;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) X.R[i][j] = (i == j ? c : Real(0)) + s * K[i][j] + (1 - c) * a[i] * a[j];
  return X;
}

inline RealFrame real_shift(const Real& x, const Real& y, const Real& z) {
  RealFrame X;
  X.t = {{x, y, z}};
  return X;
}

inline RealFrame real_frame(const Origin& o) {
  return real_shift(o.xyz.x, o.xyz.y, o.xyz.z) * real_turn({0, 0, 1}, o.rpy.z) * real_turn({0, 1, 0}, o.rpy.y) *
         real_turn({1, 0, 0}, o.rpy.x);
}

/// The pose as specified: M(q) / |q|^2 and t.
inline RealFrame real_frame(const Pose& X) {
  const Real w = X.qw, x = X.qx, y = X.qy, z = X.qz, n = w * w + x * x + y * y + z * z;
  return {{{(w * w + x * x - y * y - z * z) / n, 2 * (x * y - w * z) / n, 2 * (x * z + w * y) / n},
           {2 * (x * y + w * z) / n, (w * w + y * y - x * x - z * z) / n, 2 * (y * z - w * x) / n},
           {2 * (x * z - w * y) / n, 2 * (y * z + w * x) / n, (w * w + z * z - x * x - y * y) / n}},
          {{X.translation.x, X.translation.y, X.translation.z}}};
}

/// Poses of the joints in their parents, which do not change with positions.
inline std::vector<RealFrame> real_origins(const RobotModel& robot) {
  std::vector<RealFrame> origins;
  for (const RobotJoint& joint : robot.joints) origins.push_back(real_frame(joint.X_pj));
  return origins;
}

/// Frames of all links.
/// \param q by column: double or Real
/// \param roots as for Kinematics::place()
/// \param origins real_origins(), to avoid repeating it
template <class Number>
std::vector<RealFrame> real_links(const RobotModel& robot, const Number* q,
                                  const std::vector<std::uint32_t>& root_links, std::span<const Pose> roots,
                                  const std::vector<RealFrame>& origins) {
  std::vector<RealFrame> links(robot.links.size());
  for (std::size_t r = 0; r < root_links.size(); ++r) links[root_links[r]] = real_frame(roots[r]);
  for (std::size_t i = 0; i < robot.joints.size(); ++i) {
    const RobotJoint& joint = robot.joints[i];
    if (joint.kind == JointKind::kFloating) continue;
    RealFrame X = links[joint.parent] * origins[i];
    if (joint.kind != JointKind::kFixed) {
      const RobotJoint& driver = joint.mimic ? robot.joints[joint.mimic->joint] : joint;
      Real position = q[driver.column];
      if (joint.mimic) position = joint.mimic->multiplier * position + joint.mimic->offset;
      if (joint.kind == JointKind::kPlanar) {
        X = X * real_shift(position, q[driver.column + 1], 0) * real_turn({0, 0, 1}, q[driver.column + 2]);
      } else if (joint.kind == JointKind::kPrismatic) {
        const Vec3d& a = joint.axis;
        const Real s = position / sqrt(Real(a.x) * a.x + Real(a.y) * a.y + Real(a.z) * a.z);
        X = X * real_shift(a.x * s, a.y * s, a.z * s);
      } else {
        X = X * real_turn(joint.axis, position);
      }
    }
    links[joint.child] = X;
  }
  return links;
}
template <class Number>
std::vector<RealFrame> real_links(const RobotModel& robot, const Number* q,
                                  const std::vector<std::uint32_t>& root_links, std::span<const Pose> roots) {
  return real_links(robot, q, root_links, roots, real_origins(robot));
}

/// Bound on the motion of points within `radius` of the origin between two frames: |t - t'| + |R - R'| radius, which
/// bounds the farthest one. The norm of a difference of rotations is its Frobenius norm over the root of 2.
inline double displacement(const RealFrame& a, const RealFrame& b, double radius) {
  Real t = 0, R = 0;
  for (int i = 0; i < 3; ++i) {
    t += (a.t.x[i] - b.t.x[i]) * (a.t.x[i] - b.t.x[i]);
    for (int j = 0; j < 3; ++j) R += (a.R[i][j] - b.R[i][j]) * (a.R[i][j] - b.R[i][j]);
  }
  return static_cast<double>(sqrt(t) + sqrt(R / 2) * radius);
}

/// The inverse of a frame.
inline RealFrame real_inverse(const RealFrame& a) {
  RealFrame b;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) b.R[i][j] = a.R[j][i];
  for (int i = 0; i < 3; ++i) {
    b.t.x[i] = 0;
    for (int k = 0; k < 3; ++k) b.t.x[i] -= b.R[i][k] * a.t.x[k];
  }
  return b;
}

}  // namespace clearance::test
