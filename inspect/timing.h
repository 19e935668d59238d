// Measured evaluation times of pairs.
#pragma once

#include <span>
#include <vector>

#include "engine/engine.h"
#include "engine/state/pair_table.h"

namespace clearance {

/// Times pairs of a scene at the initial poses by the processor time of one thread, regardless of other load.
class PairTimes {
 public:
  /// The scene must outlive it.
  explicit PairTimes(const engine::Scene& scene);

  /// Returns some enabled pairs of a body with poses.
  std::vector<BodyPair> sampled(std::uint32_t body) const;
  /// Returns nanoseconds per pair at the default tolerance.
  /// \param pairs at least one
  double ns_per_pair(std::span<const BodyPair> pairs) const;
  /// Returns X_wb of a body that has a pose.
  const Pose& pose(std::uint32_t body) const { return poses_[body]; }

 private:
  const engine::Scene& scene_;
  engine::Engine engine_;
  std::vector<char> placed_;
  std::vector<Pose> poses_;
  PairTable table_;
};

}  // namespace clearance
