// How often a closed mesh winds around a point: the triangles that a ray from it along +x goes through, each counted by
// the side from which it is pierced. All signs are exact, and no ray is unlucky: where it meets an edge or a corner the
// point counts as moved by an infinitely small step along y, and by one along z that is small beside that. It lies on
// no triangle, so that it stays on its side of all of them.
#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/base/orientation.h"
#include "engine/surface/surface.h"

namespace clearance {

namespace {

// A position whose coordinates orientation() is exact for: what is nearer to 0 is 0. That moves no position by more
// than 1e-60 m, and equal ones alike.
Vec3d flushed(const Vec3d& v) {
  if (orientation_applies(v)) return v;
  Vec3d out = v;
  for (int k = 0; k < 3; ++k)
    if (std::abs(v[k]) < kMinOrientationCoordinate) out[k] = 0;
  return out;
}

int sign(double x) {
  return (x > 0) - (x < 0);
}

// On which side of the edge from a to b, seen along -x, the point lies that is p moved as said above: 1 on its left,
// -1 on its right, 0 only where the edge is seen as a point.
int side_of_edge(const Vec3d& a, const Vec3d& b, const Vec3d& p) {
  const Vec3d flat_a{0, a.y, a.z}, flat_b{0, b.y, b.z}, flat_p{0, p.y, p.z}, beside_a{1, a.y, a.z};
  // det[b - a, p - a, x], which is that of their y and z.
  if (const int side = orientation(flat_a, flat_b, flat_p, beside_a); side != 0) return side;
  if (a.z != b.z) return sign(a.z - b.z);
  return sign(b.y - a.y);
}

// 1: the ray leaves through the triangle, whose normal points ahead; -1: it comes in; 0: it misses.
int crossing(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p) {
  if (std::max({a.x, b.x, c.x}) < p.x) return 0;
  if (std::max({a.y, b.y, c.y}) < p.y || std::min({a.y, b.y, c.y}) > p.y) return 0;
  if (std::max({a.z, b.z, c.z}) < p.z || std::min({a.z, b.z, c.z}) > p.z) return 0;
  const int side = side_of_edge(a, b, p);
  if (side == 0 || side_of_edge(b, c, p) != side || side_of_edge(c, a, p) != side) return 0;
  return orientation(a, b, c, p) == -side ? side : 0;
}

}  // namespace

int winding_number(const Surface& surface, const Vec3d& p) {
  const Vec3d from_centre = p - surface.centre(), point = flushed(p);
  const std::span<const Surface::Node> nodes = surface.nodes();
  int sum = 0;
  std::vector<std::uint32_t> left{0};
  while (!left.empty()) {
    const std::uint32_t at = left.back();
    left.pop_back();
    const Surface::Node& node = nodes[at];
    // Both sides of each comparison were rounded alike from positions less the centre, and the box outward from there.
    if (from_centre.x > node.high[0] || from_centre.y < node.low[1] || from_centre.y > node.high[1] ||
        from_centre.z < node.low[2] || from_centre.z > node.high[2])
      continue;
    if (!node.is_leaf()) {
      left.push_back(node.right);
      left.push_back(at + 1);
      continue;
    }
    for (std::uint32_t t = node.begin(); t < node.end(); ++t) {
      const auto [a, b, c] = surface.corners(t);
      sum += crossing(flushed(a), flushed(b), flushed(c), point);
    }
  }
  return sum;
}

}  // namespace clearance
