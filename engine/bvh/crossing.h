// Crossings of a ray along +x with triangles, each counted by the side from which it is pierced. There are no
// degenerate rays: at an edge or a corner the ray's point counts as moved by an infinitely small step along y, and by
// an even smaller one along z. The point lies on no triangle, so that it stays on its side of all of them. For host and
// device.
#pragma once

#include "engine/base/orientation.h"

namespace clearance {

// A position for which orientation() is exact: coordinates near 0 become 0. That moves no position by more than 1e-60
// m, and equal ones alike.
CLEARANCE_HD inline Vec3d flushed(const Vec3d& v) {
  Vec3d out = v;
  for (int k = 0; k < 3; ++k)
    if (v[k] < kMinOrientationCoordinate && v[k] > -kMinOrientationCoordinate) out[k] = 0;
  return out;
}

// Whether a ray misses a box of a tree.
// \param from_centre its point less the tree's centre
CLEARANCE_HD inline bool ray_misses(const Vec3d& low, const Vec3d& high, const Vec3d& from_centre) {
  // Both sides of each comparison were rounded alike from positions less the centre, and the box outward from there.
  return from_centre.x > high.x || from_centre.y < low.y || from_centre.y > high.y || from_centre.z < low.z ||
         from_centre.z > high.z;
}

// The side of the edge from a to b, seen along -x, of the point p, moved as described above: 1 on its left, -1 on its
// right, 0 only if the edge is seen as a point.
template <class Orientation>
CLEARANCE_HD int side_of_edge(const Vec3d& a, const Vec3d& b, const Vec3d& p, const Orientation& oriented) {
  const auto sign = [](double x) { return (x > 0) - (x < 0); };
  const Vec3d flat_a{0, a.y, a.z}, flat_b{0, b.y, b.z}, flat_p{0, p.y, p.z}, off_plane{1, a.y, a.z};
  // det[b - a, p - a, x], which is that of their y and z.
  if (const int side = oriented(flat_a, flat_b, flat_p, off_plane); side != 0) return side;
  if (a.z != b.z) return sign(a.z - b.z);
  return sign(b.y - a.y);
}

// Returns 1 if the ray from p leaves through the triangle, whose normal points ahead, -1 if it enters, and 0 if it
// misses.
// \param oriented orientation() of four positions
template <class Orientation>
CLEARANCE_HD int crossing(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p, const Orientation& oriented) {
  const auto all = [](bool x, bool y, bool z) { return x && y && z; };
  if (all(a.x < p.x, b.x < p.x, c.x < p.x)) return 0;
  if (all(a.y < p.y, b.y < p.y, c.y < p.y) || all(a.y > p.y, b.y > p.y, c.y > p.y)) return 0;
  if (all(a.z < p.z, b.z < p.z, c.z < p.z) || all(a.z > p.z, b.z > p.z, c.z > p.z)) return 0;
  const int side = side_of_edge(a, b, p, oriented);
  if (side == 0 || side_of_edge(b, c, p, oriented) != side || side_of_edge(c, a, p, oriented) != side) return 0;
  return oriented(a, b, c, p) == -side ? side : 0;
}

}  // namespace clearance
