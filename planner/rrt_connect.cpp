#include "planner/rrt_connect.h"

#include <algorithm>
#include <numbers>
#include <utility>
#include <vector>

#include "planner/samples.h"
#include "planner/shortcuts.h"
#include "planner/state_tree.h"

namespace clearance {
namespace {

// Spread of samples near the straight motion, in units of the range, and at most, in radians and metres.
constexpr double kSpread = 1.2, kMostSpread = std::numbers::pi;

class RrtConnect {
 public:
  RrtConnect(EdgeProver& prover, std::size_t joints, double range, PathFound& found)
      : prover_(prover), range_(range), found_(found), ends_(2 * joints) {}

  /// Tries the straight motion from start to goal, then grows a tree from each of them.
  void search(StateSampler& sampler, std::span<const double> start, std::span<const double> goal,
              std::uint64_t max_iterations) {
    if (is_free(start, goal)) {
      found_.path.assign(start.begin(), start.end());
      found_.path.insert(found_.path.end(), goal.begin(), goal.end());
      return;
    }
    Tree of_start{StateTree(start), false}, of_goal{StateTree(goal), true};
    Tree *grows = &of_start, *connects = &of_goal;
    std::vector<double> sample(start.size());
    while (found_.iterations < max_iterations) {
      ++found_.iterations;
      sampler.sample(sample);
      const std::size_t nearest = grows->states.nearest(sample);
      if (is_too_far(*grows, nearest, sample)) continue;
      if (!extend(*grows, nearest, sample)) {
        grows->has_failed[nearest] = true;
      } else {
        const std::size_t added = grows->states.size() - 1;
        const std::size_t met = connect(*connects, grows->states.state(added));
        if (met != kNone) {
          const bool from_start = grows == &of_start;
          join(of_start.states, from_start ? added : met, of_goal.states, from_start ? met : added);
          return;
        }
      }
      if (connects->states.size() < grows->states.size()) std::swap(grows, connects);
    }
  }

 private:
  static constexpr std::size_t kNone = ~std::size_t{0};

  static constexpr double kDomain = 3.5;               ///< radius of a domain in units of the range
  static constexpr std::uint32_t kMostRejected = 256;  ///< samples in a row

  struct Tree {
    StateTree states;
    bool drives_to_root;                  ///< the direction in which its motions are driven, and so proved
    std::vector<bool> has_failed{false};  ///< by node: whether a motion from it was not free
  };

  /// Whether a sample is beyond the domain of its nearest state, if a motion from there has failed (Yershova, Jaillet,
  /// Simeon, LaValle 2005): most motions from a state near obstacles hit, if they aim at far samples. In spaces in
  /// which all samples are far, one of many is taken.
  bool is_too_far(const Tree& tree, std::size_t node, std::span<const double> sample) {
    if (tree.has_failed[node] && rejected_ < kMostRejected &&
        distance(tree.states.state(node), sample) > kDomain * range_) {
      ++rejected_;
      return true;
    }
    rejected_ = 0;
    return false;
  }

  bool is_free(std::span<const double> a, std::span<const double> b) {
    std::copy(a.begin(), a.end(), ends_.begin());
    std::copy(b.begin(), b.end(), ends_.begin() + static_cast<std::ptrdiff_t>(a.size()));
    ++found_.edges;
    return prover_.is_free(ends_);
  }

  /// Adds a node to a tree: `to`, or the state within `range_` on the way to it. Returns false if that is not free.
  bool extend(Tree& tree, std::size_t from, std::span<const double> to) {
    const std::span<const double> begin = tree.states.state(from);
    const double length = distance(begin, to);
    reached_ = length <= range_;
    next_.assign(to.begin(), to.end());
    if (!reached_)
      for (std::size_t j = 0; j < to.size(); ++j) next_[j] = begin[j] + range_ / length * (to[j] - begin[j]);
    if (!(tree.drives_to_root ? is_free(next_, begin) : is_free(begin, next_))) return false;
    tree.states.add(next_, from);
    tree.has_failed.push_back(false);
    return true;
  }

  /// Extends a tree towards a state of the other tree until it is reached. Returns its node, or kNone.
  std::size_t connect(Tree& tree, std::span<const double> to) {
    std::size_t from = tree.states.nearest(to);
    while (extend(tree, from, to)) {
      from = tree.states.size() - 1;
      if (reached_) return from;
    }
    return kNone;
  }

  /// The path from the root of one tree to a node, which both trees have, and on to the root of the other.
  void join(const StateTree& of_start, std::size_t a, const StateTree& of_goal, std::size_t b) {
    std::vector<std::span<const double>> states;
    for (; a != 0; a = of_start.parent(a)) states.push_back(of_start.state(a));
    states.push_back(of_start.state(0));
    std::reverse(states.begin(), states.end());
    while (b != 0) {
      b = of_goal.parent(b);
      states.push_back(of_goal.state(b));
    }
    for (const std::span<const double> state : states)
      found_.path.insert(found_.path.end(), state.begin(), state.end());
  }

  EdgeProver& prover_;
  const double range_;
  PathFound& found_;
  std::vector<double> next_;    ///< (J,) the state that an extension tries to add
  std::vector<double> ends_;    ///< (2, J) of the motion that is tried
  bool reached_ = false;        ///< whether the last extension reached its aim
  std::uint32_t rejected_ = 0;  ///< samples since the last one that was taken
};

}  // namespace

PathFound find_path(EdgeProver& prover, std::span<const JointLimits> limits, std::span<const double> start,
                    std::span<const double> goal, const PlanOptions& options) {
  PathFound found;
  StateSampler sampler(limits, start, goal, std::min(kSpread * options.range, kMostSpread), options.seed);
  RrtConnect(prover, start.size(), options.range, found).search(sampler, start, goal, options.max_iterations);
  if (options.shortcuts && !found.path.empty())
    shorten(found.path, start.size(), prover, options.shortcuts, options.seed, found.edges);
  return found;
}

}  // namespace clearance
