// What the evaluator keeps of two bodies of which one is not convex: where its rounds come from, and room for
// triangles.
#pragma once

#include <cstddef>
#include <deque>
#include <span>
#include <vector>

#include "engine/query/nearest_elements.h"

namespace clearance {

class ElementSearch {
 public:
  static constexpr std::size_t kMostOfRound = 256;

  /// All must outlive the search.
  void begin(const Body& a, const PlacedPose& pose_a, const Body& b, const PlacedPose& pose_b) {
    a_ = &a;
    b_ = &b;
    nearest_.begin(a, pose_a, b, pose_b);
    end_round();
  }
  /// Adds to the round until it has so many pairs or no other is within the cut-off. False: the slice is over; it goes
  /// on with the same numbers.
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
  std::span<const ElementPair> round() const { return round_; }
  void end_round() { round_.clear(); }
  /// The elements of a pair of the round, as pieces that stay until another round has begun.
  const Piece& piece_a(std::size_t i) { return piece_of(*a_, round_[i].a, room(2 * i)); }
  const Piece& piece_b(std::size_t i) { return piece_of(*b_, round_[i].b, room(2 * i + 1)); }
  /// No pair that is in no round yet is nearer, metres.
  double left() const { return nearest_.left(); }
  void look_along(const Vec3d& n_w) { nearest_.look_along(n_w); }

 private:
  Piece& room(std::size_t i) {
    while (rooms_.size() <= i) rooms_.emplace_back();
    return rooms_[i];
  }

  const Body *a_ = nullptr, *b_ = nullptr;
  NearestElements nearest_;
  std::vector<ElementPair> round_;
  std::deque<Piece> rooms_;
};

}  // namespace clearance
