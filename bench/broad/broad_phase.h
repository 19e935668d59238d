// All pairs of boxes that are near: brute force and the tree behind one interface, so that they can be held against
// each other and against the baselines. Queries use NearPairs (near_pairs.h), made of the same parts.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "engine/base/body_pair.h"
#include "engine/hull/box.h"

namespace clearance {

/// Finds pairs whose boxes are within a margin.
class BroadPhase {
 public:
  virtual ~BroadPhase() = default;
  virtual std::string_view name() const = 0;

  /// Appends every pair (a < b) with certify_box_gap(boxes[a], boxes[b]) <= margin, in lexicographic order.
  /// \param boxes world frame; an empty box (low > high) is near nothing. \param margin metres, >= 0, may be infinite.
  virtual void candidates(std::span<const Aabb> boxes, double margin, std::vector<BodyPair>& out) const = 0;
};

/// Every pair of boxes, one box against many at a time: O(N^2), and hard to beat below a hundred bodies.
/// \param threads 0: all cores.
std::unique_ptr<BroadPhase> make_brute_force_broad_phase(int threads = 1);
/// A BoxTree: O(N log N) and the pairs found. \param keep follows the boxes from call to call, which then must come one
/// after another; false: made anew each time.
std::unique_ptr<BroadPhase> make_tree_broad_phase(int threads = 1, bool keep = false);

}  // namespace clearance
