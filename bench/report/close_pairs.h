// The report's ways to find pairs of near boxes, behind the engine's interface.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "bench/broad/broad_phase.h"

namespace clearance::baselines {

/// What the work of a tree came to.
struct TreeCounts {
  std::uint64_t visited_by_inserts = 0;  ///< nodes that insertions went through
  std::uint64_t costs = 0;               ///< unions whose cost was worked out to compare
  std::uint64_t depth = 0;               ///< of the deepest leaf; the root alone: 1
};

/// A tree of boxes made by inserting them one by one (the report's Algorithms 6 and 7).
class AabbTree {
 public:
  /// How an insertion finds its way down.
  enum class Insert : std::uint8_t {
    /// Branch here, or go left or right, whichever makes its box grow least, as printed. A box inside the node's makes
    /// that grow by nothing, so that it branches high up, and the tree becomes a list.
    kCost,
    kLeft,       ///< always left: the report's "without the heuristic"
    kNewParent,  ///< the same choice, with the whole surface of the new parent as the price of branching: a shallow
                 ///< tree
  };

  explicit AabbTree(Insert insert);
  ~AabbTree();
  AabbTree(const AabbTree&) = delete;
  AabbTree& operator=(const AabbTree&) = delete;

  void insert(std::uint32_t id, const Aabb& box);
  /// Appends the id of each box within `margin` of `box`. As printed, Algorithm 7 takes a leaf without looking at its
  /// own box, and so finds too many: here it is looked at.
  void query(const Aabb& box, double margin, std::vector<std::uint32_t>& found) const;
  TreeCounts counts() const;

 private:
  struct Node;
  std::unique_ptr<Node> insert(std::unique_ptr<Node> node, std::unique_ptr<Node> leaf);
  bool goes_left(const Node& node, const Aabb& box, bool& branch);
  static void query(const Node& node, const Aabb& box, double margin, std::vector<std::uint32_t>& found);

  Insert insert_;
  std::unique_ptr<Node> root_;
  TreeCounts counts_;
};

/// aabb_naive, aabb_naive_omp, aabb_tree, aabb_tree_noheuristic, aabb_tree_omp.
const std::vector<std::string>& close_pairs_names();
/// \param threads of those with OpenMP; 0: all cores. Throws std::invalid_argument for a name that is not there.
std::unique_ptr<BroadPhase> make_close_pairs(std::string_view name, int threads = 0);

}  // namespace clearance::baselines
