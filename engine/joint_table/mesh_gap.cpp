#include "engine/joint_table/mesh_gap.h"

#include <algorithm>
#include <limits>

#include "engine/mesh_distance/containment.h"
#include "engine/narrow/narrow_phase.h"

namespace clearance {

MeshGap MeshGapSearch::of(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b,
                          double width, double most) {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  constexpr std::size_t kOfRound = 4;
  MeshGap gap{kInfinite, kInfinite};
  WorkMeter meter;
  elements_.begin(a, pose_a, b, pose_b);
  for (;;) {
    // Elements beyond the cut-off cannot matter: left() is a lower bound on their distance.
    const double cut_off = std::min(most, std::max(gap.upper - width, 0.8 * gap.upper));
    if (gap.upper <= 0 || !elements_.gather(kOfRound, cut_off, meter) || elements_.round().empty()) break;
    for (std::size_t i = 0; i < elements_.round().size(); ++i) {
      const NarrowAnswer answer =
          narrow_phase(elements_.part_a(i), pose_a, elements_.part_b(i), pose_b, {.abs_tol = width / 4});
      gap.lower = std::min(gap.lower, answer.bounds.lower);
      gap.upper = std::min(gap.upper, answer.bounds.upper);
    }
    elements_.end_round();
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
