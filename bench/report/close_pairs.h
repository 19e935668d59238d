// The report's methods that find pairs of near boxes, behind the engine's interface.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "bench/broad/broad_phase.h"

namespace clearance::baselines {

/// Work done in a tree.
struct TreeCounts {
  std::uint64_t visited_by_inserts = 0;  ///< nodes visited by insertions
  std::uint64_t costs = 0;               ///< unions whose cost was computed for a comparison
  std::uint64_t depth = 0;               ///< of the deepest leaf; 1 if the root is alone
};

/// A tree of boxes built by successive insertions (the report's Algorithms 6 and 7).
class AabbTree {
 public:
  /// How an insertion descends.
  enum class Insert : std::uint8_t {
    /// Branches here, or goes left or right, whichever enlarges its box least, as printed. A box inside the node's box
    /// does not enlarge it, so that it branches high up and the tree becomes a list.
    kCost,
    kLeft,       ///< always left: the report's "without the heuristic"
    kNewParent,  ///< the same choice, but branching costs the whole surface of the new parent, which gives a shallow
                 ///< tree
  };

  explicit AabbTree(Insert insert);
  ~AabbTree();
  AabbTree(const AabbTree&) = delete;
  AabbTree& operator=(const AabbTree&) = delete;

  void insert(std::uint32_t id, const Aabb& box);
  /// Appends the id of each box within `margin` of `box`. As printed, Algorithm 7 accepts a leaf without testing its
  /// own box, and so finds too many; here it is tested.
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
/// Throws std::invalid_argument for an unknown name.
/// \param threads of those with OpenMP; 0 for all cores
std::unique_ptr<BroadPhase> make_close_pairs(std::string_view name, int threads = 0);

}  // namespace clearance::baselines
