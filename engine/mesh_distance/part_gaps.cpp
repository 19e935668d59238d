// Functions that take or return vectors are inlined, so that their calling convention does not matter.
#pragma GCC diagnostic ignored "-Wpsabi"

#include "engine/mesh_distance/part_gaps.h"

#include <cmath>
#include <limits>

#include "engine/base/clones.h"

namespace clearance {

namespace {

using Column = PartColumn;
constexpr double kShort = 1 - 0x1p-45;    // 1 over the length of a direction computed as a unit vector
constexpr double kShorter = 1 - 0x1p-13;  // and of a plane's normal
constexpr double kLeastLength = 1e-140;   // whose square does not underflow

// The functions below are inlined into code for each instruction set.
template <class T>
CLEARANCE_INLINE void take_greater(T& x, const T& y) {
  x = y > x ? y : x;
}
template <class T>
CLEARANCE_INLINE Vec3<T> absolute(const Vec3<T>& v) {
  return {v.x < 0 ? -v.x : v.x, v.y < 0 ? -v.y : v.y, v.z < 0 ? -v.z : v.z};
}
CLEARANCE_INLINE Vec3<Column> columns(const Vec3d& v) {
  return {v.x - Column{}, v.y - Column{}, v.z - Column{}};
}
CLEARANCE_INLINE bool are_all_above(const Column& x, double y) {
  bool all = true;
  for (std::size_t k = 0; k < kPartLanes; ++k) all &= x[k] > y;
  return all;
}
CLEARANCE_INLINE void root(Column& x) {
  for (std::size_t k = 0; k < kPartLanes; ++k) x[k] = __builtin_sqrt(x[k]);
}

// A part, or several by columns, as seen along each column's direction.
struct Seen {
  Vec3<Column> centre, half, normal;
  Column low, high;
};
// Reach along a multiple of its normal.
CLEARANCE_INLINE Column reach_across(const Column& times, const Seen& part) {
  return times * (times > 0 ? part.high : part.low);
}
// Reach along n: by its box, or by its planes and the rest of n along its box.
CLEARANCE_INLINE Column reach(const Vec3<Column>& n, const Seen& part) {
  const Column by_box = dot(n, part.centre) + dot(absolute(n), part.half), along = dot(n, part.normal);
  const Vec3<Column> rest{n.x - along * part.normal.x, n.y - along * part.normal.y, n.z - along * part.normal.z};
  const Column by_planes = dot(rest, part.centre) + dot(absolute(rest), part.half) + reach_across(along, part);
  return by_planes < by_box ? by_planes : by_box;
}
// The same for corners.
CLEARANCE_INLINE Column reach(const Vec3<Column>& n, std::span<const Vec3d> corners) {
  Column most = dot(n, columns(corners[0]));
  for (const Vec3d& corner : corners.subspan(1)) take_greater(most, dot(n, columns(corner)));
  return most;
}
// 1 over the length, or 0 for a zero vector.
CLEARANCE_INLINE Column by_length(const Vec3<Column>& v) {
  Column length = dot(v, v);
  root(length);
  return length > kLeastLength ? (1 - Column{}) / length : Column{};
}
CLEARANCE_INLINE Vec3<Column> scaled(const Vec3<Column>& v, const Column& by) {
  return {v.x * by, v.y * by, v.z * by};
}

}  // namespace

void NodeColumns::take(const Surface& surface, const std::uint32_t* nodes, std::size_t count) {
  centre = surface.centre();
  for (std::size_t k = 0; k < kPartLanes; ++k) {
    const std::uint32_t at = nodes[k < count ? k : count - 1];
    const Surface::Node& node = surface.nodes()[at];
    for (int i = 0; i < 3; ++i) {
      low[i][k] = node.low[static_cast<std::size_t>(i)];
      high[i][k] = node.high[static_cast<std::size_t>(i)];
    }
  }
  normal = {Floats{}, Floats{}, Floats{}};
  behind = ahead = Floats{};
  have_planes = !surface.is_cloud();
  if (!have_planes) return;
  for (std::size_t k = 0; k < kPartLanes; ++k) {
    const Surface::Slab& slab = surface.slabs()[nodes[k < count ? k : count - 1]];
    for (int i = 0; i < 3; ++i) normal[i][k] = float(slab.units[static_cast<std::size_t>(i)]);
    behind[k] = slab.low;
    ahead[k] = slab.high;
  }
}

void ElementColumns::take(const Surface& surface, std::uint32_t begin, std::uint32_t end) {
  are_points = surface.is_cloud();
  half = are_points ? 0.5 * double{surface.edge()} + surface.rounding() : 0;
  for (std::uint32_t k = 0; k < kPartLanes; ++k) {
    const std::uint32_t at = begin + k < end ? begin + k : end - 1;
    if (are_points) {
      const Vec3d p = surface.point(at);
      for (int i = 0; i < 3; ++i) corner[0][i][k] = p[i];
    } else {
      const auto corners = surface.corners(at);
      for (std::size_t c = 0; c < 3; ++c)
        for (int i = 0; i < 3; ++i) corner[c][i][k] = corners[c][i];
    }
  }
}

namespace {

CLEARANCE_INLINE Column doubles(const NodeColumns::Floats& x) {
  return __builtin_convertvector(x, Column);
}
CLEARANCE_INLINE Seen seen(const NodeColumns& nodes) {
  Seen s;
  for (int i = 0; i < 3; ++i) {
    const Column low = doubles(nodes.low[i]), high = doubles(nodes.high[i]);
    s.centre[i] = nodes.centre[i] + (0.5 * low + 0.5 * high);
    s.half[i] = 0.5 * high - 0.5 * low;
    s.normal[i] = Surface::Slab::kUnit * doubles(nodes.normal[i]);
  }
  const Column middle = dot(s.normal, columns(nodes.centre));
  s.low = middle + doubles(nodes.behind);
  s.high = middle + doubles(nodes.ahead);
  return s;
}

}  // namespace

namespace {

// Reach of each triangle along n.
CLEARANCE_INLINE Column reach(const Vec3<Column>& n, const ElementColumns& triangles) {
  Column most = dot(n, triangles.corner[0]);
  take_greater(most, dot(n, triangles.corner[1]));
  take_greater(most, dot(n, triangles.corner[2]));
  return most;
}
CLEARANCE_INLINE Vec3<Column> unit_normals(const ElementColumns& triangles) {
  const Vec3<Column> u = triangles.corner[1] - triangles.corner[0], v = triangles.corner[2] - triangles.corner[0];
  const Vec3<Column> n = cross(u, v);
  return scaled(n, by_length(n));
}

CLEARANCE_INLINE Seen seen_points(const ElementColumns& points) {
  Seen s{};
  s.centre = points.corner[0];
  s.half = columns({points.half, points.half, points.half});
  return s;
}
struct SeenTriangles : Seen {
  const ElementColumns* columns;
};
CLEARANCE_INLINE Column reach(const Vec3<Column>& n, const SeenTriangles& triangles) {
  return reach(n, *triangles.columns);
}
CLEARANCE_INLINE SeenTriangles seen_triangles(const ElementColumns& triangles) {
  SeenTriangles s{{}, &triangles};
  const Vec3<Column>(&corner)[3] = triangles.corner;
  s.normal = unit_normals(triangles);
  s.low = s.high = dot(s.normal, corner[0]);
  Vec3<Column> low = corner[0], high = corner[0];
  for (int c = 1; c < 3; ++c) {
    for (int i = 0; i < 3; ++i) {
      low[i] = corner[c][i] < low[i] ? corner[c][i] : low[i];
      take_greater(high[i], corner[c][i]);
    }
    const Column across = dot(s.normal, corner[c]);
    s.low = across < s.low ? across : s.low;
    take_greater(s.high, across);
  }
  for (int i = 0; i < 3; ++i) {
    s.centre[i] = 0.5 * low[i] + 0.5 * high[i];
    s.half[i] = 0.5 * high[i] - 0.5 * low[i];
  }
  return s;
}

}  // namespace

CLEARANCE_CLONES __attribute__((flatten)) void part_reaches(const NodeColumns& nodes, const Vec3d& n,
                                                            PartColumn& reaches) {
  reaches = reach(columns(n), seen(nodes));
}
CLEARANCE_CLONES __attribute__((flatten)) void part_reaches(const ElementColumns& elements, const Vec3d& n,
                                                            PartColumn& reaches) {
  reaches = elements.are_points ? reach(columns(n), seen_points(elements)) : reach(columns(n), elements);
}

namespace {

// Approximate direction from each p to the nearest point of a triangle.
CLEARANCE_INLINE Vec3<Column> to_triangle(const Vec3<Column>& p, const Vec3d (&corner)[3]) {
  const auto from = [&](const Vec3d& x) { return columns(x) - p; };
  const Vec3d normal = cross(corner[1] - corner[0], corner[2] - corner[0]);
  const double squared = squared_norm(normal);
  Vec3<Column> best{Column{}, Column{}, Column{}};
  Column least = std::numeric_limits<double>::infinity() - Column{}, is_within = 1 - Column{};
  for (int i = 0; i < 3; ++i) {
    const Vec3d edge = corner[(i + 1) % 3] - corner[i], inward = cross(normal, edge);
    const Vec3<Column> to = from(corner[i]);
    Column along = -dot(to, columns(edge)) / squared_norm(edge);
    along = along > 0 ? (along < 1 ? along : 1 - Column{}) : Column{};
    const Vec3<Column> q = to + scaled(columns(edge), along);
    const Column far = dot(q, q);
    is_within = dot(to, columns(inward)) < 0 ? is_within : Column{};
    for (int k = 0; k < 3; ++k) best[k] = far < least ? q[k] : best[k];
    least = far < least ? far : least;
  }
  const Vec3<Column> down = scaled(columns(normal), dot(from(corner[0]), columns(normal)) / squared);
  for (int k = 0; k < 3; ++k) best[k] = is_within > 0 ? down[k] : best[k];
  return best;
}

template <class Own>
CLEARANCE_INLINE void gaps_of(const Own& own, bool have_planes, const PartBounds& other, const Mat3d& R, const Vec3d& D,
                              double stop_above, PartColumn& gaps) {
  const Seen others{columns(other.centre), columns(other.half), columns(other.normal), other.low - Column{},
                    other.high - Column{}};
  const Vec3<Column> from{columns(D)};
  const auto back = [&](const Vec3<Column>& n) {  // in the other body's axes, and reversed
    return Vec3<Column>{-(R.row[0].x * n.x + R.row[1].x * n.y + R.row[2].x * n.z),
                        -(R.row[0].y * n.x + R.row[1].y * n.y + R.row[2].y * n.z),
                        -(R.row[0].z * n.x + R.row[1].z * n.y + R.row[2].z * n.z)};
  };
  const Vec3d their_centre = R * other.centre + D, their_normal = R * other.normal;
  Vec3d their_half;
  for (int i = 0; i < 3; ++i) {
    const Vec3d row{std::abs(R.row[i].x), std::abs(R.row[i].y), std::abs(R.row[i].z)};
    their_half[i] = dot(row, other.half);
  }
  const auto far_back = [&](const Vec3<Column>& n) {
    return other.corners.empty() ? reach(back(n), others) : reach(back(n), other.corners);
  };
  Vec3<Column> d{their_centre.x - own.centre.x, their_centre.y - own.centre.y, their_centre.z - own.centre.z};
  const Vec3<Column> m{columns(their_normal)};
  Vec3<Column> apart = absolute(d);
  for (int i = 0; i < 3; ++i) {
    apart[i] = apart[i] - (own.half[i] + their_half[i]);
    apart[i] = apart[i] > 0 ? apart[i] : Column{};
  }
  gaps = dot(apart, apart);
  root(gaps);
  if (are_all_above(gaps, stop_above)) return;
  // Along the line of the centres, or to the nearest point.
  if (other.corners.size() == 3)
    d = to_triangle(own.centre, {R * other.corners[0] + D, R * other.corners[1] + D, R * other.corners[2] + D});
  const Vec3<Column> n = scaled(d, by_length(d));
  take_greater(gaps, ((dot(n, from) - far_back(n)) - reach(n, own)) * kShort);
  if (are_all_above(gaps, stop_above)) return;
  // Along the normals of the other one and of these. Clouds and convex parts have no planes.
  const bool is_flat = squared_norm(other.normal) > 0;
  if (!is_flat && !have_planes) return;
  const Column once = 1 - Column{}, ahead = dot(m, d) < 0 ? -once : once,
               before = dot(own.normal, d) < 0 ? -once : once;
  const Vec3<Column> across = scaled(own.normal, before);
  take_greater(gaps, ((ahead * dot(m, from) - reach_across(-ahead, others)) - reach(scaled(m, ahead), own)) * kShorter);
  take_greater(gaps, ((dot(across, from) - far_back(across)) - reach_across(before, own)) * kShorter);
}

}  // namespace

CLEARANCE_CLONES __attribute__((flatten)) void part_gaps(const NodeColumns& nodes, const PartBounds& other,
                                                         const Mat3d& R, const Vec3d& D, double stop_above,
                                                         PartColumn& gaps) {
  gaps_of(seen(nodes), nodes.have_planes, other, R, D, stop_above, gaps);
}
CLEARANCE_CLONES __attribute__((flatten)) void part_gaps(const ElementColumns& elements, const PartBounds& other,
                                                         const Mat3d& R, const Vec3d& D, double stop_above,
                                                         PartColumn& gaps) {
  if (elements.are_points)
    gaps_of(seen_points(elements), false, other, R, D, stop_above, gaps);
  else
    gaps_of(seen_triangles(elements), true, other, R, D, stop_above, gaps);
}

CLEARANCE_CLONES __attribute__((flatten)) void triangle_gaps(const ElementColumns& a, const ElementColumns& b,
                                                             const Mat3d& R, const Vec3d& D, const Vec3d (&n)[2],
                                                             PartColumn (&gaps)[kPartLanes]) {
  for (Column& gap : gaps) gap = Column{};
  const auto try_axis = [&](const Vec3d& along, const Vec3d& back) {  // in the axes of a, and of b reversed
    const Column far_a = reach(columns(along), a), far_b = reach(columns(back), b);
    const double between = dot(along, D);
    for (std::size_t j = 0; j < kPartLanes; ++j) take_greater(gaps[j], ((between - far_b[j]) - far_a) * kShort);
  };
  for (const Vec3d& along : n) try_axis(along, -R.transpose_times(along));
  const Vec3d towards = n[1];
  const Vec3<Column> of_a = unit_normals(a), of_b = unit_normals(b);
  for (std::size_t k = 0; k < kPartLanes; ++k) {
    const Vec3d m{of_a.x[k], of_a.y[k], of_a.z[k]}, along = dot(m, towards) < 0 ? -m : m;
    try_axis(along, -R.transpose_times(along));
  }
  for (std::size_t k = 0; k < kPartLanes; ++k) {
    const Vec3d m{of_b.x[k], of_b.y[k], of_b.z[k]}, turned = R * m;
    dot(turned, towards) < 0 ? try_axis(-turned, m) : try_axis(turned, -m);
  }
}

}  // namespace clearance
