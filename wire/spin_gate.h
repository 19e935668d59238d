// Whether a side that waits spins before it sleeps: as long as that pays.
#pragma once

namespace clearance {

/// Spinning spares the sleeper's wake-up, and takes a core from whoever could use it, perhaps from the very side that
/// is waited for. So it is given up once kMisses waits in a row outlasted their spin; from then on one wait in
/// kProbeEvery spins, to see whether it pays again. For one thread.
class SpinGate {
 public:
  static constexpr int kMisses = 16;
  static constexpr unsigned kProbeEvery = 64;

  /// Whether the wait that begins is to spin. Asked once for each wait.
  bool opens() { return misses_ < kMisses || ++waits_ % kProbeEvery == 0; }
  /// A wait ended while it spun.
  void paid() { misses_ = 0; }
  /// A wait outlasted its spin.
  void missed() { ++misses_; }

 private:
  int misses_ = 0;
  unsigned waits_ = 0;
};

}  // namespace clearance
