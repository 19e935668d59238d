// All pairs of near boxes: brute force and the tree behind one interface, for comparisons with each other and with the
// baselines. Queries use NearPairs (near_pairs.h), which has the same components.
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
  /// \param boxes world frame; an empty box (low > high) is near nothing
  /// \param margin in metres, >= 0, may be infinite
  virtual void candidates(std::span<const Aabb> boxes, double margin, std::vector<BodyPair>& out) const = 0;
};

/// Tests every pair of boxes, one box against many at a time: O(N^2), and hard to beat below a hundred bodies.
/// \param threads 0 for all cores
std::unique_ptr<BroadPhase> make_brute_force_broad_phase(int threads = 1);
/// A BoxTree: O(N log N) plus the pairs found.
/// \param keep updates the tree from call to call, which must then be successive; if false, it is rebuilt each time
std::unique_ptr<BroadPhase> make_tree_broad_phase(int threads = 1, bool keep = false);

}  // namespace clearance
