// A tree over the boxes of bodies, eight to a block, that follows moving bodies.
//
// Bodies are sorted so that neighbours are near each other; eight in a row make a block, eight blocks in a row a block
// of the next level, and so on up to a single one. There are no pointers, and a block's eight boxes are a structure of
// arrays, so that one box is compared with all eight at once. When bodies move, the order stays and boxes are refitted,
// in a tenth of the time of a new order, until blocks have grown too wide.
//
// A block's box contains those of its bodies, and certify_box_gap() never grows when a box does, rounding included. So
// a branch skipped for its gap holds no pair that brute force would have found, bit for bit.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/body_pair.h"
#include "engine/hull/box.h"

namespace clearance {

class BoxTree {
 public:
  static constexpr std::uint32_t kWide = 8;

  /// Holds bodies `ids` at `boxes` (of all bodies, by id; empty boxes are near nothing). Keeps the order for the same
  /// bodies as before unless it is worn, and otherwise makes a new one.
  void fit(std::span<const std::uint32_t> ids, std::span<const Aabb> boxes);
  /// Makes a new order in any case.
  void build(std::span<const std::uint32_t> ids, std::span<const Aabb> boxes);
  /// Whether blocks have grown so much since the order was made that a new one pays.
  bool worn() const;

  std::uint32_t size() const { return count_; }
  /// Number of blocks of bodies, the units of pairs_within() and nearest_pair().
  std::uint32_t blocks() const { return levels_.empty() ? 0 : static_cast<std::uint32_t>(levels_[0].size()); }
  std::span<const std::uint32_t> order() const { return order_; }  ///< bodies by place; kNone in empty places
  std::uint64_t builds() const { return builds_; }                 ///< number of orders made so far
  std::uint64_t bytes() const;

  /// Appends every pair {a, b}, a < b, of a body in blocks [first, last) and one in the same or a later block whose gap
  /// is finite and <= margin, in no order.
  void pairs_within(std::uint32_t first, std::uint32_t last, double margin, std::vector<BodyPair>& out) const;

  /// Visits every body whose gap to the box is finite and <= bound, nearest branches first.
  /// \param offer returns, as offer(gap, body), the new bound
  template <class Offer>
  void nearest(const Aabb& box, double bound, Offer&& offer) const;

 private:
  struct Block {
    alignas(64) double column[6][kWide];  // low x, y, z, high x, y, z
  };
  struct Step {
    std::uint32_t level, block;
    double squared;  // of the gap
  };
  using Squares = double[kWide];
  static constexpr std::uint32_t kMostLevels = 11;  // 8^11 is more than 2^32

  static void squared_gaps(const Block& block, const Aabb& box, Squares& squared);
  static double squared_limit(double margin);
  void order(std::uint32_t begin, std::uint32_t end, std::span<const Aabb> boxes);
  void fit_boxes(std::span<const Aabb> boxes);
  Aabb box_at(std::uint32_t place) const;
  static Aabb around_all(const Block& block);

  std::uint32_t count_ = 0;
  std::vector<std::uint32_t> ids_;    // in the caller's order
  std::vector<std::uint32_t> order_;  // body at each place; padded with kNone
  std::vector<std::vector<Block>> levels_;
  std::vector<std::vector<double>> width_built_;  // of each block, when the order was made
  std::vector<double> wear_;                      // of each level: mean growth of its blocks' width since then
  std::uint64_t builds_ = 0;
};

template <class Offer>
void BoxTree::nearest(const Aabb& box, double bound, Offer&& offer) const {
  if (count_ == 0 || !(bound >= 0)) return;
  // Deep enough for any tree: a level leaves at most seven of its blocks waiting.
  Step waiting[kWide * kMostLevels];
  std::size_t count = 0;
  waiting[count++] = {static_cast<std::uint32_t>(levels_.size()) - 1, 0, 0};
  double limit = squared_limit(bound);
  while (count > 0) {
    const Step at = waiting[--count];
    if (!(at.squared <= limit)) continue;
    const Block& block = levels_[at.level][at.block];
    Squares squared;
    squared_gaps(block, box, squared);
    const std::size_t first = count;
    for (std::uint32_t k = 0; k < kWide; ++k) {
      if (!(squared[k] <= limit) || squared[k] == __builtin_inf()) continue;
      const std::uint32_t below = at.block * kWide + k;
      if (at.level > 0) {  // the nearest is taken first, from the end
        std::size_t i = count++;
        for (; i > first && waiting[i - 1].squared < squared[k]; --i) waiting[i] = waiting[i - 1];
        waiting[i] = {at.level - 1, below, squared[k]};
      } else {
        const double gap = certify_box_gap(box, box_at(below));
        if (gap <= bound) limit = squared_limit(bound = offer(gap, order_[below]));
      }
    }
  }
}

}  // namespace clearance
