// How long pairs of bodies take, measured here and now.
#pragma once

#include <span>
#include <vector>

#include "engine/engine.h"
#include "engine/state/pair_table.h"

namespace clearance {

/// Pairs of a scene at the poses at load, with one thread: its time is then this thread's own, whatever else the
/// machine does.
class PairTimes {
 public:
  /// The scene must outlive it.
  explicit PairTimes(const Scene& scene);

  /// Some of the enabled pairs of a body, both of which have a pose.
  std::vector<BodyPair> sampled(std::uint32_t body) const;
  /// Nanoseconds a pair of these, to the default tolerance. \param pairs at least one
  double ns_per_pair(std::span<const BodyPair> pairs) const;
  /// X_wb of a body that has a pose.
  const Pose& pose(std::uint32_t body) const { return poses_[body]; }

 private:
  const Scene& scene_;
  Engine engine_;
  std::vector<char> placed_;
  std::vector<Pose> poses_;
  PairTable table_;
};

}  // namespace clearance
