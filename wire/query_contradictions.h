// Options of a query that contradict each other, whatever its pairs and configurations.
#pragma once

#include <clearance/types.h>

#include <cstdint>
#include <limits>

namespace clearance {

struct Contradiction {
  const char* text = nullptr;   ///< begins with the name of an option; null if there is none
  bool is_unsupported = false;  ///< valid, but no engine answers it
};

/// Returns the first contradiction in a type with the options and arrays of a query.
template <class Q>
Contradiction contradiction_in(const Q& q) {
  const auto has = [&q](std::uint32_t fields) { return (q.fields & fields) != 0; };
  const bool any = q.reduce == Reduce::kAny, is_motion = q.max_evaluations > 0;
  const bool has_margins = q.margin != 0 || !q.margins.empty() || !q.pair_margins.empty();
  if (has_margins && !any && !is_motion)
    return {"margin: only for reduce any and motions; use max_distance for other queries"};
  if (any && q.max_distance < std::numeric_limits<double>::infinity())
    return {"max_distance: reduce any uses its margins instead"};
  if (any && q.signed_distance) return {"signed_distance: reduce any computes no depth"};
  if (has(kFieldGradientJoints) && q.joints.empty()) return {"fields: gradient_joints is for a query with joints"};
  if (has(kFieldHessianJoints) && q.joints.empty()) return {"fields: hessian_joints is for a query with joints"};
  if (has(kSecondOrderFields) && any)
    return {"fields: reduce any has no rate, rate_bounds, curvature, hessian_joints and smooth_radius"};
  if (!q.velocities.empty() && !has(kRateFields))
    return {"velocities: only for the columns rate, rate_bounds and curvature"};
  if (!q.twists.empty() && !has(kRateFields)) return {"twists: only for the columns rate, rate_bounds and curvature"};
  if (!q.speed_errors.empty() && !has(kFieldRateBounds)) return {"speed_errors: only for the column rate_bounds"};
  if (q.k > 0 && q.reduce != Reduce::kNearest) return {"k: only for reduce nearest"};
  if (!is_motion && has(kMotionFields))
    return {"fields: time, first_contact and steps are only for motions (max_evaluations)"};
  if (is_motion) {
    if (q.reduce == Reduce::kWithin || q.reduce == Reduce::kNearest)
      return {"reduce: motions are reduced by none, min and any", true};
    if (q.signed_distance) return {"signed_distance: motions have no depths", true};
    if (has(kFieldGradient | kFieldGradientJoints | kSecondOrderFields))
      return {"fields: motions have no gradient", true};
  }
  if (q.control_points != 2 && !is_motion) return {"control_points: only for motions (max_evaluations)"};
  if (!q.growths.empty()) {
    if (!is_motion) return {"growths: only for motions (max_evaluations)"};
    if (q.bodies.empty()) return {"growths: expected bodies, which grow"};
  }
  if (!has(kFieldFreeScale) && !q.weights.empty()) return {"weights: only for the column free_scale"};
  if (has(kFieldFreeScale)) {
    if (!any) return {"fields: free_scale needs reduce any"};
    if (is_motion) return {"fields: motions have no free_scale", true};
    if (has(~(kFieldFreeScale | kFieldPair))) return {"fields: free_scale can be combined only with pair"};
  }
  if (has(kFieldVerdict) && !any) return {"fields: verdict needs reduce any"};
  return {};
}

}  // namespace clearance
