#include "planner/shortcuts.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "planner/samples.h"
#include "planner/state_tree.h"

namespace clearance {
namespace {

using State = std::span<const double>;

/// A path that is being shortened.
class Path {
 public:
  Path(std::vector<double>& states, std::size_t joints, EdgeProver& prover, std::uint64_t& edges)
      : states_(states), joints_(joints), prover_(prover), edges_(edges) {}

  std::size_t size() const { return states_.size() / joints_; }
  State at(std::size_t i) const { return {&states_[i * joints_], joints_}; }

  /// Leaves out waypoints: from each, goes on to the last that a free motion reaches.
  void skip_waypoints() {
    for (std::size_t i = 0; i + 2 < size(); ++i)
      for (std::size_t last = size() - 1; last > i + 1; --last)
        if (is_free(at(i), at(last))) {
          erase(i + 1, last);
          break;
        }
  }

  /// Replaces the path between two of its points by a straight motion, if that is free and shorter by kLeastGain.
  /// \param from, to shares of the path's length, 0 to 1
  void cut(double from, double to) {
    const double whole = length(0, size() - 1);
    const Place a = place(std::min(from, to) * whole), b = place(std::max(from, to) * whole);
    if (a.motion == b.motion) return;
    if (!(distance(a.state, b.state) < whole * (std::abs(to - from) - kLeastGain))) return;
    if (!is_free(a.state, b.state)) return;
    // The points lie on motions that are free, but rounding moves them off: each rest is proved again.
    if (!is_free(at(a.motion), a.state) || !is_free(b.state, at(b.motion + 1))) return;
    erase(a.motion + 1, b.motion + 1);
    std::vector<double> both = a.state;
    both.insert(both.end(), b.state.begin(), b.state.end());
    states_.insert(states_.begin() + offset(a.motion + 1), both.begin(), both.end());
  }

 private:
  static constexpr double kLeastGain = 0.03;  // of the path's length: smaller ones take more time than they save

  struct Place {
    std::size_t motion;  ///< from waypoint `motion` to the next
    std::vector<double> state;
  };

  std::ptrdiff_t offset(std::size_t i) const { return static_cast<std::ptrdiff_t>(i * joints_); }
  void erase(std::size_t first, std::size_t end) {
    states_.erase(states_.begin() + offset(first), states_.begin() + offset(end));
  }
  double length(std::size_t first, std::size_t last) const {
    double sum = 0;
    for (std::size_t i = first; i < last; ++i) sum += distance(at(i), at(i + 1));
    return sum;
  }
  Place place(double along) const {
    std::size_t i = 0;
    double step = distance(at(0), at(1));
    while (i + 2 < size() && along > step) {
      along -= step;
      ++i;
      step = distance(at(i), at(i + 1));
    }
    const double t = step > 0 ? std::clamp(along / step, 0.0, 1.0) : 0;
    Place found{i, {at(i).begin(), at(i).end()}};
    for (std::size_t j = 0; j < joints_; ++j) found.state[j] += t * (at(i + 1)[j] - at(i)[j]);
    return found;
  }
  bool is_free(State a, State b) {
    ends_.assign(a.begin(), a.end());
    ends_.insert(ends_.end(), b.begin(), b.end());
    ++edges_;
    return prover_.is_free(ends_);
  }

  std::vector<double>& states_;
  const std::size_t joints_;
  EdgeProver& prover_;
  std::uint64_t& edges_;
  std::vector<double> ends_;
};

}  // namespace

void shorten(std::vector<double>& states, std::size_t joints, EdgeProver& prover, std::uint32_t tries,
             std::uint64_t seed, std::uint64_t& edges) {
  Path path(states, joints, prover, edges);
  path.skip_waypoints();
  SampleNumbers numbers(seed);
  for (std::uint32_t i = 0; i < tries && path.size() > 2; ++i) {
    const double from = numbers.next(), to = numbers.next();
    path.cut(from, to);
  }
}

}  // namespace clearance
