// Poses of moved bodies, by configuration of a query.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/selection/plan.h"

namespace clearance {

/// Given poses of bodies, and poses of links computed from joints. Each worker has its own.
class ConfigurationPoses {
 public:
  /// \param plan must outlive this, and has its configurations
  explicit ConfigurationPoses(const Plan& plan) : plan_(plan) {}

  struct PoseBlock {
    std::span<const Pose> poses;          ///< (count, M) of Plan::bodies
    std::span<const std::uint8_t> facts;  ///< (count, M) LinkFact bits; empty if no joints move
    std::span<const double> travels;      ///< (count, M) Kinematics::travels(); likewise
    /// For a single configuration: (Plan::moved,) bound on the distance of a part's point from its intended place, in
    /// metres, in addition to the rounding of PoseSnapshot's chains. Empty if exact.
    std::span<const double> errors{};

    /// The block of configuration first + i alone.
    PoseBlock of(std::uint64_t i, std::size_t bodies) const {
      return {poses.subspan(i * bodies, bodies),
              facts.empty() ? facts : facts.subspan(i * bodies, bodies),
              travels.empty() ? travels : travels.subspan(i * bodies, bodies),
              {}};
    }
  };
  /// Poses of configurations [first, first + count), valid until the next call.
  PoseBlock at(std::uint64_t first, std::uint64_t count);
  /// Blocks of single configurations, ascending, valid until the next call.
  std::span<const PoseBlock> of(std::span<const std::uint64_t> configurations);

 private:
  bool holds(std::uint64_t first, std::uint64_t end) const {
    return plan_.round == round_ && first >= first_ && end <= first_ + count_;
  }
  void make(std::span<const std::uint64_t> configurations, std::span<const double> positions);

  const Plan& plan_;
  std::uint64_t round_ = 0, first_ = 0, count_ = 0;  // configurations computed last, in a round of the plan
  std::vector<Pose> poses_;
  std::vector<std::uint8_t> facts_;
  std::vector<double> travels_, rows_;
  std::vector<std::uint64_t> numbers_;
  std::vector<PoseBlock> blocks_;
  LinkMotion::LinkScratch scratch_;
};

}  // namespace clearance
