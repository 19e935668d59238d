// The convex elements of two bodies, at least one of them non-convex, nearest first, from a tree of boxes.
//
// An element is a convex part with exact geometry, or a triangle of a part's mesh. Each pair of elements comes once, in
// the order of a lower bound on their distance (its gap), so that an answer depends on the two bodies alone. Pairs
// farther than the least upper bound so far are never opened.
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include "engine/base/best_first.h"
#include "engine/mesh_distance/subtree_gaps.h"
#include "engine/narrow/part_search.h"
#include "engine/narrow/work_meter.h"
#include "engine/pose/placed.h"
#include "engine/scene/scene.h"

namespace clearance {

/// A convex part with exact geometry, or a triangle of a part's mesh.
struct Element {
  std::uint32_t part = kNone;
  std::uint32_t triangle = kNone;  ///< of the mesh; kNone for the part itself
};
/// The element as a part that can be evaluated: the part itself, or `scratch`, which becomes its triangle.
const ConvexPart& part_of(const Body& body, const Element& element, ConvexPart& scratch);

struct ElementPair {
  double gap;  ///< lower bound on the pair's distance, in metres
  Element a, b;
};

class NearestElements {
 public:
  enum class Found { kPair, kNoMore, kPaused };

  /// All must outlive the search.
  void begin(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b);
  /// The nearest two parts by their boxes. For hulls that enclose meshes, a lower bound on their distance, with its
  /// direction, also holds for the meshes.
  ElementPair parts() const;
  /// Whether the box of one of these parts contains that of the other, so that their hulls are unlikely to be apart.
  bool is_one_within() const;
  /// All other parts whose boxes may overlap. Call before any pair is taken.
  void touching_parts(std::vector<ElementPair>& others) const;
  void take_parts(double lower);
  /// Takes a near pair, not necessarily the nearest. Returns false if all pairs tried for it are beyond the cut-off.
  bool take_near(double cut_off, ElementPair& pair);
  /// The next pair in their order, unless its gap exceeds the cut-off (kNoMore) or the slice is over (kPaused).
  Found next(double cut_off, WorkMeter& meter, ElementPair& pair);
  /// Lower bound on the distance of the remaining pairs, metres; +inf if there are none.
  double left() const { return open_.empty() || left_out_ < open_.front().gap ? left_out_ : open_.front().gap; }
  /// Whether the remaining pairs exceed the capacity for a pair of bodies, so that the search must end.
  bool is_full() const { return open_.size() > kMostEntries; }
  /// From here on gaps along this direction count, too: one that has separated a pair separates its neighbours.
  /// \param n_w from a towards b, world axes, of length 1 up to rounding
  void look_along(const Vec3d& n_w) { gaps_.look_along(n_w); }

 private:
  static constexpr std::size_t kMostEntries = std::size_t{1} << 20;
  // The nearest first; among equal gaps those farther down, which end sooner. Gaps are not below 0, so that their bits
  // are in their order.
  struct RankOf {
    unsigned __int128 operator()(const SubtreePair& e) const {
      return static_cast<unsigned __int128>(std::bit_cast<std::uint64_t>(e.gap)) << 64 | std::uint64_t{~e.a.at} << 32 |
             ~e.b.at;
    }
  };

  void put(const SubtreePair& entry, double cut_off);
  template <class Each>
  void open(const SubtreePair& entry, double cut_off, const Each& each) const;
  template <class Below, class Each>
  void divide(const SubtreePair& entry, bool opens_a, double cut_off, const Each& each) const;
  template <class Each>
  void pair_triangles(const SubtreePair& entry, const Surface::Node* leaf_a, const Surface::Node* leaf_b,
                      const Each& each) const;

  SubtreeGaps gaps_;
  BestFirst<SubtreePair, RankOf> open_;
  double left_out_ = 0;  // the least gap beyond a cut-off
};

}  // namespace clearance
