// State of the evaluator for two bodies, at least one of them non-convex: the source of its rounds, and scratch for
// triangles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "engine/mesh_distance/nearest_elements.h"

namespace clearance {

class ElementSearch {
 public:
  static constexpr std::size_t kMostOfRound = 256;

  /// All must outlive the search.
  void begin(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b) {
    a_ = &a;
    b_ = &b;
    nearest_.begin(a, pose_a, b, pose_b);
    end_round();
    known_ = {};
  }
  /// Adds to the round until it has `count` pairs or no other is within the cut-off. Returns false if the slice is
  /// over; the next call continues with the same numbers.
  bool gather(std::size_t count, double cut_off, WorkMeter& meter) {
    while (round_.size() < count && !nearest_.is_full()) {
      ElementPair pair;
      const NearestElements::Found found = nearest_.next(cut_off, meter, pair);
      if (found == NearestElements::Found::kPaused) return false;
      if (found == NearestElements::Found::kNoMore) break;
      round_.push_back(pair);
    }
    return true;
  }
  /// Begins a round with the hulls of the nearest two parts, which are not exact.
  /// \param all with all pairs whose boxes may overlap
  void begin_hulls(bool all) {
    round_.assign(1, nearest_.parts());
    if (all) nearest_.touching_parts(round_);
    known_.in_hulls = true;
  }
  /// Least lower bound on the signed distance of the hulls, from their round.
  struct HullsGap {
    double lower = 0;  // not above 0
    Vec3d normal{1, 0, 0};
  };
  void see_hulls(double lower, const Vec3d& n_w) {
    if (lower < known_.hulls_gap.lower) known_.hulls_gap = {lower, n_w};
  }
  const HullsGap& hulls_gap() const { return known_.hulls_gap; }
  bool in_hulls() const { return known_.in_hulls; }
  void take_hulls(double lower, const Vec3d& n_w) {
    nearest_.take_parts(lower);
    known_.are_apart = lower > 0;
    nearest_.look_along(n_w);
    end_round();
    known_.in_hulls = false;
    known_.are_hulls_taken = true;
  }
  bool are_hulls_taken() const { return known_.are_hulls_taken; }
  /// Skips hulls that are most likely not apart.
  bool leave_hulls() { return known_.are_hulls_taken = nearest_.is_one_within(); }
  bool hulls_are_apart() const { return known_.are_apart; }
  /// Begins a round with one near pair. Returns false if all pairs tried for it are beyond the cut-off.
  bool begin_near(double cut_off) {
    if (!round_.empty()) return true;  // from before the end of a slice
    ElementPair pair;
    if (!nearest_.take_near(cut_off, pair)) return false;
    round_.assign(1, pair);
    return true;
  }
  std::span<const ElementPair> round() const { return round_; }
  void end_round() { round_.clear(); }
  /// The elements of a pair of the round, as parts that stay valid until the next round begins.
  const ConvexPart& part_a(std::size_t i) { return part_of(*a_, round_[i].a, triangle_part(2 * i)); }
  const ConvexPart& part_b(std::size_t i) { return part_of(*b_, round_[i].b, triangle_part(2 * i + 1)); }
  /// Lower bound on the distance of pairs in no round yet, metres.
  double left() const { return nearest_.left(); }
  void look_along(const Vec3d& n_w) { nearest_.look_along(n_w); }

 private:
  ConvexPart& triangle_part(std::size_t i) {
    while (triangle_parts_.size() <= i) triangle_parts_.emplace_back();
    return triangle_parts_[i];
  }

  const Body *a_ = nullptr, *b_ = nullptr;
  NearestElements nearest_;
  std::vector<ElementPair> round_;
  // Progress for these bodies. A search is reused for many pairs: begin() resets all of it at once, so that an answer
  // depends on its bodies alone.
  struct Known {
    bool in_hulls = false, are_hulls_taken = false, are_apart = false;  // hulls: in progress, done, apart
    HullsGap hulls_gap;
  } known_;
  std::deque<ConvexPart> triangle_parts_;
};

}  // namespace clearance
