// Conversion of homogeneous matrices to poses, for clearance/_poses.py, which documents it and writes the errors.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace clearance::python {

/// Whether a (4, 4) matrix is rigid: errors of R^T R - 1 and of the last row within `tolerance`, and no mirroring.
inline bool is_rigid(const double* m, double tolerance) {
  const double last[4] = {0, 0, 0, 1};
  double off = 0;
  for (int i = 0; i < 4; ++i) off = std::max(off, std::abs(m[12 + i] - last[i]));
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      const double gram = m[i] * m[j] + m[4 + i] * m[4 + j] + m[8 + i] * m[8 + j];
      off = std::max(off, std::abs(gram - (i == j)));
    }
  }
  const double determinant =
      m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8]) + m[2] * (m[4] * m[9] - m[5] * m[8]);
  return off <= tolerance && determinant > 0;
}

/// Returns x, y, z, qw, qx, qy, qz of a rigid (4, 4) matrix, qw >= 0. For an exact rotation, `k` is 4 q q^T, and every
/// column is a multiple of q. The column of the largest component has no cancellation (Shepperd 1978). A further
/// product with k, whose other eigenvalues are about 0, gives the quaternion nearest to a matrix that is orthogonal
/// only within the tolerance (Bar-Itzhack 2000).
inline void pose_of_matrix(const double* m, double* pose) {
  const double xx = m[0], yy = m[5], zz = m[10];
  const double wx = m[9] - m[6], wy = m[2] - m[8], wz = m[4] - m[1];
  const double xy = m[4] + m[1], xz = m[8] + m[2], yz = m[9] + m[6];
  const double k[4][4] = {{1 + xx + yy + zz, wx, wy, wz},
                          {wx, 1 + xx - yy - zz, xy, xz},
                          {wy, xy, 1 - xx + yy - zz, yz},
                          {wz, xz, yz, 1 - xx - yy + zz}};
  int largest = 0;
  for (int i = 1; i < 4; ++i)
    if (k[i][i] > k[largest][largest]) largest = i;
  double q[4], norm = 0;
  for (int i = 0; i < 4; ++i) {
    q[i] = 0;
    for (int j = 0; j < 4; ++j) q[i] += k[i][j] * k[j][largest];
    norm += q[i] * q[i];
  }
  const double scale = (q[0] < 0 ? -1 : 1) / std::sqrt(norm);
  for (int i = 0; i < 3; ++i) pose[i] = m[4 * i + 3];
  for (int i = 0; i < 4; ++i) pose[3 + i] = q[i] * scale;
}

/// Converts (count, 4, 4) matrices to (count, 7) poses, with NaN for a matrix with NaN or Inf. Returns the index of the
/// first that is not rigid, or -1.
inline std::int64_t poses_of_matrices(const double* matrices, std::size_t count, double tolerance, double* poses) {
  for (std::size_t i = 0; i < count; ++i) {
    const double* m = matrices + 16 * i;
    double* pose = poses + 7 * i;
    if (!std::all_of(m, m + 16, [](double x) { return std::isfinite(x); })) {
      std::fill_n(pose, 7, std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    if (!is_rigid(m, tolerance)) return static_cast<std::int64_t>(i);
    pose_of_matrix(m, pose);
  }
  return -1;
}

}  // namespace clearance::python
