// A tree of states of a robot, with the state nearest to another.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
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
  std::size_t nearest(std::span<const double> to) {
    to_.assign(to.begin(), to.end());
    Floats least[kParts];
    Ints best[kParts] = {};  // blocks
    for (Floats& part : least) part = Floats{} + std::numeric_limits<float>::infinity();
    const float* from = blocks_.data();
    for (std::int32_t block = 0; static_cast<std::size_t>(block) * kLanes < size(); ++block) {
      Floats squares[kParts] = {};
      for (const float at : to_)
        for (Floats& square : squares) {
          Floats difference;
          std::memcpy(&difference, from, sizeof difference);
          from += kLanes / kParts;
          difference -= at;
          square += difference * difference;
        }
      for (std::size_t i = 0; i < kParts; ++i) {
        const Ints is_nearer = squares[i] < least[i];
        best[i] = is_nearer ? Ints{} + block : best[i];
        least[i] = is_nearer ? squares[i] : least[i];
      }
    }
    std::size_t node = 0;
    float nearest = std::numeric_limits<float>::infinity();
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const float here = least[lane / 4][lane % 4];
      const std::size_t other = static_cast<std::size_t>(best[lane / 4][lane % 4]) * kLanes + lane;
      if (here < nearest || (here == nearest && other < node)) nearest = here, node = other;
    }
    return node;
  }

 private:
  static constexpr std::size_t kLanes = 16, kParts = 4;
  using Floats = float __attribute__((vector_size(16)));
  using Ints = std::int32_t __attribute__((vector_size(16)));

  std::size_t joints_;
  std::vector<double> states_;  ///< (n, J)
  std::vector<std::size_t> parents_;
  std::vector<float> to_;
  std::vector<float> blocks_;  ///< (n / 16, J, 16): the same states, infinite where there is none yet
};

}  // namespace clearance
