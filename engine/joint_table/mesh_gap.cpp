#include "engine/joint_table/mesh_gap.h"

#include <algorithm>
#include <limits>

#include "engine/mesh_distance/containment.h"
#include "engine/narrow/narrow_phase.h"

namespace clearance {

void MeshGapSearch::look_along_hulls(const PoseMatrix& pose_a, const PoseMatrix& pose_b) {
  if (elements_.leave_hulls()) return;
  elements_.begin_hulls(false);
  const NarrowAnswer hulls = narrow_phase(elements_.part_a(0), pose_a, elements_.part_b(0), pose_b, {});
  elements_.take_hulls(hulls.bounds.lower, hulls.normal);
}

MeshGap MeshGapSearch::of(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b,
                          double width, double most) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  MeshGap gap{kInfinite, kInfinite};
  WorkMeter meter;
  elements_.begin(a, pose_a, b, pose_b);
  look_along_hulls(pose_a, pose_b);
  bool any = elements_.begin_near(most);
  for (std::size_t count = 2; gap.upper > 0; count = std::min(2 * count, ElementSearch::kMostOfRound)) {
    // Elements beyond the cut-off cannot matter: left() is a lower bound on their distance.
    const double cut_off = std::min(most, std::max(gap.upper - width, 0.8 * gap.upper));
    if (!any && (!elements_.gather(count, cut_off, meter) || elements_.round().empty())) break;
    any = false;
    Vec3d normal{0, 0, 0};
    for (std::size_t i = 0; i < elements_.round().size(); ++i) {
      const NarrowAnswer answer =
          narrow_phase(elements_.part_a(i), pose_a, elements_.part_b(i), pose_b, {.abs_tol = width / 4});
      gap.lower = std::min(gap.lower, answer.bounds.lower);
      if (answer.bounds.upper < gap.upper) gap.upper = answer.bounds.upper, normal = answer.normal;
    }
    elements_.end_round();
    if (gap.upper > 0 && (normal.x != 0 || normal.y != 0 || normal.z != 0)) elements_.look_along(normal);
  }
  gap.lower = std::min(gap.lower, elements_.left());
  if (!(gap.lower > 0)) return gap;
  Vec3d shared[2];
  switch (either_contains(a, pose_a, b, pose_b, gap.lower, meter, shared)) {
    case Containment::kNo:
      return gap;
    case Containment::kUnknown:
      return {-kInfinite, gap.upper};
    case Containment::kYes:
      break;
  }
  return {-kInfinite, -gap.lower};
}

}  // namespace clearance
