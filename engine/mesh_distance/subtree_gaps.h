// Lower bounds on the distance of subtrees of two bodies, from their boxes and along one known direction.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "engine/mesh_distance/subtree_bounds.h"
#include "engine/pose/placed.h"

namespace clearance {

/// Two subtrees, one of each body.
struct SubtreePair {
  double gap;  ///< lower bound on their distance, in metres
  Subtree a, b;
  std::uint32_t looked;  ///< SubtreeGaps::looks() when the gap was made
};

/// The number, or 0 if it is negative or a NaN, as of a box without bounds.
inline double above_zero(double x) {
  return x > 0 ? x : 0;
}

class SubtreeGaps {
 public:
  /// Both must outlive the gaps.
  void begin(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b);

  const Body& a() const { return *a_; }
  const Body& b() const { return *b_; }
  const Body& body(bool of_a) const { return of_a ? *a_ : *b_; }
  /// The rotation and translation that convert the other body's coordinates to those of a, or of b.
  const Mat3d& R(bool to_a = true) const { return to_a ? R_ : R_ba_; }
  const Vec3d& D(bool to_a = true) const { return to_a ? D_ : D_ba_; }
  /// Converts a box in the axes of b to one in those of a.
  BoxBounds before_a(const BoxBounds& of_b) const;
  BoxBounds before_b(const BoxBounds& of_a) const;
  bool have_half_space() const { return plane_ != Plane::kNeither; }

  BoxBounds bounds_a(const SubtreePair& e) const { return bounds_of(*a_, e.a); }
  BoxBounds bounds_b(const SubtreePair& e) const { return bounds_of(*b_, e.b); }
  /// Gap of two parts, or of anything and a half-space: from boxes in the axes of a, and along the line of their
  /// centres. Not less than the pair's present gap.
  /// \param b in its own axes
  double gap_of(const SubtreePair& e, const BoxBounds& a, const BoxBounds& b) const;
  /// Difference of a gap between cores and the one between grown elements, as computed.
  double margin(const SubtreePair& e) const;

  /// Replaces the known direction.
  /// \param n_w from a towards b, world axes, of length 1 up to rounding
  void look_along(const Vec3d& n_w);
  /// Number of directions so far; only the last one is used.
  std::uint32_t looks() const { return looks_; }
  /// Lets reaches along the known direction descend some levels. Without a direction that separates all, one helps for
  /// a few triangles only.
  void look_deep(bool deep) { looks_deep_ = deep; }
  /// The known direction, from the body towards the other, in the body's axes.
  Vec3d direction(bool of_a) const { return of_a ? n_a_ : -n_b_; }
  /// Reach along the known direction, tighter than that of the subtree's box.
  double known_reach(bool of_a, Subtree subtree, const BoxBounds& box) const;
  /// \param by_bounds reach of its own box
  double known_reach(bool of_a, Subtree subtree, double by_bounds) const {
    return subtree.is_element() || !looks_deep_ ? by_bounds : deep_reach(of_a, subtree, by_bounds);
  }
  /// Gap along the known direction.
  double gap_known(const SubtreePair& e, double reach_a, double reach_b) const {
    return above_zero(((dot(n_a_, D_) - reach_b) - reach_a) * (1 - 0x1p-45) - margin(e));
  }
  double gap_known(const SubtreePair& e) const;
  /// Nodes that known_reach() has opened since the last call.
  std::uint64_t take_reached() { return std::exchange(reached_, 0); }
  std::uint64_t reached() const { return reached_; }

 private:
  // Cache of the reach of subtrees along the known direction, since each is needed for many partners.
  struct Reach {
    std::uint64_t direction = 0;  // of directions_
    std::uint32_t part = 0, at = 0;
    bool of_a = false;
    double reach = 0;

    bool is_of(std::uint64_t its_direction, Subtree subtree, bool its_of_a) const {
      return direction == its_direction && at == subtree.at && part == subtree.part && of_a == its_of_a;
    }
  };
  static constexpr std::size_t kReaches = 2048;

  double gap_along(const SubtreePair& e, const BoxBounds& a, const BoxBounds& b, const Vec3d& n_a,
                   const Vec3d& n_b) const;
  double deep_reach(bool of_a, Subtree subtree, double by_bounds) const;
  double reach_below(bool of_a, Subtree subtree, double by_bounds, int levels) const;

  const Body *a_ = nullptr, *b_ = nullptr;
  Mat3d R_wa_, R_, R_ba_;                                                         // R_: R_wa^T R_wb; its transpose
  Vec3d D_{0, 0, 0}, D_ba_{0, 0, 0};                                              // R_wa^T (t_b - t_a); -R_^T D_
  double error_ = 0;                                                              // of a gap, metres
  enum class Plane : std::uint8_t { kNeither, kA, kB } plane_ = Plane::kNeither;  // the half-space, if any
  std::uint32_t looks_ = 0;
  bool looks_deep_ = false;
  Vec3d n_a_{0, 0, 0}, n_b_{0, 0, 0};
  std::uint64_t directions_ = 0;  // of all searches
  mutable std::uint64_t reached_ = 0;
  mutable std::vector<Reach> reaches_ = std::vector<Reach>(kReaches);
};

}  // namespace clearance
