// Samples of joint space.
#pragma once

#include <clearance/scene_info.h>

#include <algorithm>
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

/// States within the limits of joints: half of them uniform, half near the straight motion of a problem, where most
/// paths are. Uniform samples of a joint without limits are from -pi to pi, of one with a single limit to 2 pi from there.
class StateSampler {
 public:
  /// \param limits, start, goal (J,) must outlive this
  /// \param spread standard deviation of each joint from the straight motion, radians and metres
  StateSampler(std::span<const JointLimits> limits, std::span<const double> start, std::span<const double> goal,
               double spread, std::uint64_t seed)
      : limits_(limits), start_(start), goal_(goal), spread_(spread), numbers_(seed) {
    for (const JointLimits& of : limits) bounded_.push_back(bounded(of));
  }

  void sample(std::span<double> state) {
    if (numbers_.next() < 0.5)
      sample_limits(state);
    else
      sample_near(state);
  }

 private:
  void sample_limits(std::span<double> state) {
    for (std::size_t j = 0; j < bounded_.size(); ++j)
      state[j] = bounded_[j].lower + numbers_.next() * (bounded_[j].upper - bounded_[j].lower);
  }
  void sample_near(std::span<double> state) {
    const double t = numbers_.next();
    for (std::size_t j = 0; j < limits_.size(); ++j)
      state[j] = std::clamp(start_[j] + t * (goal_[j] - start_[j]) + spread_ * about_normal(), limits_[j].lower,
                            limits_[j].upper);
  }
  /// A sum of four uniform numbers, with mean 0 and variance 1.
  double about_normal() {
    double sum = -2;
    for (int i = 0; i < 4; ++i) sum += numbers_.next();
    return sum * std::numbers::sqrt3;
  }
  static JointLimits bounded(const JointLimits& of) {
    const bool low = std::isfinite(of.lower), high = std::isfinite(of.upper);
    if (low && high) return of;
    if (low) return {of.lower, of.lower + 2 * std::numbers::pi};
    if (high) return {of.upper - 2 * std::numbers::pi, of.upper};
    return {-std::numbers::pi, std::numbers::pi};
  }

  std::span<const JointLimits> limits_;
  std::vector<JointLimits> bounded_;
  std::span<const double> start_, goal_;
  double spread_;
  SampleNumbers numbers_;
};

}  // namespace clearance
