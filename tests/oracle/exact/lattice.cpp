#include "tests/oracle/exact/lattice.h"

#include <algorithm>

namespace clearance::exact {

Pose lattice_rotation(Random& random, int* n) {
  for (;;) {
    const int w = random.integer(-2, 2), x = random.integer(-2, 2), y = random.integer(-2, 2),
              z = random.integer(-2, 2);
    *n = w * w + x * x + y * y + z * z;
    if (*n != 0)
      return {
          {0, 0, 0}, static_cast<double>(w), static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
  }
}

std::vector<Vec3d> lattice_points(Random& random, int range, int step) {
  std::vector<Vec3d> v;
  if (random.chance(0.4)) {
    v = box({static_cast<double>(random.integer(0, range)), static_cast<double>(random.integer(0, range)),
             static_cast<double>(random.integer(0, range))});
  } else {
    for (int i = random.integer(1, 12); i > 0; --i)
      v.push_back({static_cast<double>(random.integer(-range, range)),
                   static_cast<double>(random.integer(-range, range)),
                   static_cast<double>(random.integer(-range, range))});
  }
  return scaled(std::move(v), step);
}

std::vector<Vec3d> in_world(const Solid& s, const Pose& X, int n) {
  // Exact: vertices are multiples of n, so that M v / n is a vector of small integers.
  const double w = X.qw, x = X.qx, y = X.qy, z = X.qz;
  const Mat3d M{{{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                 {2 * (x * y + w * z), w * w + y * y - x * x - z * z, 2 * (y * z - w * x)},
                 {2 * (x * z - w * y), 2 * (y * z + w * x), w * w + z * z - x * x - y * y}}};
  std::vector<Vec3d> out;
  for (const Vec3d& v : s.vertices) out.push_back(M * (v * (1.0 / n)));
  return out;
}

Vec3d extreme_point(Random& random, const std::vector<Vec3d>& v, Vec3d n) {
  double high = dot(n, v[0]);
  for (const Vec3d& p : v) high = std::max(high, dot(n, p));
  std::vector<Vec3d> tied;
  for (const Vec3d& p : v)
    if (dot(n, p) == high) tied.push_back(p);
  const int count = std::min<int>(random.integer(1, 4), static_cast<int>(tied.size()));
  Vec3d sum{0, 0, 0};
  for (int i = 0; i < count; ++i)
    sum += tied[static_cast<std::size_t>(random.integer(0, static_cast<int>(tied.size()) - 1))];
  return {sum.x / count, sum.y / count, sum.z / count};
}

}  // namespace clearance::exact
