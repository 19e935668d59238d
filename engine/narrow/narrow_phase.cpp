#include "engine/narrow/narrow_phase.h"

#include <limits>
#include <optional>
#include <utility>

#include "engine/narrow/attempt.h"
#include "engine/narrow/proof.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

PlacedPair<double> placed(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                          const PoseMatrix& pose_b) {
  return {a, pose_a.R_wb, pose_a.t_w, b, pose_b.R_wb, pose_b.t_w};
}
PlacedPair<DoubleDouble> placed_in_fine(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                        const PoseMatrix& pose_b) {
  return {a, rotation_of_double_double(pose_a.X_wb), pose_a.t_w, b, rotation_of_double_double(pose_b.X_wb), pose_b.t_w};
}

template <class T>
void attempt_plane(const PlacedPair<T>& pair, BoundsCollector& answer) {
  const PlaneBounds plane = certify_plane(pair, answer.wants_depth());
  answer.mark_deep();  // its points lie along the normal, apart or not
  answer.raise_lower(plane.bounds.lower, Vec3<T>{T(0), T(0), T(1)});
  answer.lower_upper(plane.bounds.upper, plane.nearest);
}

// Answers a half-space, a, and another part, without a search. Proves nothing for two half-spaces.
NarrowAnswer against_half_space(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                const PoseMatrix& pose_b, const NarrowLimits& limits, bool in_fine) {
  if (is_half_space(b)) return {};
  BoundsCollector answer(limits, pose_a.R_wb, a.radius, b.radius);
  if (!in_fine) attempt_plane(placed(a, pose_a, b, pose_b), answer);
  if (in_fine || !answer.converged()) attempt_plane(placed_in_fine(a, pose_a, b, pose_b), answer);
  NarrowAnswer r = answer.finish();
  r.rounding = rounding_of(a, pose_a, b, pose_b);
  return r;
}
// The same with the half-space as a or b. Nothing if neither is one.
std::optional<NarrowAnswer> against_half_space(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                               const PoseMatrix& pose_b, bool in_fine, const NarrowLimits& limits) {
  if (is_half_space(a)) return against_half_space(a, pose_a, b, pose_b, limits, in_fine);
  if (!is_half_space(b)) return {};
  NarrowAnswer r = against_half_space(b, pose_b, a, pose_a, limits, in_fine);
  std::swap(r.point_a, r.point_b);
  r.normal = -r.normal;
  return r;
}

// narrow_phase() with an empty answer.
NarrowAnswer narrow_down(BoundsCollector answer, const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                         const PoseMatrix& pose_b, const NarrowLimits& limits, const Gjk<double>* done,
                         WorkMeter* meter, PausedPairPtr* paused) {
  const bool in_fine = paused && dynamic_cast<PausedEpa<DoubleDouble>*>(paused->get());
  const PlacedPair<double> pair = placed(a, pose_a, b, pose_b);
  if (pair.is_round()) paused = nullptr;  // the points found by a paused run would be lost
  SeedSimplex seed;
  if (!in_fine) {
    seed = seed_of(attempt(pair, limits, seed, answer, meter, paused, done));
    if (pair.is_round()) seed = {};  // refers to points that only this attempt has found
  }
  if (in_fine || !answer.converged()) {
    const PlacedPair<DoubleDouble> fine = placed_in_fine(a, pose_a, b, pose_b);
    attempt(fine, limits, seed, answer, meter, paused);
  }
  if (answer.has_surface()) {
    const PlacedPair<DoubleDouble> fine = placed_in_fine(a, pose_a, b, pose_b);
    for (CsoVertex<DoubleDouble>& v : answer.surface_vertices()) v.w = fine.cso_vertex(v.a, v.b);
    answer.replace_witness(
        certify_upper(fine, around_origin<DoubleDouble>(answer.surface_vertices().data(), answer.surface_faces().data(),
                                                        answer.surface_faces().size())));
  }
  NarrowAnswer r = answer.finish();
  r.rounding = rounding_width(pair.scale);
  return r;
}

}  // namespace

NarrowAnswer narrow_phase(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                          const NarrowLimits& limits, const Gjk<double>* done, WorkMeter* meter,
                          std::unique_ptr<PausedPair>* paused) {
  if (const auto plane = against_half_space(a, pose_a, b, pose_b, false, limits)) return *plane;
  return narrow_down(BoundsCollector(limits, pose_a.R_wb, a.radius, b.radius), a, pose_a, b, pose_b, limits, done,
                     meter, paused);
}

NarrowAnswer narrow_phase_proved(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                 const PoseMatrix& pose_b, const NarrowLimits& limits, NarrowProof& proof) {
  proof = {};
  if (is_half_space(a) || is_half_space(b)) {
    NarrowAnswer plane;
    plane.bounds = plane_proved(a, pose_a, b, pose_b, proof);
    return plane;
  }
  return narrow_down(BoundsCollector(limits, pose_a.R_wb, a.radius, b.radius, &proof), a, pose_a, b, pose_b, limits,
                     nullptr, nullptr, nullptr);
}

double rounding_of(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b) {
  const PlacedPair<double> pair = placed(a, pose_a, b, pose_b);
  return rounding_width(pair.scale);
}

void take_lane_witness(const ConvexPart& a, const Mat3d& R_wa, const ConvexPart& b, const Mat3d& R_wb,
                       const CoreWitness& lane, Vec3d& point_a, Vec3d& point_b, Vec3d& normal) {
  converged_points(a, R_wa, b, R_wb, lane, point_a, point_b, is_round(a) ? &lane.core_a : nullptr,
                   is_round(b) ? &lane.core_b : nullptr);
  normal = converged_normal(lane);
}

NarrowAnswer narrow_phase_reference(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                    const PoseMatrix& pose_b, const NarrowLimits& limits) {
  NarrowLimits whole = limits;
  whole.max_distance = kInf;
  whole.stop_below = -kInf;
  if (auto plane = against_half_space(a, pose_a, b, pose_b, true, whole)) {
    plane->beyond = plane->bounds.lower > limits.max_distance;
    return *plane;
  }
  BoundsCollector answer(whole, pose_a.R_wb, a.radius, b.radius);
  const PlacedPair<DoubleDouble> pair = placed_in_fine(a, pose_a, b, pose_b);
  attempt(pair, whole, SeedSimplex{}, answer, nullptr);
  NarrowAnswer r = answer.finish();
  r.beyond = r.bounds.lower > limits.max_distance;
  r.rounding = rounding_of(a, pose_a, b, pose_b);
  return r;
}

}  // namespace clearance
