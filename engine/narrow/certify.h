// The only source of bounds. All other code only proposes directions, points and simplices.
//
// Works in the frame of body a, on the stored vertices of the convex parts, so that a bound does not depend on the
// source of its proposal. One rotation takes b's vertices to that frame, and directions back; a's vertices stay as they
// are stored. docs/trust/bounds.md derives the rounding terms, and tests/oracle measures them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/arithmetic.h"
#include "engine/hull/convex_part.h"
#include "engine/hull/primitive.h"
#include "engine/hull/support.h"
#include "engine/narrow/gjk/gjk.h"
#include "engine/pose/pose.h"

namespace clearance {

/// A certified interval, in metres.
struct Interval {
  double lower, upper;

  /// Whether any number lies in it. If not, the computation itself is broken: a table, the compiler or the machine.
  bool is_possible() const { return lower <= upper; }  // false for a NaN
};

/// Rounding terms of the bounds, in units of Arithmetic<T>::kUnit times S. Derived in docs/trust/bounds.md.
template <class T>
struct RoundingUnits;
template <>
struct RoundingUnits<double> {
  static constexpr double kLower = 30, kUpper = 34, kBall = 34;
};
/// For vertices relative to the part's centre, each rounded to float32.
template <>
struct RoundingUnits<float> {
  static constexpr double kLower = 21, kUpper = 23;
};
template <>
struct RoundingUnits<DoubleDouble> {
  static constexpr double kLower = 44, kUpper = 48, kBall = 48;
};
/// Added to each term if one or both cores are round, for the error of their points and supports.
inline constexpr double kRoundUnits = 8;

/// S of two parts: |D| + rho_a + rho_b + r_a + r_b, rounded up. A scalar or a pack.
template <class T>
CLEARANCE_HD inline T pair_scale(const Vec3<T>& D, const T& rho_a, const T& rho_b, const T& radius) {
  return (norm(D) + rho_a + rho_b + radius) * T(1 + 32 * Arithmetic<T>::kUnit);
}
/// Whether float32 suits two parts of these sizes (spread + radius, in metres): their sixth powers neither overflow nor
/// vanish.
CLEARANCE_HD inline bool sizes_fit_f32(double a, double b) {
  const double size = a < b ? b : a;
  return size > 1e-5 && size < 1e5;
}

/// Length of `units` rounding units (RoundingUnits) at a scale S. A scalar or a pack.
template <class T>
CLEARANCE_HD inline T rounding_error(const T& units, const T& scale) {
  return units * T(Arithmetic<T>::kUnit) * scale * T(1 + 16 * Arithmetic<T>::kUnit) +
         T(Arithmetic<T>::kUnderflowLength);
}

/// Lower bound on the distance of two placed parts other than half-spaces: from their balls, and from both boxes in the
/// axes of each body. Much cheaper than a search; proves nothing unless positive. docs/trust/bounds.md, boxes.
/// \param R,D of their PairFrame<double>
/// \param enough a bound above this is not raised further, in metres
CLEARANCE_HD inline double certify_parts_gap(const HullExtents& a, const HullExtents& b, const Mat3d& R, const Vec3d& D,
                                             double enough) {
  using std::abs;
  using std::sqrt;
  const double radius = a.radius + b.radius, less = radius + rounding_error(160.0, pair_scale(D, a.rho, b.rho, radius));
  const Vec3d in_a = (D + R * b.centre) - a.centre;
  double gap = norm(in_a) - (a.spread + b.spread) - less;
  const auto raise = [&](const Vec3d& centre, const Vec3d& half, const Vec3d& turned, double spread) {
    double squared = 0;
    for (int k = 0; k < 3; ++k) {
      const double beyond = abs(centre[k]) - (half[k] + (turned[k] < spread ? turned[k] : spread));
      squared += beyond > 0 ? beyond * beyond : 0;
    }
    const double boxes = sqrt(squared) - less;
    gap = gap < boxes ? boxes : gap;
  };
  if (gap > enough) return gap;
  const auto length = [](const Vec3d& v) { return Vec3d{abs(v.x), abs(v.y), abs(v.z)}; };
  const Mat3d turn{{length(R.row[0]), length(R.row[1]), length(R.row[2])}};
  raise(in_a, a.half, turn * b.half, b.spread);
  if (gap > enough) return gap;
  raise(R.transpose_times(in_a), b.half, turn.transpose_times(a.half), a.spread);
  return gap;
}

/// Width that rounding alone gives the float64 bounds of two placed parts, in metres.
/// \param scale their pair_scale()
CLEARANCE_HD inline double rounding_width(double scale) {
  return rounding_error(double(RoundingUnits<double>::kLower), scale) +
         rounding_error(double(RoundingUnits<double>::kUpper), scale);
}

/// Lower bound that a support gap proves. A scalar or a pack.
/// \param gap of the planes normal to a direction of length `length`, times that length
/// \param error the rounding term
template <class T>
CLEARANCE_HD inline T lower_from_gap(const T& gap, const T& length, const T& radius, const T& error) {
  return (gap / length - radius) - error;
}

/// Point of the CSO given by a simplex and its weights: `share` of each vertex, with sum 1 up to rounding. Weights
/// below 0 count as 0; without any weight it is the first vertex. A scalar or a pack.
template <class T>
struct SimplexPoint {
  T share[4];
  Vec3<T> w;

  CLEARANCE_HD explicit SimplexPoint(const Simplex<T>& s) {
    using Count = typename Lane<T>::Count;
    const T zero(0);
    T sum = zero;
    CLEARANCE_UNROLL
    for (int i = 0; i < 4; ++i) {
      share[i] = zero;
      const auto there = s.size > Count(i);
      if (!any(there)) continue;
      share[i] = select(there & (s.weight[i] > zero), s.weight[i], zero);
      sum = sum + share[i];
    }
    share[0] = select(sum > zero, share[0], T(1));
    sum = select(sum > zero, sum, T(1));
    w = {zero, zero, zero};
    CLEARANCE_UNROLL
    for (int i = 0; i < 4; ++i) {
      const auto there = s.size > Count(i);
      if (!any(there)) continue;
      share[i] = share[i] / sum;
      w = select(there, w + s.vertex[i].w * share[i], w);
    }
  }
};
/// Upper bound that a point of the CSO proves, since both cores have a point and these are `length` apart.
template <class T>
CLEARANCE_HD inline T upper_from_point(const T& length, const T& radius, const T& error) {
  return (length - radius) + error;
}

/// Bounds that a run of GJK with proved supports gives by itself, and whether they suffice. A scalar or a pack.
template <class T>
struct RunBounds {
  using Mask = typename Lane<T>::Mask;
  SimplexPoint<T> nearest;
  T v_length, length;  ///< of the direction that proves `lower`, and of nearest.w, which proves `upper`
  T lower, upper;      ///< -inf, +inf without a proof
  Mask converged;      ///< apart, and narrow enough or beyond max_distance; false if the bounds contradict each other

  /// \param extra error of the run's input, in metres: of float32 offsets
  /// \param stop_below upper bound that is low enough to stop, in metres
  /// \param round_units kRoundUnits if a core is round, else 0
  CLEARANCE_HD RunBounds(const Gjk<T>& g, const T& radius, const T& scale, const T& max_distance, const T& abs_tol,
                         const T& rel_tol, const T& extra = T(0), const T& stop_below = T(-__builtin_inf()),
                         const T& round_units = T(0))
      : nearest(g.simplex), v_length(norm(g.v)), length(norm(nearest.w)) {
    const T zero(0), infinite(__builtin_inf());
    const Mask open_end = (g.end == g.code(GjkEnd::kEncloses)) | (g.end == g.code(GjkEnd::kLimit));
    const Mask proved = (!open_end) & (g.squared_distance > T(Arithmetic<T>::kSafelySquared));
    const T lower_units = T(RoundingUnits<T>::kLower) + round_units,
            upper_units = T(RoundingUnits<T>::kUpper) + round_units;
    const T low = lower_from_gap(g.gap, v_length, radius, rounding_error(lower_units, scale) + extra);
    const T high = upper_from_point(length, radius, rounding_error(upper_units, scale) + extra);
    const T relative = rel_tol * high, width = high - low;
    const Mask narrow = (low > zero) & ((width <= abs_tol) | (width <= relative) | (high <= stop_below));
    converged = proved & (low <= high) & ((low > max_distance) | narrow);
    lower = select(proved, low, -infinite);
    upper = select(proved, high, infinite);
  }
};

/// Points of a part's core, by the numbers that simplices and surfaces use: the vertices of a hull, or the points found
/// so far of a round core, in that order. The first of those is its origin.
template <class T>
class CorePoints {
 public:
  explicit CorePoints(const ConvexPart& part) : part_(&part) {
    if (is_round(part)) found_.push_back({T(0), T(0), T(0)});
  }
  Vec3<T> operator[](std::uint32_t i) const { return found_.empty() ? cast<T>(part_->vertices[i]) : found_[i]; }
  std::size_t size() const { return found_.empty() ? part_->vertices.size() : found_.size(); }
  /// support(), whose index names the point. A new point of a round core is added.
  SupportPoint<T> farthest(const Vec3<T>& n);

 private:
  const ConvexPart* part_;
  std::vector<Vec3<T>> found_;  // of a round core
};

/// Two placed parts, in the arithmetic T and the frame of a.
template <class T>
struct PlacedPair {
  const ConvexPart* a;
  const ConvexPart* b;
  Mat3<T> R_wa, R_wb;                        ///< convert results to world axes
  Mat3<T> R;                                 ///< R_wa^T R_wb
  Vec3<T> D;                                 ///< R_wa^T (t_b - t_a)
  double scale;                              ///< S = |D| + rho_a + rho_b + r_a + r_b, rounded up
  T radius;                                  ///< r_a + r_b; exact in double-double
  mutable CorePoints<T> points_a, points_b;  ///< of round cores: the points found so far

  PlacedPair(const ConvexPart& part_a, const Mat3<T>& R_a, const Vec3d& t_a, const ConvexPart& part_b,
             const Mat3<T>& R_b, const Vec3d& t_b);

  double lower_error() const { return error(RoundingUnits<T>::kLower); }
  double upper_error() const { return error(RoundingUnits<T>::kUpper); }
  double ball_error() const { return error(RoundingUnits<T>::kBall); }

  /// A vertex of the CSO A - B, in a's axes.
  Vec3<T> cso_vertex(std::uint32_t ia, std::uint32_t ib) const { return points_a[ia] - R * points_b[ib] - D; }
  /// Whether a core is round, so that its points are found during the search, and up to rounding only.
  bool is_round() const { return clearance::is_round(*a) || clearance::is_round(*b); }

 private:
  double error(double units) const;
};

/// Lower bound on the signed distance from a gap with proved supports (Gjk::gap and |Gjk::v|).
/// \param gap of the supporting planes normal to a direction of length `length`, times that length
template <class T>
double certify_lower(const PlacedPair<T>& pair, const T& gap, const T& length);
/// Lower bound on the signed distance: the gap between the supporting planes normal to n.
/// \param n axes of a, from a towards b, any length but zero
template <class T>
double certify_lower(const PlacedPair<T>& pair, const Vec3<T>& n);

/// One point of each part (its core grown by the radius), and an upper bound on their distance.
struct Witness {
  double upper;      ///< metres: |p_a - p_b| - r_a - r_b + rounding; an upper bound on the signed distance
  Vec3d core_a;      ///< point of the core of a, from the origin of a, world axes
  Vec3d core_b;      ///< point of the core of b, from the origin of b, world axes
  Vec3d separation;  ///< p_b - p_a of the cores, world axes
  double length;     ///< its length, computed before the rotation to world axes
};
/// Witness given by a simplex and its weights. Weights below 0 count as 0, and their sum need not be 1. Reads the
/// vertices' indices, not their `w`.
template <class T>
Witness certify_upper(const PlacedPair<T>& pair, const Simplex<T>& simplex);

/// Bounds from the plane of a half-space: along its normal the gap to the other part is the signed distance itself.
struct PlaneBounds {
  Interval bounds;  ///< of the signed distance
  Witness nearest;  ///< of the two cores' signed distance; `upper` is bounds.upper
};
/// \param pair a is a half-space, b is not
/// \param signed_distance for overlapping cores, whether the second point is the foot on the plane; otherwise it is a
/// common point
template <class T>
PlaneBounds certify_plane(const PlacedPair<T>& pair, bool signed_distance);

/// A triangle of CSO vertices (indices into a list), a direction that it lies beyond, in axes of a, and the triangles
/// across its edges. Edge i goes from vertex i to the next; a half-edge is an edge of a face.
template <class T>
struct CsoFace {
  std::array<std::uint32_t, 3> vertex;
  std::array<std::uint32_t, 3> twin;  ///< across edge i: the half-edge of the other face, from its end to its beginning
  Vec3<T> normal;
};
CLEARANCE_HD constexpr std::uint32_t half_edge(std::uint32_t face, std::uint32_t edge) {
  return face << 2 | edge;
}
CLEARANCE_HD constexpr std::uint32_t face_of(std::uint32_t half_edge) {
  return half_edge >> 2;
}
CLEARANCE_HD constexpr std::uint32_t edge_of(std::uint32_t half_edge) {
  return half_edge & 3;
}

/// Proves that a ball around the origin lies inside a closed surface of CSO triangles, and returns its radius (metres,
/// rounding taken off): the parts' cores overlap by at least that much. Returns 0 or less without a proof. The surface
/// is checked, not trusted: every edge must have a twin in the opposite sense, every triangle must lie beyond its
/// plane, and they must go around the origin.
template <class T>
double certify_ball(const PlacedPair<T>& pair, std::span<const CsoVertex<T>> vertices,
                    std::span<const CsoFace<T>> faces);

/// Upper bound on the signed distance of two grown parts whose cores' overlap holds a ball (see certify_ball).
double certify_overlap(const ConvexPart& a, const ConvexPart& b, double ball);

}  // namespace clearance
