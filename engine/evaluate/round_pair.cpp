// Features of pairs with a cone, a cylinder or an ellipsoid, by Newton's method on their smooth patches.
#include <algorithm>
#include <cmath>

#include "engine/evaluate/feature_side.h"
#include "engine/narrow/narrow_phase.h"

namespace clearance {

namespace {

constexpr int kMostSteps = 20;

double core_size(const ConvexPart& part) {
  return is_half_space(part) ? 0 : part.rho;
}

}  // namespace

Feature FeaturePair::Side::round_feature(const Vec3d& n, const Vec3d& point, double distance) const {
  Feature f = feature_on(*part.primitive, patch, pose.R_wb.transpose_times(point - shift), pose.R_wb.transpose_times(n),
                         distance);
  for (Vec3d& tangent : f.tangent) tangent = pose.R_wb * tangent;
  return f;
}

Vec3d FeaturePair::Side::nearest(const Vec3d& point) const {
  if (is_half_space(part)) return foot(point);
  if (is_round(part))
    return pose.R_wb * onto_patch(*part.primitive, patch, pose.R_wb.transpose_times(point - shift)) + shift;
  const auto points = nearest_points(vertices, {&point, 1}, point - vertices[0]);
  return points ? points->a : point;
}

// Solves for the nearest points of two patches, or of a patch and the feature of a flat core. Returns whether they are
// the cores' nearest.
bool FeaturePair::meet_round(const Side& a, const Side& b) {
  const double scale = core_size(a.part) + core_size(b.part) + norm(b.shift);
  double tolerance = 0;
  const auto take_features = [&](const Side& side, const Vec3d& n, const Vec3d& point) {
    return is_round(side.part) ? side.round_feature(n, point, distance_) : side.flat_feature(n, point, tolerance, true);
  };
  double move = scale;
  for (int i = 0; i < kMostSteps; ++i) {
    // A hull's feature is that nearest to the other core's point, a patch's that around its own.
    Vec3d at_a = is_round(a.part) ? a.nearest(point_a_) : point_a_,
          at_b = b.nearest(is_round(b.part) ? point_b_ : at_a);
    if (!is_round(a.part)) at_a = a.nearest(at_b);
    take_points(at_a, at_b);
    if (!(distance_ > 64 * kFeatureEpsilon * scale)) return false;
    tolerance = 64 * kFeatureEpsilon * scale * (1 + scale / distance_);
    a_ = take_features(a, normal_, point_a_);
    b_ = take_features(b, -normal_, point_b_);
    factorise();
    if (move <= 16 * kFeatureEpsilon * scale) break;
    move = polish();
  }
  set_radius(a, b, tolerance);
  return std::min(a_.interior, b_.interior) >= -tolerance && move <= 1e-9 * scale;
}

// Tries the patches that may meet. Returns whether some do; otherwise `found` may have some that nearly do.
bool FeaturePair::find_patches(Side& a, Side& b, const WitnessPoints& start, const Vec3d& toward,
                               std::optional<FeaturePair>& found) {
  RoundPatch all_a[4], all_b[4];
  const auto patches_of = [](const Side& side, const Vec3d& n, RoundPatch(&all)[4]) {
    return is_round(side.part) ? patches_along(*side.part.primitive, side.pose.R_wb.transpose_times(n), all)
                               : std::span<const RoundPatch>(all, 1);
  };
  for (const RoundPatch& of_a : patches_of(a, toward, all_a))
    for (const RoundPatch& of_b : patches_of(b, -toward, all_b)) {
      a.patch = of_a;
      b.patch = of_b;
      FeaturePair pair;
      pair.take_points(start.a, start.b);
      const bool meet = pair.meet_round(a, b);
      if (!meet) pair.smooth_radius_ = 0;
      if (meet || (!found && pair.distance_ > 0)) found = pair;
      if (meet) return true;
    }
  return false;
}

std::optional<FeaturePair> FeaturePair::find_round(Side& a, Side& b, const WitnessPoints& start, const Vec3d& toward) {
  std::optional<FeaturePair> found;
  if (find_patches(a, b, start, toward, found)) return found;
  NarrowLimits limits;
  limits.rel_tol = 1e-10;
  limits.signed_distance = true;  // for a lower bound if only the radii overlap
  const NarrowAnswer near = narrow_phase(a.part, a.pose, b.part, b.pose, limits);
  if (!(near.bounds.lower + a.part.radius + b.part.radius > 0)) return {};
  const WitnessPoints better{near.point_a - near.normal * a.part.radius,
                             near.point_b + near.normal * b.part.radius + b.shift};
  find_patches(a, b, better, near.normal, found);
  return found;  // within rounding of two patches, if none meet
}

}  // namespace clearance
