// Bounds of covers' roots, for the kernel of distances (distance_kernel.h).
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/cover/point_gaps.h"
#include "engine/decision/kernel/distance_view.h"
#include "engine/decision/kernel/least_bounds.h"
#include "engine/decision/kernel/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// The cell with the least bound above a limit.
class LeastCell {
 public:
  static constexpr std::size_t kNoCell = ~std::size_t{0};

  /// \param first of kColumns cells
  HWY_INLINE void take(const Sixteen& bounds, float above, std::size_t first) {
    const Sixteen taken = if_greater(bounds, Sixteen(above), bounds, Sixteen(LeastBounds::kFar));
    first_ = if_greater(least_, taken, Sixteen(static_cast<float>(first / kColumns)), first_);
    least_ = lesser(least_, taken);
  }
  float bound() const { return least(least_); }
  /// kNoCell if there is none.
  std::size_t at() const {
    const float bound = least(least_);
    if (!(bound < LeastBounds::kFar)) return kNoCell;
    alignas(64) float first[kColumns];
    first_.store(first);
    const int lane = lowest(equal(least_, Sixteen(bound)));
    return kColumns * static_cast<std::size_t>(first[lane]) + static_cast<std::size_t>(lane);
  }

 private:
  Sixteen least_{LeastBounds::kFar}, first_{0};  // number of the columns, exact: a plan has fewer pairs than 2^24
};

/// Bounds of all cells (DistanceGroups) in one state: of pairs of roots, and of joint tables.
class CellBounds {
 public:
  CellBounds(const DistanceBatch& batch, const DistanceRoom& room) : batch_(batch), v_(*batch.view), room_(room) {}

  /// Bounds of the pairs that have joint tables, in state k of the batch.
  void look_up(std::size_t k) {
    const TableCell* const* const found = batch_.cells ? batch_.cells + k * v_.tabled_count : find(k);
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t) {
      const TabledPair& pair = v_.tabled[t];
      const TableCell cell = found[t] ? *found[t] : TableCell{TableCell::kNoLow, TableCell::kNoHigh};
      constexpr float kUnit = static_cast<float>(JointTable::kUnit);
      table_low_[t] =
          cell.low == TableCell::kNoLow ? -LeastBounds::kFar : kUnit * static_cast<float>(cell.low - pair.free_above);
      table_high_[t] = cell.high != TableCell::kNoHigh && pair.hit_below != TableCell::kNoLow
                           ? kUnit * static_cast<float>(cell.high - pair.hit_below)
                           : LeastBounds::kFar;
    }
  }
  float table_high(std::uint32_t table) const { return table_high_[table]; }
  /// Bounds of all roots.
  /// \param most greatest threshold; roots beyond it may have no upper bounds
  void bound(const PlacedBalls& placed, float most) {
    for (std::uint32_t o = 0; o < v_.obstacle_count; ++o)
      for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) bound(placed, o, begin, most);
    float* const highs = room_.highs + obstacle_cells();
    for (std::uint32_t k = 0; k < v_.moved_pair_count; k += kBalls) bound_moved(placed, k).store(highs + k);
    take_tables();
    for (const auto [cell, table] : batch_.tabled)
      if (float& high = room_.highs[cell]; table_high_[table] < high) high = table_high_[table];
    for (std::size_t k = 0; k < batch_.still.size(); ++k) {
      room_.lows[first_still() + k] = batch_.still[k].lower;
      room_.highs[first_still() + k] = batch_.still[k].upper;
    }
  }
  /// Bounds of the roots of moved pairs, for their least distance.
  void bound_moved(const PlacedBalls& placed, LeastBounds& least) const {
    for (std::uint32_t k = 0; k < v_.moved_pair_count; k += kBalls)
      least.take_upper(bound_moved(placed, k),
                       [&](int i) { return v_.moved_pairs[k + static_cast<std::uint32_t>(i)].position; });
  }
  /// Bounds of all roots of bodies and obstacles, for their least distance: those of obstacles whose gaps take long have
  /// lower bounds by boxes. Returns the nearest cell of these that has one, or LeastCell::kNoCell.
  std::size_t bound_roots(const PlacedBalls& placed, LeastBounds& least) const {
    LeastCell nearest, high;
    for (std::uint32_t o = 0; o < v_.obstacle_count; ++o)
      for (std::uint32_t begin = 0; begin < v_.columns; begin += kColumns) {
        const std::size_t first = std::size_t{o} * v_.columns + begin;
        if (takes_long(v_.obstacles[o])) {
          const Sixteen low = placed.distances_by_box(o, begin);
          low.store(room_.lows + first);
          nearest.take(low, -LeastBounds::kFar, first);
        } else {
          const Sixteen gap = placed.gaps_of_roots(v_.obstacles[o], begin);
          (gap - Sixteen::load(v_.root_outer + first)).store(room_.lows + first);
          high.take(gap - Sixteen::load(v_.root_inner + first), -LeastBounds::kFar, first);
        }
      }
    if (const std::size_t cell = high.at(); cell != LeastCell::kNoCell)
      least.take_upper(high.bound(), v_.position[cell]);
    return nearest.at();
  }
  /// Bounds of eight cells from `at` on, besides those by boxes and tables.
  void bound_near(const PlacedBalls& placed, std::size_t at, LeastBounds& least) const {
    const auto o = static_cast<std::uint32_t>(at / v_.columns), begin = static_cast<std::uint32_t>(at % v_.columns);
    const GapLimits limits = least.gap_limits(Eight::load(v_.root_outer + at));
    const Eight known = Eight::load(room_.lows + at);
    least.take_upper(bound_eight(placed, o, begin, limits),
                     [&](int i) { return v_.position[at + static_cast<std::size_t>(i)]; });
    larger(Eight::load(room_.lows + at), known).store(room_.lows + at);
  }
  /// Raises the lower bounds of pairs that have tables.
  void take_tables() {
    for (const auto [cell, table] : batch_.tabled)
      if (float& low = room_.lows[cell]; table_low_[table] > low) low = table_low_[table];
  }
  // Cells of bodies and obstacles, which come before those of moved pairs.
  std::size_t obstacle_cells() const { return std::size_t{v_.obstacle_count} * v_.columns; }
  float* moved_lows() const { return room_.lows + obstacle_cells(); }
  bool has_table(std::size_t cell) const { return table_of(cell) != kNoTable; }
  /// Whether a table bounds a pair from both sides, so that balls need not.
  bool is_in_table(std::size_t cell) const {
    return has_table(cell) && table_high_[table_of(cell)] < LeastBounds::kFar;
  }
  bool is_still(std::size_t cell) const { return cell >= first_still(); }
  /// Stand-out of a cell's roots.
  float stand_out(std::size_t cell) const {
    const bool is_moved = cell >= obstacle_cells();
    const float outer = is_moved ? v_.moved_reach[cell - obstacle_cells()] : v_.root_outer[cell],
                inner = is_moved ? batch_.moved_inner[cell - obstacle_cells()] : v_.root_inner[cell];
    return outer - (inner > 0 ? inner : 0);
  }
  std::uint64_t position_of(std::size_t cell) const {
    if (is_still(cell)) return batch_.still[cell - first_still()].position;
    return cell < obstacle_cells() ? v_.position[cell] : v_.moved_pairs[cell - obstacle_cells()].position;
  }
  DistanceItem item_of(std::uint32_t cell, float low) const {
    const auto first_moved = static_cast<std::uint32_t>(obstacle_cells());
    if (cell >= first_moved) return {low, kNone, cell - first_moved, 0, 0};
    return {low, cell / v_.columns, cell % v_.columns, 0, 0};
  }

 private:
  // Finds the cells of state k, null outside the tables.
  HWY_NOINLINE const TableCell* const* find(std::size_t k) {
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t)
      found_[t] = v_.tabled[t].find(batch_.positions + k * batch_.position_stride);
    return found_;
  }
  void bound(const PlacedBalls& placed, std::uint32_t o, std::uint32_t begin, float most) {
    const Obstacle& obstacle = v_.obstacles[o];
    const std::size_t at = std::size_t{o} * v_.columns + begin;
    const Eight outer = Eight::load(v_.root_outer + at), far(LeastBounds::kFar), never(-LeastBounds::kFar);
    if (obstacle.kind == Obstacle::Kind::kPlanes) {  // whose gaps take long
      const Eight low = placed.distances_to_ball(begin, obstacle) - outer;
      low.store(room_.lows + at);
      far.store(room_.highs + at);
      if (greater(low, Eight(most)) == 0xff) return;
    }
    const Eight beyond = Eight(most < 0.1f * LeastBounds::kFar ? most : 0.1f * LeastBounds::kFar) + outer;
    bound_eight(placed, o, begin, {beyond, never, never}).store(room_.highs + at);
  }
  // Stores the lower bounds of eight roots and an obstacle, and returns the upper ones.
  HWY_INLINE Eight bound_eight(const PlacedBalls& placed, std::uint32_t o, std::uint32_t begin,
                               const GapLimits& limits) const {
    const std::size_t at = std::size_t{o} * v_.columns + begin;
    const Eight outer = Eight::load(v_.root_outer + at);
    PointGaps gaps;
    placed.root_gaps(v_.obstacles[o], begin, limits, gaps);
    (Eight::load(gaps.low) - outer).store(room_.lows + at);
    return Eight::load(gaps.high) - Eight::load(v_.root_inner + at);
  }
  // The same of eight moved pairs.
  HWY_INLINE Eight bound_moved(const PlacedBalls& placed, std::uint32_t k) const {
    const Eight d = placed.distances_of_roots(v_.moved_a + k, v_.moved_b + k);
    (d - Eight::load(v_.moved_reach + k)).store(moved_lows() + k);
    return d - Eight::load(batch_.moved_inner + k);
  }
  std::size_t first_still() const { return obstacle_cells() + (v_.moved_pair_count + kBalls - 1) / kBalls * kBalls; }
  std::uint8_t table_of(std::size_t cell) const {
    return cell < obstacle_cells() ? v_.table[cell] : v_.moved_pairs[cell - obstacle_cells()].table;
  }

  const DistanceBatch& batch_;
  const DecisionView& v_;
  const DistanceRoom& room_;
  float table_low_[kMostTabledPairs], table_high_[kMostTabledPairs];
  const TableCell* found_[kMostTabledPairs];
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
