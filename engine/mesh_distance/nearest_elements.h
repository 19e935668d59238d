// The convex elements of two bodies, at least one of them non-convex, nearest first, from a tree of boxes.
//
// An element is a convex part with exact geometry, or a triangle of a part's mesh. Each pair of elements comes once, in
// the order of a lower bound on their distance (its gap), so that an answer depends on the two bodies alone. Pairs
// farther than the least upper bound so far are never opened.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "engine/base/best_first.h"
#include "engine/mesh_distance/part_gaps.h"
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
/// The element as a part that can be evaluated: the part itself, or `storage`, which becomes its triangle.
const ConvexPart& part_of(const Body& body, const Element& element, ConvexPart& storage);

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
  void look_along(const Vec3d& n_w);

 private:
  static constexpr std::size_t kMostEntries = std::size_t{1} << 20;
  static constexpr std::uint32_t kTriangle = 1u << 31;  // flag in `at` of a triangle
  // A pair of subtrees; `at` is a node, a triangle, or kNone for an exact part.
  struct Entry {
    double gap;
    std::uint32_t part_a, at_a, part_b, at_b;
    std::uint32_t looked;  // number of directions known when its gap was made
  };
  // The nearest first; among equal gaps those farther down, which end sooner. Gaps are not below 0, so that their bits
  // are in their order.
  struct RankOf {
    unsigned __int128 operator()(const Entry& e) const {
      return static_cast<unsigned __int128>(std::bit_cast<std::uint64_t>(e.gap)) << 64 | std::uint64_t{~e.at_a} << 32 |
             ~e.at_b;
    }
  };
  // Bounds of a subtree, in the axes of its body, or of a.
  struct NodeBounds {
    Vec3d centre{0, 0, 0}, half{0, 0, 0};
  };
  // The children of a node: the nodes two levels below it, or leaves before; the elements of a leaf.
  struct NodesBelow {
    std::uint32_t at[kPartLanes], count = 0;
    NodeColumns columns;

    NodesBelow(const Surface& surface, std::uint32_t node);
  };
  struct ElementsBelow {
    std::uint32_t at[kPartLanes], count;
    ElementColumns columns;

    ElementsBelow(const Surface& surface, std::uint32_t leaf);
  };
  static bool is_element(std::uint32_t at) { return (at & kTriangle) != 0; }  // kNone, too
  static Element element(std::uint32_t part, std::uint32_t at) { return {part, at == kNone ? kNone : at & ~kTriangle}; }
  static NodeBounds bounds(const Body& body, std::uint32_t part, std::uint32_t at);
  NodeBounds bounds_a(const Entry& e) const { return bounds(*a_, e.part_a, e.at_a); }
  NodeBounds bounds_b(const Entry& e) const { return bounds(*b_, e.part_b, e.at_b); }
  NodeBounds before_a(const NodeBounds& of_b) const;
  double gap_of(const Entry& e, const NodeBounds& a, const NodeBounds& b) const;
  double gap_along(const Entry& e, const NodeBounds& a, const NodeBounds& b, const Vec3d& n_a, const Vec3d& n_b) const;
  double gap_known(const Entry& e, double far_a, double far_b) const;
  double gap_known(const Entry& e, const NodeBounds& a, const NodeBounds& b) const;
  double margin(const Entry& e) const;

  static double reach(const Body& body, std::uint32_t part, std::uint32_t at, const NodeBounds& box, const Vec3d& n);
  double known_reach(bool of_a, std::uint32_t part, std::uint32_t at, double by_bounds, int levels) const;
  double known_reach(bool of_a, std::uint32_t part, std::uint32_t at, const NodeBounds& box) const;
  int levels(const Body& body, std::uint32_t part) const;
  void put(const Entry& entry, double cut_off);
  template <class Each>
  void open(const Entry& entry, double cut_off, const Each& each) const;
  template <class Below, class Each>
  void divide(const Entry& entry, bool opens_a, double cut_off, const Each& each) const;
  template <class Each>
  void pair_triangles(const Entry& entry, const Surface::Node* leaf_a, const Surface::Node* leaf_b,
                      const Each& each) const;
  static PartBounds part_bounds(const Body& body, std::uint32_t part, std::uint32_t at, const NodeBounds& bounds,
                                std::array<Vec3d, 3>& storage);

  const Body *a_ = nullptr, *b_ = nullptr;
  Mat3d R_wa_, R_, R_ba_;                                                         // R_: R_wa^T R_wb; its transpose
  Vec3d D_{0, 0, 0}, D_ba_{0, 0, 0};                                              // R_wa^T (t_b - t_a); -R_^T D_
  double error_ = 0;                                                              // of a gap, metres
  enum class Plane : std::uint8_t { kNeither, kA, kB } plane_ = Plane::kNeither;  // the half-space, if any
  double left_out_ = 0;                                                           // the least gap beyond a cut-off
  std::uint32_t looks_ = 0;  // number of directions known so far; only the last one is used
  Vec3d n_a_{0, 0, 0}, n_b_{0, 0, 0};
  BestFirst<Entry, RankOf> open_;

  // Cache of the reach of subtrees along the known direction, since each is needed for many partners.
  struct Reach {
    std::uint64_t direction = 0;  // of directions_
    std::uint32_t part = 0, at = 0;
    bool of_a = false;
    double reach = 0;
  };
  static constexpr std::size_t kReaches = 2048;
  std::uint64_t directions_ = 0;       // of all searches
  bool looks_deep_ = false;            // for known_reach()
  mutable std::uint64_t reached_ = 0;  // nodes that it has opened since the last report to the meter
  mutable std::vector<Reach> reaches_ = std::vector<Reach>(kReaches);
};

}  // namespace clearance
