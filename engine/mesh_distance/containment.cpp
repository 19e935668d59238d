#include "engine/mesh_distance/containment.h"

#include <algorithm>
#include <cmath>

#include "engine/bvh/surface.h"
#include "engine/hull/box.h"
#include "engine/narrow/certify.h"

namespace clearance {

namespace {

// Tests a point of each connected component of a convex part until found(point) is true. A cloud's points are
// components of their own, but those in a box that no triangle enters lie on one side of all triangles.
class PartsOf {
 public:
  /// \param R,t convert coordinates of the part to those of the solid, with an error of at most `wrong`, metres
  PartsOf(const ConvexPart& part, const Surface& solid, const Mat3d& R, const Vec3d& t, double wrong, WorkMeter& meter)
      : part_(part), solid_(solid), R_(R), t_(t), wrong_(wrong), meter_(meter) {}

  template <class Found>
  bool any(const Found& found) const {
    const Surface* const surface = part_.surface.get();
    if (!surface) return found(part_.vertices[0]);
    if (surface->is_cloud()) return any_below(*surface, 0, found);
    return std::ranges::any_of(surface->parts(), [&](std::uint32_t v) { return found(surface->vertices()[v]); });
  }

 private:
  template <class Found>
  bool any_below(const Surface& cloud, std::uint32_t at, const Found& found) const {
    const Surface::Node& node = cloud.nodes()[at];
    Vec3d centre, half;
    for (int k = 0; k < 3; ++k) {
      const double low = node.low[static_cast<std::size_t>(k)], high = node.high[static_cast<std::size_t>(k)];
      centre[k] = cloud.centre()[k] + (0.5 * low + 0.5 * high);
      half[k] = 0.5 * high - 0.5 * low;
    }
    const Vec3d there = R_ * centre + t_;
    Vec3d reach{wrong_, wrong_, wrong_};
    for (int k = 0; k < 3; ++k) {
      const Vec3d& row = R_.row[k];
      reach[k] += dot(Vec3d{std::abs(row.x), std::abs(row.y), std::abs(row.z)}, half) * (1 + 0x1p-40);
    }
    meter_.count(1);
    if (!meets_leaf(solid_, there - reach, there + reach)) return found(cloud.point(first_of(cloud, at)));
    if (!node.is_leaf()) return any_below(cloud, at + 1, found) || any_below(cloud, node.right, found);
    for (std::uint32_t i = node.begin(); i < node.end(); ++i)
      if (found(cloud.point(i))) return true;
    return false;
  }
  static std::uint32_t first_of(const Surface& cloud, std::uint32_t at) {
    while (!cloud.nodes()[at].is_leaf()) ++at;
    return cloud.nodes()[at].begin();
  }

  const ConvexPart& part_;
  const Surface& solid_;
  Mat3d R_;
  Vec3d t_;
  double wrong_;
  WorkMeter& meter_;
};

// Whether a component of `inner` lies within a solid of `outer`.
Containment holds(const Body& outer, const PoseMatrix& outer_pose, const Body& inner, const PoseMatrix& inner_pose,
                  double apart, WorkMeter& meter, Vec3d* from_outer, Vec3d* from_inner) {
  const Vec3d shift = inner_pose.t_w - outer_pose.t_w;
  // A point that is rotated, shifted and rotated back has an error of less than 16 roundings of S; a gap may have 30.
  const double wrong =
      rounding_error(double(RoundingUnits<double>::kLower), pair_scale(shift, outer.reach, inner.reach, 0.0));
  Containment held = Containment::kNo;
  for (const ConvexPartPtr& o : outer.parts) {
    if (!o->surface || !o->surface->is_solid()) continue;
    const Aabb box = certify_box(*o, outer_pose.R_wb, outer_pose.t_w);
    for (const ConvexPartPtr& i : inner.parts) {
      if (certify_box_gap(box, certify_box(*i, inner_pose.R_wb, inner_pose.t_w)) > 0) continue;
      // The computed point must be on the same side of every triangle as the exact one, so none may be that near.
      if (!(apart + o->radius + i->radius > wrong)) {
        held = Containment::kUnknown;
        continue;
      }
      const PartsOf parts(*i, *o->surface, outer_pose.R_wb.transpose_times(inner_pose.R_wb),
                          outer_pose.R_wb.transpose_times(shift), wrong, meter);
      const auto is_within = [&](const Vec3d& v) {
        meter.count(1);
        const Vec3d turned = inner_pose.R_wb * v;
        if (winding_number(*o->surface, outer_pose.R_wb.transpose_times(turned + shift)) == 0) return false;
        *from_inner = turned;
        *from_outer = turned + shift;
        return true;
      };
      if (parts.any(is_within)) return Containment::kYes;
    }
  }
  return held;
}

}  // namespace

Containment either_contains(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b,
                            double apart, WorkMeter& meter, Vec3d (&point)[2]) {
  const Containment b_in_a = holds(a, pose_a, b, pose_b, apart, meter, &point[0], &point[1]);
  if (b_in_a == Containment::kYes) return b_in_a;
  return std::max(b_in_a, holds(b, pose_b, a, pose_a, apart, meter, &point[1], &point[0]));
}

}  // namespace clearance
