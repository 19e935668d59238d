#include "engine/scene/link_errors.h"

#include <limits>

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

}  // namespace

LinkErrors::LinkErrors(const Kinematics& robot, std::span<const double> radii) : slots_(robot.links(), kNone) {
  std::vector<std::uint32_t> shaped;
  for (std::uint32_t link = 0; link < robot.links(); ++link) {
    links_.push_back(robot.error(link, 0));
    if (radii[link] < 0) continue;
    slots_[link] = static_cast<std::uint32_t>(shaped.size());
    shaped.push_back(link);
  }
  if (shaped.size() > kMostTabled) return;
  for (std::size_t j = 0; j < shaped.size(); ++j)
    for (std::size_t i = 0; i < j; ++i) {
      const std::uint32_t a = shaped[i], b = shaped[j];
      const PlacementError error = robot.error_between(a, radii[a], b, radii[b]);
      pairs_.push_back({robot.root_of(a) == robot.root_of(b) ? error.fixed : kInf, error.per_travel});
    }
}

double LinkErrors::between(std::uint32_t a, std::uint32_t b, double travel) const {
  if (a == b) return 0;  // rigid
  if (pairs_.empty()) return kInf;
  return pairs_[link_pair_place(slots_[a], slots_[b])].at(travel);
}

}  // namespace clearance
