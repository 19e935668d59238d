// How a run of GJK on a placed pair is set up, and what its end says: written once for one pair alone, for SIMD lanes
// and for a device's thread, whose answers have the same bits for that. What proofs rest on stands here and in
// certify.h.
//
// S is the scalar of the arithmetic (double, float, DoubleDouble), T that scalar or a pack of it. A hull is whatever
// has the members `centre`, `rho`, `spread` and `radius` of Piece.
#pragma once

#include "engine/narrow/certify.h"
#include "engine/narrow/lanes.h"

namespace clearance {

/// kFromCentres: vertices and offsets are from the pieces' centres, so that the digits are spent on the shapes and the
/// gap. kStrict, kMore: comparisons err by the arithmetic's own rounding, so a little more is asked for. kUnbounded:
/// cut-offs from here on, in metres, are none; below it their squares do not overflow.
template <class S>
struct RunSetup {
  static constexpr bool kFromCentres = false;
  static constexpr double kStrict = 1, kMore = 1, kUnbounded = 1e150;
};
template <>
struct RunSetup<float> {
  static constexpr bool kFromCentres = true;
  static constexpr double kStrict = 1 - 0x1p-20, kMore = 1 + 0x1p-20, kUnbounded = 1e15;
};

/// How far a hull's vertices lie from where they are counted from, at most: metres, rounded up.
template <class S, class Hull>
CLEARANCE_INLINE S reach_of(const Hull& hull) {
  return static_cast<S>(RunSetup<S>::kFromCentres ? hull.spread * (1 + 0x1p-20) : hull.rho);
}

/// Where b is for a: the axes are those of a's body.
template <class S>
struct PairFrame {
  Mat3<S> R;         ///< turns what has b's axes
  Vec3<S> D;         ///< from what a's vertices are counted from to what b's are, metres
  S extra{0};        ///< metres: what D errs by in float32, beyond what RoundingUnits cover
  bool fits = true;  ///< S can hold it

  template <class Vertex>
  CLEARANCE_HD Vec3<S> cso_vertex(const Vertex& a, const Vertex& b) const {
    return a - R * b - D;
  }
};
/// \param t_a, t_b origins of the bodies in the world
template <class S, class HullA, class HullB>
CLEARANCE_INLINE PairFrame<S> pair_frame(const HullA& a, const Mat3d& R_wa, const Vec3d& t_a, const HullB& b,
                                         const Mat3d& R_wb, const Vec3d& t_b) {
  const Mat3d R = R_wa.transpose_times(R_wb);
  Vec3d D = R_wa.transpose_times(t_b - t_a);
  if constexpr (!RunSetup<S>::kFromCentres) {
    return {R, D};
  } else {
    using std::abs;
    const double size = a.rho + b.rho + a.radius + b.radius + abs(D.x) + abs(D.y) + abs(D.z);
    if (!is_zero(a.centre)) D = D - a.centre;
    if (!is_zero(b.centre)) D = D + R * b.centre;
    // Rotations, products and sums of float64: docs/bounds.md, float32.
    return {cast<S>(R), cast<S>(D), static_cast<S>(24 * 0x1p-53 * (1 + 0x1p-20) * size), size < 1e6};
  }
}

/// What the runs of a query have in common: half of the width asked is for GJK, half for the bounds' own rounding.
/// \param rounded, bounded whether one of them has a radius, or a cut-off below kUnbounded
template <class T>
CLEARANCE_INLINE GjkLimits<T> run_limits(double abs_tol, double rel_tol, bool rounded, bool bounded) {
  GjkLimits<T> limits;
  limits.rel_tol = T(rel_tol / 2);
  limits.abs_tol = T(abs_tol / 2);
  limits.radius = limits.max_distance = T(0.0);
  limits.squared = !rounded && abs_tol == 0;
  limits.bounded = bounded;
  return limits;
}
/// How far two cores must be apart for their pieces to be proved farther than a cut-off.
/// \param lower_error the rounding term of lower bounds
template <class T>
CLEARANCE_INLINE T core_cut_off(const T& cut_off, const T& radius, const T& lower_error) {
  return cut_off + radius + T(2.0) * lower_error;
}
/// The same from the pair's scale, in the arithmetic of T.
template <class T>
CLEARANCE_INLINE T core_cut_off_at(const T& cut_off, const T& radius, const T& scale) {
  return core_cut_off(cut_off, radius, rounding_error(T(RoundingUnits<T>::kLower), scale));
}

/// The first guess of v: the CSO's centre, or any direction if that is the origin.
template <class T>
CLEARANCE_INLINE Vec3<T> first_direction(Vec3<T> centre) {
  centre.x = select(squared_norm(centre) > T(0.0), centre.x, T(1.0));
  return centre;
}

/// What a settled run in the arithmetic S says of directions, lengths and shares, where `size` and `share` are set.
/// \param v, w of the run, the point that proves its upper bound: a's axes
template <class S>
CLEARANCE_INLINE void take_run(LaneWitness& witness, const Mat3d& R_wa, const Vec3d& v, double v_length, const Vec3d& w,
                               double separation_length) {
  witness.n = R_wa * -v;
  witness.separation = -(R_wa * w);
  if constexpr (!RunSetup<S>::kFromCentres) {
    witness.n_length = v_length;
    witness.separation_length = separation_length;
  } else {
    // Float32 lengths are right in float32 only. So are shares, which would put the points outside their pieces.
    witness.n_length = norm(witness.n);
    witness.separation_length = norm(witness.separation);
    double sum = 0;
    CLEARANCE_UNROLL
    for (std::uint32_t i = 0; i < 3; ++i)
      if (i < witness.size) sum += witness.share[i];
    CLEARANCE_UNROLL
    for (std::uint32_t i = 0; i < 3; ++i)
      if (i < witness.size) witness.share[i] /= sum;
  }
}

}  // namespace clearance
