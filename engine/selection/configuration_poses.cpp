#include "engine/selection/configuration_poses.h"

#include <algorithm>
#include <cassert>

namespace clearance {

namespace {

// Number of lanes: the neighbours of a configuration are needed soon, and take no longer.
constexpr std::uint64_t kTogether = kMostLanes;

}  // namespace

ConfigurationPoses::PoseBlock ConfigurationPoses::at(std::uint64_t first, std::uint64_t count) {
  const std::size_t bodies = plan_.bodies.size();
  if (plan_.motions.empty()) return {plan_.configurations.subspan(first * bodies, count * bodies), {}, {}};
  if (plan_.round != round_ || first < first_ || first + count > first_ + count_) {
    const std::uint64_t begin = first / kTogether * kTogether,
                        end = std::min((first + count + kTogether - 1) / kTogether * kTogether,
                                       plan_.size.configurations);
    make(begin, end - begin);
  }
  return {std::span(poses_).subspan((first - first_) * bodies, count * bodies),
          std::span(facts_).subspan((first - first_) * bodies, count * bodies),
          std::span(travels_).subspan((first - first_) * bodies, count * bodies)};
}

void ConfigurationPoses::make(std::uint64_t first, std::uint64_t count) {
  const std::size_t bodies = plan_.bodies.size(), given = plan_.given_bodies, joints = plan_.joints.size();
  assert(first + count <= plan_.size.configurations && plan_.positions.size() == plan_.size.configurations * joints);
  round_ = plan_.round;
  first_ = first;
  count_ = count;
  poses_.resize(count * bodies);
  facts_.assign(count * bodies, 0);
  for (std::uint64_t k = 0; k < count; ++k)
    std::copy_n(plan_.configurations.begin() + static_cast<std::ptrdiff_t>((first + k) * given), given,
                poses_.begin() + static_cast<std::ptrdiff_t>(k * bodies));
  std::size_t at = given;
  travels_.assign(count * bodies, 0);
  for (const LinkMotion& motion : plan_.motions) {
    motion.make(plan_.positions.subspan(first * joints, count * joints), count, poses_.data() + at, facts_.data() + at,
                bodies, scratch_);
    for (std::uint64_t k = 0; k < count; ++k) motion.travels(k, travels_.data() + k * bodies + at, scratch_);
    at += motion.links().size();
  }
}

}  // namespace clearance
