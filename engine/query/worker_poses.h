// Body poses of the configurations that one worker evaluates.
#pragma once

#include <cassert>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/selection/body_poses.h"
#include "engine/selection/configuration_poses.h"

namespace clearance {

/// Keeps the poses of the last block of configurations.
class WorkerPoses {
 public:
  /// The arguments must outlive this.
  WorkerPoses(const engine::Scene& scene, const Plan& plan, std::span<const Aabb> boxes)
      : scene_(scene), plan_(plan), boxes_(boxes), given_(plan) {}

  /// Poses as given, or as joints determine them, of configurations [first, first + count), valid until the next call.
  ConfigurationPoses::PoseBlock given(std::uint64_t first, std::uint64_t count) { return given_.at(first, count); }

  /// Poses in some configurations, of the bodies of some pairs, valid until the next call.
  /// \param pairs (configurations.size(),) positions in the plan
  std::span<const BodyPoses> at(std::span<const std::uint64_t> configurations,
                                std::span<const std::span<const std::uint64_t>> pairs) {
    while (placed_.size() < configurations.size()) placed_.emplace_back(scene_, plan_, boxes_);
    slots_.clear();
    selected_.clear();
    ends_.clear();
    const std::span<const ConfigurationPoses::PoseBlock> given = given_.of(configurations);
    for (std::size_t i = 0; i < configurations.size(); ++i) {
      placed_[0].select(pairs[i], slots_);
      ends_.push_back(slots_.size());
      while (selected_.size() < slots_.size())
        selected_.push_back(placed_[0].given_pose(slots_[selected_.size()], given[i]));
    }
    rotations_.resize(selected_.size());
    rotations_of(selected_, rotations_);
    for (std::size_t i = 0, begin = 0; i < configurations.size(); begin = ends_[i++])
      placed_[i].configure(configurations[i], given[i], std::span(slots_).subspan(begin, ends_[i] - begin),
                           std::span(rotations_).subspan(begin, ends_[i] - begin));
    return {placed_.data(), configurations.size()};
  }

  /// Poses in configurations [first, first + count), valid until the next call.
  std::span<const BodyPoses> at(std::uint64_t first, std::uint64_t count) {
    assert(count > 0 && first + count <= plan_.size.configurations);
    while (placed_.size() < count) placed_.emplace_back(scene_, plan_, boxes_);
    if (placed_[0].is_at(first) && placed_[count - 1].is_at(first + count - 1)) return {placed_.data(), count};
    const std::size_t moved = plan_.bodies.size();
    const ConfigurationPoses::PoseBlock given = given_.at(first, count);
    rotations_.resize(count * moved);
    rotations_of(given.poses, rotations_);
    for (std::uint64_t i = 0; i < count; ++i)
      placed_[i].configure(first + i, given.of(i, moved), std::span(rotations_).subspan(i * moved, moved));
    return {placed_.data(), count};
  }

 private:
  const engine::Scene& scene_;
  const Plan& plan_;
  const std::span<const Aabb> boxes_;  // of all bodies in the snapshot, or empty
  ConfigurationPoses given_;
  std::vector<BodyPoses> placed_;
  // Of the bodies selected in some configurations.
  std::vector<std::uint32_t> slots_;
  std::vector<std::size_t> ends_;  // in slots_, by configuration
  std::vector<Pose> selected_;
  std::vector<Mat3d> rotations_;
};

}  // namespace clearance
