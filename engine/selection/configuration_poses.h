// The poses that a query gives its moved bodies, configuration by configuration.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/selection/plan.h"

namespace clearance {

/// Those of bodies as the query brings them, and those of links as its joints make them. Each worker has its own.
class ConfigurationPoses {
 public:
  /// \param plan outlives this, and has its configurations.
  explicit ConfigurationPoses(const Plan& plan) : plan_(plan) {}

  struct Block {
    std::span<const Pose> poses;          ///< (count, M) of Plan::bodies
    std::span<const std::uint8_t> facts;  ///< (count, M) LinkFact bits; empty: no joints move
    std::span<const double> travels;      ///< (count, M) Kinematics::travels(); likewise
    /// Of one configuration: (Plan::moved,) metres, how far a point of the pieces may be from where it is meant, beside
    /// what PoseSnapshot's chains round; empty: not at all.
    std::span<const double> errors{};

    /// Of configuration first + i alone.
    Block of(std::uint64_t i, std::size_t bodies) const {
      return {poses.subspan(i * bodies, bodies),
              facts.empty() ? facts : facts.subspan(i * bodies, bodies),
              travels.empty() ? travels : travels.subspan(i * bodies, bodies),
              {}};
    }
  };
  /// Of configurations [first, first + count); good until the next call.
  Block at(std::uint64_t first, std::uint64_t count);

 private:
  void make(std::uint64_t first, std::uint64_t count);

  const Plan& plan_;
  std::uint64_t round_ = 0, first_ = 0, count_ = 0;  // configurations that are made, of a round of the plan
  std::vector<Pose> poses_;
  std::vector<std::uint8_t> facts_;
  std::vector<double> travels_;
  LinkMotion::Scratch scratch_;
};

}  // namespace clearance
