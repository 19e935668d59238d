// Poses and columns as Eigen has them, for <clearance/client.h> and <clearance/engine.h> alike. Needs Eigen 3.3.
//
//   client.set_poses({{"gripper", clearance::eigen::pose(X_wb)}});            // Eigen::Isometry3d
//   const auto a = clearance::eigen::points(result.point_a());                // map, 3 x rows, of the result's memory
#pragma once

#include <clearance/query.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>

namespace clearance::eigen {

/// How far a matrix may be from rigid: entries of R^T R - 1. As in Python.
inline constexpr double kRigidTolerance = 1e-5;

/// x, y, z, qw, qx, qy, qz of X_wb (metres), to about 1e-15. A matrix with NaN or Inf becomes a pose of NaN, which a
/// query answers kBadPose. Throws std::invalid_argument for one that is scaled, sheared or mirrored.
inline Pose7 pose(const Eigen::Isometry3d& X) {
  const Eigen::Matrix3d R = X.linear();
  const Eigen::Vector3d t = X.translation();
  if (!R.allFinite() || !t.allFinite()) {
    Pose7 bad;
    bad.fill(std::numeric_limits<double>::quiet_NaN());
    return bad;
  }
  const double skew = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(skew <= kRigidTolerance) || R.determinant() < 0)
    throw std::invalid_argument("pose: not a rigid transform: an entry of R^T R - 1 is " + std::to_string(skew) +
                                ", the determinant is " + std::to_string(R.determinant()));
  const Eigen::Quaterniond q = Eigen::Quaterniond(R).normalized();
  return {t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()};
}

/// X_wb of a pose whose quaternion need not be normalised.
inline Eigen::Isometry3d isometry(const Pose7& X) {
  Eigen::Isometry3d isometry = Eigen::Isometry3d::Identity();
  isometry.linear() = Eigen::Quaterniond(X[3], X[4], X[5], X[6]).normalized().toRotationMatrix();
  isometry.translation() = Eigen::Vector3d(X[0], X[1], X[2]);
  return isometry;
}

/// (rows,) over a column of numbers: distance, lower, upper. Valid as long as the column is.
inline Eigen::Map<const Eigen::VectorXd> numbers(std::span<const double> column) {
  return {column.data(), static_cast<Eigen::Index>(column.size())};
}
/// (3, rows) over a column of points or normals: column i is row i's.
inline Eigen::Map<const Eigen::Matrix3Xd> points(std::span<const double> column) {
  return {column.data(), 3, static_cast<Eigen::Index>(column.size() / 3)};
}
/// (12, rows) over the gradients: six numbers of a, then six of b (kFieldGradient).
inline Eigen::Map<const Eigen::Matrix<double, 12, Eigen::Dynamic>> gradients(std::span<const double> column) {
  return {column.data(), 12, static_cast<Eigen::Index>(column.size() / 12)};
}

}  // namespace clearance::eigen
