// Adaptive spinning: decides whether a waiting side spins before it sleeps.
#pragma once

namespace clearance {

/// Spinning avoids the cost of a wake-up, but occupies a core that other threads could use, perhaps the awaited side
/// itself. It stops after kMisses consecutive waits that outlasted their spin; then one wait in kProbeEvery spins, to
/// test whether it pays again. Not thread-safe.
class SpinGate {
 public:
  static constexpr int kMisses = 16;
  static constexpr unsigned kProbeEvery = 64;

  /// Whether the next wait spins. Called once per wait.
  bool opens() { return misses_ < kMisses || ++waits_ % kProbeEvery == 0; }
  /// Records a wait that ended during its spin.
  void paid() { misses_ = 0; }
  /// Records a wait that outlasted its spin.
  void missed() { ++misses_; }

 private:
  int misses_ = 0;
  unsigned waits_ = 0;
};

}  // namespace clearance
