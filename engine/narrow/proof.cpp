#include "engine/narrow/proof.h"

#include <cmath>
#include <type_traits>
#include <utility>

#include "engine/hull/primitive.h"
#include "engine/narrow/certify.h"

namespace clearance {

namespace {

PlacedPair<double> placed(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                          double) {
  return {a, pose_a.R_wb, pose_a.t_w, b, pose_b.R_wb, pose_b.t_w};
}
PlacedPair<DoubleDouble> placed(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                const PoseMatrix& pose_b, DoubleDouble) {
  return {a, rotation_of_double_double(pose_a.X_wb), pose_a.t_w, b, rotation_of_double_double(pose_b.X_wb), pose_b.t_w};
}

// Takes the bounds of one arithmetic where they are tighter than those so far. Upper bounds are proved by the farthest
// point of b along -n, as certify_plane() finds it, and the half-space's origin: they give the point's height over the
// plane.
// \param pair a is the half-space
template <class T>
void above_plane(const PlacedPair<T>& pair, Interval& bounds, NarrowProof& proof) {
  constexpr bool kFine = std::is_same_v<T, DoubleDouble>;
  const Interval found = certify_plane(pair, true).bounds;
  if (found.lower > bounds.lower) {
    bounds.lower = found.lower;
    proof.lower_in_double_double = kFine;
  }
  if (!(found.upper < bounds.upper)) return;
  bounds.upper = found.upper;
  proof.upper_in_double_double = kFine;
  const std::uint32_t deepest = pair.points_b.farthest(-pair.R.transpose_times(Vec3<T>{T(0), T(0), T(1)})).index;
  proof.points_a = {{0, 0, 0}};
  proof.points_b.clear();
  if (is_round(*pair.b)) proof.points_b.push_back(cast<DoubleDouble>(pair.points_b[deepest]));
  proof.vertices = {{0, is_round(*pair.b) ? 0 : deepest, 1}};
}

}  // namespace

Interval plane_proved(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                      NarrowProof& proof) {
  proof = {};
  Interval bounds{-HUGE_VAL, HUGE_VAL};
  if (is_half_space(a) && is_half_space(b)) return bounds;
  const bool is_b = is_half_space(b);
  const ConvexPart &plane = is_b ? b : a, &other = is_b ? a : b;
  const PoseMatrix &X_wp = is_b ? pose_b : pose_a, &X_wo = is_b ? pose_a : pose_b;
  const auto fine = placed(plane, X_wp, other, X_wo, DoubleDouble());
  above_plane(placed(plane, X_wp, other, X_wo, double()), bounds, proof);
  above_plane(fine, bounds, proof);
  proof.direction = {0, 0, 1};
  if (!is_b) return bounds;
  proof.direction = -fine.R.transpose_times(proof.direction);
  proof.is_against_b = true;
  std::swap(proof.points_a, proof.points_b);
  for (ProofVertex& v : proof.vertices) std::swap(v.a, v.b);
  return bounds;
}

double lower_along(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                   const Vec3d& n_w, NarrowProof& proof) {
  if (is_half_space(a) || is_half_space(b)) return plane_proved(a, pose_a, b, pose_b, proof).lower;
  const auto pair = placed(a, pose_a, b, pose_b, DoubleDouble());
  proof = {};
  proof.direction = pair.R_wa.transpose_times(cast<DoubleDouble>(n_w));
  proof.lower_in_double_double = true;
  return certify_lower(pair, proof.direction);
}

}  // namespace clearance
