// Bounds on the least distance of a state by covers, compiled once for each instruction set (decide_avx512.cpp and
// similar).
//
// Level by level, the balls with the least lower bound first. All versions do the same operations on each ball, and
// give the same results (docs/bounds_covers.md, "Distances").
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>

#include "engine/decision/kernel/cell_bounds.h"
#include "engine/decision/kernel/distance_view.h"
#include "engine/decision/kernel/least_bounds.h"
#include "engine/decision/kernel/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// Bounds states one after another, each after place(), or each group of pairs in them.
class DistanceBounder {
 public:
  DistanceBounder(const DistanceBatch& batch, const DistanceRoom& room)
      : batch_(batch), v_(*batch.view), room_(room), placed_(v_), cells_(batch, room), least_(batch.limits, room) {}

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
  static constexpr int kLevels = 3;
  static constexpr int kPacketsOfRoots = 32;  // of the children of two roots
  static constexpr float kOfChildren = 3.5f;  // stand-out of a ball over that of its children, or less

  void begin(std::uint32_t used, int packets) {
    least_.begin(used);
    packets_ = packets_left_ = packets;
    for (auto& count : count_) count = 0;
  }
  void finish(DistanceBounds& result) {
    for (int level = 1; level <= kLevels; ++level) search(level);
    least_.end(result);
    result.packets = static_cast<std::uint32_t>(packets_ - packets_left_);
  }

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
      for (Bits b = least_.sift(Eight::load(cells_.moved_lows() + begin), 0xff, values, position); b; b &= b - 1) {
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
        std::size_t at = std::size_t{o} * v_.columns + begin;
        const Sixteen lows = Sixteen::load(room_.lows + at);
        aside.take(lows, least_.threshold(), at);
        for (Bits near = ~greater(lows, Sixteen(least_.threshold())) & 0xffff; near; near >>= kBalls, at += kBalls) {
          if (!(near & 0xff)) continue;
          if (CellBounds::takes_long(v_.obstacles[o]) && at != bounded) cells_.bound_near(placed_, at, least_);
          open_roots(at, near & 0xff);
        }
      }
    if (const std::size_t cell = aside.at(); cell != LeastCell::kNoCell)
      least_.lay_aside(aside.bound(), v_.position[cell]);  // bound_near() may have raised the cell's
  }
  void open_roots(std::size_t at, Bits near) {
    alignas(32) float lows[kBalls];
    const auto position = [&](int i) { return v_.position[at + static_cast<std::size_t>(i)]; };
    for (Bits b = least_.sift(Eight::load(room_.lows + at), near, lows, position); b; b &= b - 1) {
      const int i = lowest(b);
      const std::size_t cell = at + static_cast<std::size_t>(i);
      push_root(cells_.item_of(static_cast<std::uint32_t>(cell), lows[i]), cell, cells_.has_table(cell));
    }
  }

  std::uint64_t position_of(const DistanceItem& item) const {
    return item.obstacle == kNone ? v_.moved_pairs[item.at].position
                                  : v_.position[std::size_t{item.obstacle} * v_.columns + item.at];
  }
  /// Whether the children of balls, and theirs, may be small enough for the width that is permitted.
  /// \param width stand-out of the balls
  bool is_worth_children(int level, float width, bool is_pair) const {
    if (level == kLevels) return false;
    const float limit = (is_pair ? batch_.limits.pairs_divided : batch_.limits.divided)[level];
    return limit == std::numeric_limits<float>::infinity() || width < least_.width() * limit;
  }
  void push_root(const DistanceItem& item, std::size_t cell, bool is_smallest) {
    const bool is_pair = item.obstacle == kNone;
    const float width = cells_.stand_out(cell);
    // The children of two roots are compared as a whole, and must suffice if no more packets may follow.
    const bool is_last = is_pair && packets_ <= kPacketsOfRoots && !(width < kOfChildren * least_.width());
    push(1, item, is_smallest || is_last || !is_worth_children(0, width, is_pair));
  }
  /// Adds work to a level, or leaves the pair.
  void push(int level, const DistanceItem& item, bool is_smallest) {
    if (is_smallest || count_[level - 1] == kMostDistanceItems || packets_left_ <= 0)
      return least_.leave(position_of(item), item.lower);
    room_.items[(level - 1) * static_cast<int>(kMostDistanceItems) + static_cast<int>(count_[level - 1]++)] = item;
  }
  /// The balls of a level, the nearest first.
  void search(int level) {
    DistanceItem* const items = room_.items + (level - 1) * static_cast<int>(kMostDistanceItems);
    const std::uint32_t count = count_[level - 1];
    if (count == 0) return;
    const bool is_decided = least_.width() <= 0 && is_one_pair(items, count);
    std::uint32_t first = 0;
    for (std::uint32_t i = 1; i < count; ++i)
      if (items[i].lower < items[first].lower) first = i;
    const DistanceItem nearest = items[first];
    items[first] = items[0];
    items[0] = nearest;
    for (std::uint32_t i = 0; i < count && !least_.is_over(); ++i) {
      const DistanceItem item = items[i];
      const std::uint64_t position = position_of(item);
      if (item.lower > least_.threshold())
        least_.lay_aside(item.lower, position);
      else if (position > least_.hit())
        continue;
      else if (is_decided || packets_left_ <= 0 || least_.find_left(position))
        least_.leave(position, item.lower);
      else if (item.obstacle == kNone)
        level == 1 ? roots_of_pair(item, position) : packets(item, position, level);
      else
        against_obstacle(item, position, level);
    }
  }
  bool is_one_pair(const DistanceItem* items, std::uint32_t count) const {
    const std::uint64_t position = position_of(items[0]);
    for (std::uint32_t i = 1; i < count; ++i)
      if (items[i].lower <= least_.threshold() && position_of(items[i]) != position) return false;
    return least_.leaves_only(position);
  }

  void against_obstacle(const DistanceItem& item, std::uint64_t position, int level) {
    const DecidedBody& body = v_.bodies[item.at];
    if (level > 1) {
      Centres c;
      placed_.template centres<false>(body.packets[item.a], item.at, c);
      return packet_against_obstacle(item, body.packets[item.a], c, position, level);
    }
    if (body.root_packets == 0) return least_.leave(position, item.lower);
    const Centres* c = placed_.children_of_root<false>(item.at);
    for (std::uint32_t p = 0; p < body.root_packets; ++p)
      packet_against_obstacle(item, body.packets[p], c[p], position, level);
  }
  void packet_against_obstacle(const DistanceItem& item, const BallPacket& packet, const Centres& c,
                               std::uint64_t position, int level) {
    --packets_left_;
    const std::size_t cell = std::size_t{item.obstacle} * v_.columns + item.at;
    const auto same = [&](int) { return position; };
    const Bits used = first(packet.count);
    PointGaps gaps;
    const Eight outer = Eight::load(packet.outer) + Eight(v_.grow[cell]);
    obstacle_gaps(v_.obstacles[item.obstacle], c.x, c.y, c.z, least_.gap_limits(outer), gaps);
    least_.take_upper(Eight::load(gaps.high) - (Eight::load(packet.inner) + Eight(v_.shrink[cell])), used, same);
    alignas(32) float lower[kBalls];
    Bits open = least_.sift(Eight::load(gaps.low) - outer, used, lower, same);
    for (; open; open &= open - 1) {
      const int i = lowest(open);
      push(level + 1, {lower[i], item.obstacle, item.at, packet.children[i], 0},
           packet.children[i] == kNone || !is_worth_children(level, stand_out(packet, i), false));
    }
  }

  /// The children of two roots.
  void roots_of_pair(const DistanceItem& item, std::uint64_t position) {
    const MovedPair& pair = v_.moved_pairs[item.at];
    const DecidedBody &a = v_.bodies[pair.a], &b = v_.bodies[pair.b];
    if (a.root_packets == 0 || b.root_packets == 0) return least_.leave(position, item.lower);
    const Centres *ca = placed_.children_of_root<false>(pair.a), *cb = placed_.children_of_root<false>(pair.b);
    alignas(32) float lower[kBalls];
    for (std::uint32_t q = 0; q < b.root_packets; ++q) {
      const Eight d = placed_.distances_to_root(cb[q], pair.a);
      const Eight outer = Eight::load(b.packets[q].outer) + Eight(v_.moved_root_outer[pair.a] + pair.grow);
      const Bits open = least_.sift(d - outer, first(b.packets[q].count), lower, [&](int) { return position; });
      for (std::uint32_t p = 0; p < a.root_packets && open; ++p)
        pair_of_packets(item, {a.packets[p], ca[p], b.packets[q], cb[q], open}, position, 1);
    }
  }
  void packets(const DistanceItem& item, std::uint64_t position, int level) {
    const MovedPair& pair = v_.moved_pairs[item.at];
    const BallPacket &a = v_.bodies[pair.a].packets[item.a], &b = v_.bodies[pair.b].packets[item.b];
    Centres ca, cb;
    placed_.template centres<false>(a, pair.a, ca);
    placed_.template centres<false>(b, pair.b, cb);
    pair_of_packets(item, {a, ca, b, cb, first(b.count)}, position, level);
  }
  /// Balls of two bodies, of b those in `open` alone.
  struct PacketPair {
    const BallPacket& a;
    const Centres& ca;
    const BallPacket& b;
    const Centres& cb;
    Bits open;
  };
  void pair_of_packets(const DistanceItem& item, const PacketPair& of, std::uint64_t position, int level) {
    const MovedPair& pair = v_.moved_pairs[item.at];
    const EightPoints centres = of.ca.points();
    const Eight outer = Eight::load(of.a.outer) + Eight(pair.grow),
                inner = Eight::load(of.a.inner) + Eight(pair.shrink);
    const Bits used = first(of.a.count);
    const auto same = [&](int) { return position; };
    alignas(32) float lower[kBalls];
    for (Bits of_b = of.open; of_b; of_b &= of_b - 1) {
      const int j = lowest(of_b);
      --packets_left_;
      const Eight d = distances(centres, of.cb.x[j], of.cb.y[j], of.cb.z[j]);
      least_.take_upper(d - (inner + Eight(of.b.inner[j])), used, same);
      for (Bits open = least_.sift(d - (outer + Eight(of.b.outer[j])), used, lower, same); open; open &= open - 1) {
        const int i = lowest(open);
        push(level + 1, {lower[i], kNone, item.at, of.a.children[i], of.b.children[j]},
             of.a.children[i] == kNone || of.b.children[j] == kNone ||
                 !is_worth_children(level, stand_out(of.a, i) + stand_out(of.b, j), true));
      }
    }
  }

  const DistanceBatch& batch_;
  const DecisionView& v_;
  const DistanceRoom& room_;
  PlacedBalls placed_;
  CellBounds cells_;
  LeastBounds least_;
  Bits usable_ = 0;  // states of a batch with frames
  std::uint32_t count_[kLevels] = {};
  int packets_ = 0, packets_left_ = 0;  // of the group
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
