// Pairs of bodies that may be near: brute force and a tree behind one interface.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "certify.h"
#include "query.h"

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

/// Every pair of boxes: O(N^2), and hard to beat below some hundred bodies.
std::unique_ptr<BroadPhase> make_brute_force_broad_phase();
/// A bounding volume hierarchy, built anew for each call: O(N log N) and the pairs found.
std::unique_ptr<BroadPhase> make_tree_broad_phase();
/// The one that is expected to be faster for so many bodies.
const BroadPhase& broad_phase_for(std::size_t bodies);

}  // namespace clearance
