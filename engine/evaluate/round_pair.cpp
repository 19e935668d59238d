// Features of pairs with a cone, a cylinder or an ellipsoid, by Newton's method on their smooth patches.
#include <algorithm>
#include <cmath>

#include "engine/evaluate/feature_side.h"
#include "engine/narrow/narrow_phase.h"

namespace clearance {

namespace {

constexpr double kEpsilon = 0x1p-52;
constexpr int kMostSteps = 20;

double size_of(const ConvexPart& part) {
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
  const double scale = size_of(a.part) + size_of(b.part) + norm(b.shift);
  double tolerance = 0;
  const auto take_features = [&](const Side& side, const Vec3d& n, const Vec3d& point) {
    return is_round(side.part) ? side.round_feature(n, point, distance_) : side.flat_feature(n, point, tolerance);
  };
  double move = scale;
  for (int i = 0; i < kMostSteps; ++i) {
    // A hull's feature is that nearest to the other core's point, a patch's that around its own.
    Vec3d at_a = is_round(a.part) ? a.nearest(point_a_) : point_a_,
          at_b = b.nearest(is_round(b.part) ? point_b_ : at_a);
    if (!is_round(a.part)) at_a = a.nearest(at_b);
    take_points(at_a, at_b);
    if (!(distance_ > 64 * kEpsilon * scale)) return false;
    tolerance = 64 * kEpsilon * scale * (1 + scale / distance_);
    a_ = take_features(a, normal_, point_a_);
    b_ = take_features(b, -normal_, point_b_);
    factorise();
    if (move <= 16 * kEpsilon * scale) break;
    move = polish();
  }
  set_radius(a.vertices, b.vertices, tolerance);
  return std::min(a_.interior, b_.interior) >= -tolerance && move <= 1e-9 * scale;
}

std::optional<FeaturePair> FeaturePair::find_round(Side& a, Side& b) {
  NarrowLimits limits;
  limits.rel_tol = 1e-10;
  limits.signed_distance = true;  // for a lower bound if only the radii overlap
  const NarrowAnswer start = narrow_phase(a.part, a.pose, b.part, b.pose, limits);
  const double radii = a.part.radius + b.part.radius;
  if (!(start.bounds.lower + radii > 0)) return {};
  const Vec3d &n = start.normal, point_a = start.point_a - n * a.part.radius,
              point_b = start.point_b + n * b.part.radius + b.shift;
  RoundPatch all_a[4], all_b[4];
  const auto patches_of = [](const Side& side, const Vec3d& toward, RoundPatch(&all)[4]) {
    return is_round(side.part) ? patches_along(*side.part.primitive, side.pose.R_wb.transpose_times(toward), all)
                               : std::span<const RoundPatch>(all, 1);
  };
  std::optional<FeaturePair> first;
  for (const RoundPatch& of_a : patches_of(a, n, all_a))
    for (const RoundPatch& of_b : patches_of(b, -n, all_b)) {
      a.patch = of_a;
      b.patch = of_b;
      FeaturePair pair;
      pair.take_points(point_a, point_b);
      if (pair.meet_round(a, b)) return pair;
      pair.smooth_radius_ = 0;
      if (!first && pair.distance_ > 0) first = pair;
    }
  return first;  // within rounding of two patches
}

}  // namespace clearance
