// Bounds on the least distance of a state by covers, compiled once for each instruction set (decide_avx512.cpp and
// similar).
//
// All versions do the same operations on each ball, and give the same results (docs/trust/bounds_covers.md,
// "Distances").
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/decision/kernel/ball_search.h"
#include "engine/decision/kernel/cell_bounds.h"
#include "engine/decision/kernel/distance_view.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// Bounds states one after another, each after place(), or each group of pairs in them.
class DistanceBounder : private BallSearch {
 public:
  DistanceBounder(const DistanceBatch& batch, const DistanceRoom& room)
      : BallSearch(batch, room), cells_(batch, room) {}

  /// Places the bodies in state k of the batch. Returns false if the bounds do not hold.
  bool place(std::size_t k) {
    if (batch_.frames && k == 0) usable_ = placed_.place(batch_.frames, batch_.states);
    if (!batch_.usable[k]) return false;
    if (!batch_.frames) return placed_.place(batch_.poses + k * batch_.stride);
    if (usable_ >> k & 1) placed_.take_state(k);
    return usable_ >> k & 1;
  }
  /// Bounds the least distance of state k.
  /// \param used entries of DistanceRoom::left that belong to earlier states
  DistanceBounds bound(std::size_t k, std::uint32_t used) {
    DistanceBounds result;
    begin(used, batch_.limits.packets);
    cells_.look_up(k);
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t) least_.take_upper(cells_.table_high(t), v_.tabled[t].position);
    for (const StillCell& pair : batch_.still) least_.take_upper(pair.upper, pair.position);
    cells_.bound_moved(placed_, least_);
    std::size_t nearest = cells_.bound_roots(placed_, least_);
    cells_.take_tables();
    if (nearest != LeastCell::kNoCell) cells_.bound_near(placed_, nearest = nearest / kBalls * kBalls, least_);
    open_still_pairs();
    open_obstacle_roots(nearest);
    open_moved_roots();
    finish(result);
    return result;
  }
  /// \param results (groups,)
  void bound_groups(std::size_t k, std::uint32_t used, DistanceBounds* results) {
    cells_.look_up(k);
    const float most = least_.greatest_threshold();
    cells_.bound(placed_, most);
    const DistanceGroups& groups = *batch_.groups;
    for (std::uint32_t g = 0; g < groups.count; ++g) {
      const std::uint32_t first = groups.begin[g], end = groups.begin[g + 1];
      if (end == first + 1 && room_.lows[groups.cells[first]] > most) {  // most pairs of Reduce::kWithin
        take_beyond(groups.cells[first], used, results[g]);
        continue;
      }
      begin(used, groups.packets[g]);
      open_cells(groups.cells + first, groups.cells + end);
      finish(results[g]);
      used = results[g].is_listed ? results[g].left_end : used;
    }
  }

 private:
  /// The result of a group of one pair that is beyond all thresholds.
  void take_beyond(std::uint32_t cell, std::uint32_t used, DistanceBounds& result) {
    least_.begin(used);
    least_.take_upper(room_.highs[cell], cells_.position_of(cell));
    least_.lay_aside(room_.lows[cell], cells_.position_of(cell));
    least_.end(result);
  }

  /// Opens those cells of a group whose roots are not beyond its threshold.
  void open_cells(const std::uint32_t* begin, const std::uint32_t* end) {
    for (const std::uint32_t* cell = begin; cell < end; ++cell)
      if (const float high = room_.highs[*cell]; high < least_.upper())
        least_.take_upper(high, cells_.position_of(*cell));
    for (const std::uint32_t* cell = begin; cell < end; ++cell) {
      const float low = room_.lows[*cell];
      if (low > least_.threshold())
        least_.lay_aside(low, cells_.position_of(*cell));
      else if (cells_.is_still(*cell))
        least_.leave(cells_.position_of(*cell), low);
      else
        push_root(cells_.item_of(*cell, low), *cell, cells_.is_in_table(*cell));
    }
  }
  void open_still_pairs() {
    for (const StillCell& pair : batch_.still)
      if (pair.lower > least_.threshold())
        least_.lay_aside(pair.lower, pair.position);
      else
        least_.leave(pair.position, pair.lower);
  }
  /// Opens the moved pairs whose roots are not beyond the threshold.
  void open_moved_roots() {
    alignas(32) float values[kBalls];
    const std::size_t first_moved = cells_.obstacle_cells();
    for (std::uint32_t begin = 0; begin < v_.moved_pair_count; begin += kBalls) {
      const auto position = [&](int i) { return v_.moved_pairs[begin + static_cast<std::uint32_t>(i)].position; };
      for (Bits b = least_.sift(Eight::load(cells_.moved_lows() + begin), values, position); b; b &= b - 1) {
        const int i = lowest(b);
        const std::uint32_t k = begin + static_cast<std::uint32_t>(i);
        push_root({values[i], kNone, k, 0, 0}, first_moved + k, cells_.has_table(first_moved + k));
      }
    }
  }
  /// Opens the pairs of bodies and obstacles whose roots are not beyond the threshold.
  /// \param bounded first of eight cells whose roots have bounds although their obstacle takes long
  void open_obstacle_roots(std::size_t bounded) {
    LeastCell aside;
    for (std::uint32_t o = 0; o < v_.obstacle_count; ++o)
      for (std::uint32_t begin = 0; begin < v_.columns; begin += kColumns) {
        const std::size_t at = std::size_t{o} * v_.columns + begin;
        const Sixteen lows = Sixteen::load(room_.lows + at);
        aside.take(lows, least_.threshold(), at);
        const Bits near = ~greater(lows, Sixteen(least_.threshold())) & 0xffff;
        if (!near) continue;
        if (takes_long(v_.obstacles[o]))
          open_long_roots(at, near, bounded);
        else
          for (Bits b = near; b; b &= b - 1) open_root(o, begin + static_cast<std::uint32_t>(lowest(b)));
      }
    if (const std::size_t cell = aside.at(); cell != LeastCell::kNoCell)
      least_.lay_aside(aside.bound(), v_.position[cell]);  // bound_near() may have raised the cell's
  }
  /// The same of kColumns cells whose obstacle takes long: their bounds lower the threshold.
  void open_long_roots(std::size_t at, Bits near, std::size_t bounded) {
    for (; near; near >>= kBalls, at += kBalls) {
      if (!(near & 0xff)) continue;
      if (at != bounded) cells_.bound_near(placed_, at, least_);
      alignas(32) float lows[kBalls];
      const auto position = [&](int i) { return v_.position[at + static_cast<std::size_t>(i)]; };
      for (Bits b = least_.sift(Eight::load(room_.lows + at), lows, position); b; b &= b - 1) {
        const auto cell = static_cast<std::uint32_t>(at) + static_cast<std::uint32_t>(lowest(b));
        open_root(cell / v_.columns, cell % v_.columns);
      }
    }
  }
  void open_root(std::uint32_t obstacle, std::uint32_t body) {
    const std::size_t cell = std::size_t{obstacle} * v_.columns + body;
    push_root({room_.lows[cell], obstacle, body, 0, 0}, cell, cells_.has_table(cell));
  }
  void push_root(const DistanceItem& item, std::size_t cell, bool is_smallest) {
    BallSearch::push_root(item, cells_.stand_out(cell), is_smallest);
  }

  CellBounds cells_;
  Bits usable_ = 0;  // states of a batch with frames
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
