// Witness points, normal and their uniqueness, from a converged run of GJK.
// For host and device: `Hull` is a convex part as each of them stores it, with
//   Vec3d vertices[i], std::uint32_t count(), HullExtents extents(), SupportPoint<double> support(hull, n).
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>

#include "engine/hull/primitive.h"
#include "engine/hull/support.h"
#include "engine/narrow/lanes.h"

namespace clearance {

/// Witness points of a converged pair, from their bodies' origins, in world axes.
/// \param round_a,round_b points of round cores (CoreWitness); null for hulls
template <class Hull>
CLEARANCE_HD inline void converged_points(const Hull& a, const Mat3d& R_wa, const Hull& b, const Mat3d& R_wb,
                                          const LaneWitness& lane, Vec3d& point_a, Vec3d& point_b,
                                          const Vec3d* round_a = nullptr, const Vec3d* round_b = nullptr) {
  Vec3d core_a{0, 0, 0}, core_b = core_a;
  CLEARANCE_UNROLL
  for (std::uint32_t i = 0; i < 3; ++i) {
    if (i >= lane.size) continue;
    if (!round_a) core_a += a.vertices[lane.a[i]] * lane.share[i];
    if (!round_b) core_b += b.vertices[lane.b[i]] * lane.share[i];
  }
  if (round_a) core_a = *round_a;
  if (round_b) core_b = *round_b;
  Vec3d outward = lane.separation;  // without a radius its length does not matter
  if (a.extents().radius + b.extents().radius > 0) outward = outward * (1 / lane.separation_length);
  point_a = R_wa * core_a + outward * a.extents().radius;
  point_b = R_wb * core_b - outward * b.extents().radius;
}

/// Normal of a converged pair.
CLEARANCE_HD inline Vec3d converged_normal(const LaneWitness& lane) {
  return lane.n * (1 / lane.n_length);
}

/// Vertices of a part within rounding of its support along a direction: the number of dimensions that they span, and
/// one of their edges in world axes.
struct Contact {
  int dimensions = 0;
  Vec3d edge{0, 0, 0};
};

inline constexpr double kContactAngle = 1e-9;  // radians, from rounding

/// \param angle radians: bound on the error of the direction
template <class Hull>
CLEARANCE_HD inline Contact contact_of_vertices(const Hull& hull, const Mat3d& R, const Vec3d& n_w, double angle) {
  using std::sqrt;
  const Vec3d n = R.transpose_times(n_w);
  const SupportPoint<double> best = support(hull, n);
  const double tolerance = angle * hull.extents().spread;
  const double least = kContactAngle * hull.extents().spread;
  const Vec3d first = hull.vertices[best.index];
  Contact c;
  double longest = 0;
  for (std::uint32_t i = 0; i < hull.count(); ++i) {
    const Vec3d v = hull.vertices[i];
    if (!(best.value - dot(n, v) <= tolerance)) continue;
    const Vec3d e = v - first;
    if (squared_norm(e) <= least * least) continue;
    c.dimensions = 1;
    if (squared_norm(e) > longest) {
      longest = squared_norm(e);
      c.edge = e;
    }
  }
  if (c.dimensions == 0) return c;
  c.edge = c.edge * (1 / sqrt(longest));
  for (std::uint32_t i = 0; i < hull.count() && c.dimensions == 1; ++i) {
    const Vec3d v = hull.vertices[i];
    if (!(best.value - dot(n, v) <= tolerance)) continue;
    const Vec3d e = v - first;
    if (squared_norm(e) <= least * least) continue;
    if (norm(cross(c.edge, e)) > least) c.dimensions = 2;
  }
  c.edge = R * c.edge;
  return c;
}

/// The same for the face of a half-space, a disc at an end of a cone or cylinder, or its side.
inline Contact contact_of_primitive(const Primitive& primitive, const Mat3d& R, const Vec3d& n_w, double angle) {
  if (primitive.kind == Primitive::Kind::kHalfSpace) return {2, {0, 0, 0}};
  if (primitive.kind == Primitive::Kind::kEllipsoid) return {};
  const Vec3d n = R.transpose_times(n_w), &size = primitive.size;
  const double across = std::hypot(n.x, n.y), tolerance = angle * std::hypot(size.x, size.z);
  const bool has_two_discs = primitive.kind == Primitive::Kind::kCylinder;
  if ((n.z < 0 || has_two_discs) && size.x * across <= tolerance) return {2, {0, 0, 0}};
  if (has_two_discs && size.z * std::abs(n.z) <= tolerance) return {1, R * Vec3d{0, 0, 1}};
  if (has_two_discs) return {};
  if (!(std::abs(2 * size.z * n.z - size.x * across) <= tolerance)) return {};
  const Vec3d side{-size.x * n.x / across, -size.x * n.y / across, 2 * size.z};
  return {1, R * side * (1 / norm(side))};
}
template <class Hull>
CLEARANCE_HD inline Contact contact_along(const Hull& hull, const Mat3d& R, const Vec3d& n_w, double angle) {
  return contact_of_vertices(hull, R, n_w, angle);
}
/// Contact of a part. A core in closed form needs no vertices. A template, so that device compilers skip it.
template <std::same_as<ConvexPart> P>
inline Contact contact_along(const P& part, const Mat3d& R, const Vec3d& n_w, double angle) {
  if (part.primitive) return contact_of_primitive(*part.primitive, R, n_w, angle);
  return contact_of_vertices(part, R, n_w, angle);
}

/// Bound on the error of a converged normal, in radians. Vertices determine it up to rounding. For a curved core the
/// iteration ends when the bounds meet the tolerance, and cos(angle) >= lower / upper.
inline double normal_angle(const ConvexPart& a, const ConvexPart& b, double lower, double upper) {
  const auto is_curved = [](const ConvexPart& p) {
    return p.primitive && p.primitive->kind != Primitive::Kind::kHalfSpace;
  };
  if (!(is_curved(a) || is_curved(b)) || !(0 < lower && lower <= upper)) return kContactAngle;
  constexpr double kArcPerChord = 1.12;  // up to a right angle
  return std::max(kContactAngle, kArcPerChord * std::sqrt(2 * (upper - lower) / upper));
}

/// Whether the nearest points of two separated parts are not unique: both touch the supporting planes normal to n in
/// parallel faces or edges.
/// \param n unit, world axes, from a towards b, within `angle` of the exact one
template <class Hull>
CLEARANCE_HD inline bool witness_is_ambiguous(const Hull& a, const Mat3d& R_wa, const Hull& b, const Mat3d& R_wb,
                                              const Vec3d& n, double angle) {
  const Contact ca = contact_along(a, R_wa, n, angle);
  if (ca.dimensions == 0) return false;
  const Contact cb = contact_along(b, R_wb, -n, angle);
  if (cb.dimensions == 0) return false;
  return ca.dimensions + cb.dimensions > 2 || norm(cross(ca.edge, cb.edge)) < angle;
}

/// Whether kFlagNonsmooth is set: the bodies may touch, uncertainty included, or their nearest points are not unique.
/// \param lower of the answer
template <class Hull>
CLEARANCE_HD inline bool is_nonsmooth(double lower, const Hull& a, const Mat3d& R_wa, const Hull& b, const Mat3d& R_wb,
                                      const Vec3d& n, double angle = kContactAngle) {
  return lower <= 0 || witness_is_ambiguous(a, R_wa, b, R_wb, n, angle);
}

}  // namespace clearance
