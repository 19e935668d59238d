// Samples of joint space.
#pragma once

#include <clearance/scene_info.h>

#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

namespace clearance {

/// Uniform random numbers, the same on every machine (SplitMix64: Steele, Lea, Flood 2014).
class SampleNumbers {
 public:
  explicit SampleNumbers(std::uint64_t seed) : state_(seed) {}

  /// In [0, 1).
  double next() {
    std::uint64_t bits = state_ += 0x9E3779B97F4A7C15;
    bits = (bits ^ (bits >> 30)) * 0xBF58476D1CE4E5B9;
    bits = (bits ^ (bits >> 27)) * 0x94D049BB133111EB;
    return static_cast<double>((bits ^ (bits >> 31)) >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_;
};

/// States within the limits of joints. A joint without limits is sampled from -pi to pi, one with a single limit to 2 pi
/// from there.
class StateSampler {
 public:
  StateSampler(std::span<const JointLimits> limits, std::uint64_t seed) : numbers_(seed) {
    for (const JointLimits& of : limits) limits_.push_back(bounded(of));
  }

  void sample(std::span<double> state) {
    for (std::size_t j = 0; j < limits_.size(); ++j)
      state[j] = limits_[j].lower + numbers_.next() * (limits_[j].upper - limits_[j].lower);
  }

 private:
  static JointLimits bounded(const JointLimits& of) {
    const bool low = std::isfinite(of.lower), high = std::isfinite(of.upper);
    if (low && high) return of;
    if (low) return {of.lower, of.lower + 2 * std::numbers::pi};
    if (high) return {of.upper - 2 * std::numbers::pi, of.upper};
    return {-std::numbers::pi, std::numbers::pi};
  }

  std::vector<JointLimits> limits_;
  SampleNumbers numbers_;
};

}  // namespace clearance
