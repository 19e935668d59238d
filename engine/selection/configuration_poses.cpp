#include "engine/selection/configuration_poses.h"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace clearance {

namespace {

// Number of lanes: the neighbours of a configuration are needed soon, and take no longer.
constexpr std::uint64_t kTogether = kMostLanes;

}  // namespace

ConfigurationPoses::PoseBlock ConfigurationPoses::at(std::uint64_t first, std::uint64_t count) {
  const std::size_t bodies = plan_.bodies.size();
  if (plan_.motions.empty()) return {plan_.configurations.subspan(first * bodies, count * bodies), {}, {}};
  if (!holds(first, first + count)) {
    const std::uint64_t begin = first / kTogether * kTogether,
                        end = std::min((first + count + kTogether - 1) / kTogether * kTogether,
                                       plan_.size.configurations);
    numbers_.resize(end - begin);
    std::iota(numbers_.begin(), numbers_.end(), begin);
    const std::size_t joints = plan_.joints.size();
    make(numbers_, plan_.positions.subspan(begin * joints, numbers_.size() * joints));
    first_ = begin;
    count_ = end - begin;
  }
  return {std::span(poses_).subspan((first - first_) * bodies, count * bodies),
          std::span(facts_).subspan((first - first_) * bodies, count * bodies),
          std::span(travels_).subspan((first - first_) * bodies, count * bodies)};
}

std::span<const ConfigurationPoses::PoseBlock> ConfigurationPoses::of(std::span<const std::uint64_t> configurations) {
  const std::size_t bodies = plan_.bodies.size(), joints = plan_.joints.size();
  blocks_.clear();
  if (plan_.motions.empty() || configurations.empty() || holds(configurations.front(), configurations.back() + 1)) {
    for (const std::uint64_t k : configurations) blocks_.push_back(at(k, 1));
    return blocks_;
  }
  rows_.clear();
  for (const std::uint64_t k : configurations) {
    const std::span<const double> row = plan_.positions.subspan(k * joints, joints);
    rows_.insert(rows_.end(), row.begin(), row.end());
  }
  make(configurations, rows_);
  count_ = 0;  // not consecutive
  const PoseBlock all{poses_, facts_, travels_};
  for (std::size_t i = 0; i < configurations.size(); ++i) blocks_.push_back(all.of(i, bodies));
  return blocks_;
}

// \param positions (configurations.size(), joints)
void ConfigurationPoses::make(std::span<const std::uint64_t> configurations, std::span<const double> positions) {
  const std::size_t bodies = plan_.bodies.size(), given = plan_.given_bodies, count = configurations.size();
  assert(plan_.positions.size() == plan_.size.configurations * plan_.joints.size());
  round_ = plan_.round;
  poses_.resize(count * bodies);
  facts_.assign(count * bodies, 0);
  for (std::uint64_t k = 0; k < count; ++k)
    std::copy_n(plan_.configurations.begin() + static_cast<std::ptrdiff_t>(configurations[k] * given), given,
                poses_.begin() + static_cast<std::ptrdiff_t>(k * bodies));
  std::size_t at = given;
  travels_.assign(count * bodies, 0);
  for (const LinkMotion& motion : plan_.motions) {
    motion.make(positions, count, poses_.data() + at, facts_.data() + at, bodies, scratch_);
    for (std::uint64_t k = 0; k < count; ++k) motion.travels(k, travels_.data() + k * bodies + at, scratch_);
    at += motion.links().size();
  }
}

}  // namespace clearance
