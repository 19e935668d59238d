// Set-up of a run of GJK on a placed pair, and the use of its end. The same source serves single pairs, SIMD lanes and
// device threads, so that their answers have the same bits. All that proofs depend on is here and in certify.h.
//
// S is the scalar of the arithmetic (double, float, DoubleDouble), T that scalar or a pack of it. A hull is any type
// with the members `centre`, `rho`, `spread` and `radius` of `ConvexPart`.
#pragma once

#include "engine/narrow/answer.h"
#include "engine/narrow/certify.h"
#include "engine/narrow/lanes.h"

namespace clearance {

/// kFromCentres: vertices and offsets are relative to the parts' centres, so that shapes and gap use all digits.
/// kStrict, kMore: factors that tighten the tolerance, since comparisons have the arithmetic's own rounding.
/// kUnbounded: cut-offs of this length or more (metres) are ignored; below it their squares do not overflow.
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

/// Maximum distance of a hull's vertices from their reference point, in metres, rounded up.
template <class S, class Hull>
CLEARANCE_INLINE S reach_of(const Hull& hull) {
  return static_cast<S>(RunSetup<S>::kFromCentres ? hull.spread * (1 + 0x1p-20) : hull.rho);
}

/// Placement of b relative to a, in the axes of a's body.
template <class S>
struct PairFrame {
  Mat3<S> R;         ///< rotates from b's axes
  Vec3<S> D;         ///< from the reference point of a's vertices to that of b's, metres
  S extra{0};        ///< error of D in float32 beyond RoundingUnits, metres
  bool fits = true;  ///< S can represent it

  template <class Vertex>
  CLEARANCE_HD Vec3<S> cso_vertex(const Vertex& a, const Vertex& b) const {
    return a - R * b - D;
  }
};
/// \param t_a,t_b origins of the bodies in the world
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
    // Rotations, products and sums of float64: docs/trust/bounds.md, float32.
    return {cast<S>(R), cast<S>(D), static_cast<S>(24 * 0x1p-53 * (1 + 0x1p-20) * size), size < 1e6};
  }
}

/// Limits that the runs of a query share: half of the tolerance is for GJK, half for the bounds' own rounding.
/// \param rounded,bounded whether any pair has a radius, or a cut-off below kUnbounded
template <class T>
CLEARANCE_INLINE GjkLimits<T> run_limits(double abs_tol, double rel_tol, bool rounded, bool bounded) {
  // A run's last steps take little time, and a nearest pair with wide bounds leaves fewer others out.
  constexpr double kMostAbsTol = 1e-4, kMostRelTol = 0x1p-10;
  GjkLimits<T> limits;
  limits.rel_tol = T((rel_tol < kMostRelTol ? rel_tol : kMostRelTol) / 2);
  limits.abs_tol = T((abs_tol < kMostAbsTol ? abs_tol : kMostAbsTol) / 2);
  limits.contact_tol = T(contact_tolerance(abs_tol) / 2);
  limits.radius = limits.max_distance = T(0.0);
  limits.squared = !rounded && abs_tol == 0;
  limits.bounded = bounded;
  return limits;
}
/// Distance of two cores that proves their parts farther apart than a cut-off.
/// \param lower_error the rounding term of lower bounds
template <class T>
CLEARANCE_INLINE T core_cut_off(const T& cut_off, const T& radius, const T& lower_error) {
  return cut_off + radius + T(2.0) * lower_error;
}
/// The same from the pair's scale, in the arithmetic of T.
/// \param round_units as in RunBounds
template <class T>
CLEARANCE_INLINE T core_cut_off_at(const T& cut_off, const T& radius, const T& scale, const T& round_units = T(0)) {
  return core_cut_off(cut_off, radius, rounding_error(T(RoundingUnits<T>::kLower) + round_units, scale));
}

/// The first guess of v: the CSO's centre, or any direction if that is the origin.
template <class T>
CLEARANCE_INLINE Vec3<T> first_direction(Vec3<T> centre) {
  centre.x = select(squared_norm(centre) > T(0.0), centre.x, T(1.0));
  return centre;
}

/// Takes directions, lengths and shares from a converged run in the arithmetic S. `size` and `share` are set already.
/// \param v,w of the run, the point that proves its upper bound: a's axes
template <class S>
CLEARANCE_INLINE void take_run(LaneWitness& witness, const Mat3d& R_wa, const Vec3d& v, double v_length, const Vec3d& w,
                               double separation_length) {
  witness.n = R_wa * -v;
  witness.separation = -(R_wa * w);
  if constexpr (!RunSetup<S>::kFromCentres) {
    witness.n_length = v_length;
    witness.separation_length = separation_length;
  } else {
    // Float32 lengths are right in float32 only. So are shares, which would put the points outside their parts.
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
