// A tree of states of a robot, with the state nearest to another.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace clearance {

/// Euclidean distance of two states.
inline double distance(std::span<const double> a, std::span<const double> b) {
  double square = 0;
  for (std::size_t j = 0; j < a.size(); ++j) square += (a[j] - b[j]) * (a[j] - b[j]);
  return std::sqrt(square);
}

/// States in joint space, each with a parent. Finds the nearest by a scan: a thousand states take about a microsecond,
/// less than one proof of an edge.
class StateTree {
 public:
  explicit StateTree(std::span<const double> root) : joints_(root.size()) { add(root, 0); }

  std::size_t size() const { return parents_.size(); }
  std::span<const double> state(std::size_t node) const { return {&states_[node * joints_], joints_}; }
  std::size_t parent(std::size_t node) const { return parents_[node]; }  ///< of the root: itself

  /// Adds a state, and returns its number.
  std::size_t add(std::span<const double> state, std::size_t parent) {
    const std::size_t node = size(), lane = node % kLanes;
    if (lane == 0) blocks_.resize(blocks_.size() + joints_ * kLanes, std::numeric_limits<float>::infinity());
    float* const block = &blocks_[node / kLanes * joints_ * kLanes];
    for (std::size_t j = 0; j < joints_; ++j) block[j * kLanes + lane] = static_cast<float>(state[j]);
    states_.insert(states_.end(), state.begin(), state.end());
    parents_.push_back(parent);
    return node;
  }

  /// Returns the state of least Euclidean distance, in float32; of equal ones the first.
  std::size_t nearest(std::span<const double> to) const {
    std::size_t best = 0;
    float least = std::numeric_limits<float>::infinity();
    for (std::size_t node = 0; node < size(); node += kLanes) {
      const float* const block = &blocks_[node * joints_];
      float squares[kLanes] = {};
      for (std::size_t j = 0; j < joints_; ++j) {
        const float at = static_cast<float>(to[j]);
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
          const float difference = block[j * kLanes + lane] - at;
          squares[lane] += difference * difference;
        }
      }
      for (std::size_t lane = 0; lane < kLanes; ++lane)
        if (squares[lane] < least) {
          least = squares[lane];
          best = node + lane;
        }
    }
    return best;
  }

 private:
  static constexpr std::size_t kLanes = 16;

  std::size_t joints_;
  std::vector<double> states_;  ///< (n, J)
  std::vector<std::size_t> parents_;
  std::vector<float> blocks_;  ///< (n / 16, J, 16): the same states, infinite where there is none yet
};

}  // namespace clearance
