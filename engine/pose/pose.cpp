#include "engine/pose/pose.h"

#include <algorithm>
#include <cstddef>

#include "engine/base/clones.h"

namespace clearance {

namespace {

constexpr std::size_t kLanes = 8;

// q: (4, kLanes) as w, x, y, z; R: (9, kLanes). Flattened, so that the compiler can vectorise over lanes.
CLEARANCE_CLONES __attribute__((flatten)) void rotations_in_lanes(const double (&q)[4][kLanes],
                                                                  double (&R)[9][kLanes]) {
  for (std::size_t k = 0; k < kLanes; ++k) {
    const Mat3<DoubleDouble> m = rotation_of_double_double({{0, 0, 0}, q[0][k], q[1][k], q[2][k], q[3][k]});
    for (int i = 0; i < 3; ++i) {
      R[3 * i][k] = m.row[i].x.hi;
      R[3 * i + 1][k] = m.row[i].y.hi;
      R[3 * i + 2][k] = m.row[i].z.hi;
    }
  }
}

}  // namespace

void rotations_of(std::span<const Pose> poses, std::span<Mat3d> rotations) {
  for (std::size_t begin = 0; begin < poses.size(); begin += kLanes) {
    const std::size_t count = std::min(kLanes, poses.size() - begin);
    double q[4][kLanes], R[9][kLanes];
    for (std::size_t k = 0; k < kLanes; ++k) {
      const Pose& X = poses[begin + std::min(k, count - 1)];
      q[0][k] = X.qw, q[1][k] = X.qx, q[2][k] = X.qy, q[3][k] = X.qz;
    }
    rotations_in_lanes(q, R);
    for (std::size_t k = 0; k < count; ++k)
      for (int i = 0; i < 3; ++i) rotations[begin + k].row[i] = {R[3 * i][k], R[3 * i + 1][k], R[3 * i + 2][k]};
  }
}

}  // namespace clearance
