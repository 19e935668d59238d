// Bounds on the least distance of a state by covers, compiled once for each instruction set (decide_avx512.cpp and
// similar).
//
// Level by level, the balls with the least lower bound first. All versions do the same operations on each ball, and
// give the same results (docs/bounds_covers.md, "Distances").
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/decision/distance_view.h"
#include "engine/decision/least_bounds.h"
#include "engine/decision/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// Bounds states one after another.
class DistanceBounder {
 public:
  DistanceBounder(const DistanceBatch& batch, const DistanceRoom& room)
      : batch_(batch), v_(*batch.view), room_(room), placed_(v_), least_(batch.limits, room) {}

  /// \param used entries of DistanceRoom::left that belong to earlier states
  DistanceBounds bound(const Pose* poses, const double* positions, std::uint32_t used) {
    DistanceBounds result;
    if (!placed_.place(poses)) return result;
    begin(used);
    look_up(positions);
    bound_roots();
    open_roots();
    for (int level = 1; level <= kLevels; ++level) search(level);
    least_.end(result);
    return result;
  }

 private:
  static constexpr int kLevels = 3;
  static constexpr int kMostPackets = 768;  // of one state

  void begin(std::uint32_t used) {
    least_.begin(used);
    packets_left_ = kMostPackets;
    for (auto& count : count_) count = 0;
  }

  /// Bounds of the pairs that have joint tables.
  void look_up(const double* positions) {
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t) {
      const TabledPair& pair = v_.tabled[t];
      double at[2];
      for (int c = 0; c < 2; ++c) at[c] = pair.at[c] == kNone ? pair.fixed[c] : positions[pair.at[c]];
      const TableCell cell = pair.table.at(at);
      constexpr float kUnit = static_cast<float>(JointTable::kUnit);
      table_low_[t] =
          cell.low == TableCell::kNoLow ? -LeastBounds::kFar : kUnit * static_cast<float>(cell.low - pair.free_above);
      if (cell.high != TableCell::kNoHigh && pair.hit_below != TableCell::kNoLow)
        least_.take_upper(kUnit * static_cast<float>(cell.high - pair.hit_below), pair.position);
    }
  }
  float* moved_lows() const { return room_.lows + std::size_t{v_.obstacle_count} * v_.columns; }

  void bound_roots() {
    for (std::uint32_t o = 0; o < v_.obstacle_count; ++o)
      for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) bound_roots(o, begin);
    for (std::uint32_t k = 0; k < v_.moved_pair_count; k += kBalls) {
      const Eight d = placed_.distances_of_roots(v_.moved_a + k, v_.moved_b + k);
      (d - Eight::load(v_.moved_reach + k)).store(moved_lows() + k);
      least_.take_upper(d - Eight::load(batch_.moved_inner + k), 0xff,
                        [&](int i) { return v_.moved_pairs[k + static_cast<std::uint32_t>(i)].position; });
    }
    if (v_.tabled_count == 0) return;
    for (std::uint32_t k = 0; k < v_.moved_pair_count; ++k) raise(moved_lows()[k], v_.moved_pairs[k].table);
    for (std::size_t at = 0; at < std::size_t{v_.obstacle_count} * v_.columns; ++at)
      raise(room_.lows[at], v_.table[at]);
  }
  void raise(float& low, std::uint32_t table) const {
    if (table != kNoTable && table_low_[table] > low) low = table_low_[table];
  }
  /// Gaps of balls whose shares are not beyond the threshold matter, but all until there is an upper bound.
  HWY_INLINE GapLimits limits(const Eight& outer) const {
    const Eight never(-LeastBounds::kFar);
    return {Eight(least_.has_upper() ? least_.threshold() : 0.1f * LeastBounds::kFar) + outer, never, never};
  }
  void bound_roots(std::uint32_t o, std::uint32_t begin) {
    const std::size_t at = std::size_t{o} * v_.columns + begin;
    const Obstacle& obstacle = v_.obstacles[o];
    const Eight outer = Eight::load(v_.root_outer + at);
    if (obstacle.kind == Obstacle::Kind::kPlanes) {  // whose gaps take long
      const Eight low = placed_.distances_to_roots(begin, obstacle.at) - Eight(obstacle.outer_radius) -
                        Eight(obstacle.radius) - outer;
      low.store(room_.lows + at);
      if (greater(low, Eight(least_.threshold())) == 0xff) return;
    }
    PointGaps gaps;
    placed_.root_gaps(obstacle, begin, limits(outer), gaps);
    (Eight::load(gaps.low) - outer).store(room_.lows + at);
    least_.take_upper(Eight::load(gaps.high) - Eight::load(v_.root_inner + at), 0xff,
                      [&](int i) { return v_.position[at + static_cast<std::size_t>(i)]; });
  }

  /// Opens the pairs whose roots are not beyond the threshold.
  void open_roots() {
    alignas(32) float values[kBalls];
    for (std::uint32_t o = 0; o < v_.obstacle_count; ++o)
      for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) {
        const std::size_t at = std::size_t{o} * v_.columns + begin;
        const auto position = [&](int i) { return v_.position[at + static_cast<std::size_t>(i)]; };
        for (Bits b = least_.sift(Eight::load(room_.lows + at), 0xff, values, position); b; b &= b - 1) {
          const int i = lowest(b);
          const bool has_table = v_.table[at + static_cast<std::size_t>(i)] != kNoTable;
          push(1, {values[i], o, begin + static_cast<std::uint32_t>(i), 0, 0}, has_table);
        }
      }
    for (std::uint32_t begin = 0; begin < v_.moved_pair_count; begin += kBalls) {
      const auto pair = [&](int i) -> const MovedPair& {
        return v_.moved_pairs[begin + static_cast<std::uint32_t>(i)];
      };
      const auto position = [&](int i) { return pair(i).position; };
      for (Bits b = least_.sift(Eight::load(moved_lows() + begin), 0xff, values, position); b; b &= b - 1) {
        const int i = lowest(b);
        push(1, {values[i], kNone, begin + static_cast<std::uint32_t>(i), 0, 0}, pair(i).table != kNoTable);
      }
    }
  }

  std::uint64_t position_of(const DistanceItem& item) const {
    return item.obstacle == kNone ? v_.moved_pairs[item.at].position
                                  : v_.position[std::size_t{item.obstacle} * v_.columns + item.at];
  }
  static float stand_out(const BallPacket& packet, int i) {
    return packet.outer[i] - (packet.inner[i] > 0 ? packet.inner[i] : 0);
  }
  /// Whether the children of balls, and theirs, may be small enough for the width that is permitted. A level's balls
  /// stand out by a third of those of the level above, or less.
  /// \param width stand-out of the balls
  bool is_worth_children(int level, float width) const {
    return level < kLevels && width < least_.width() * (level == 1 ? 10.0f : 3.5f);
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
    obstacle_gaps(v_.obstacles[item.obstacle], c.x, c.y, c.z, limits(outer), gaps);
    least_.take_upper(Eight::load(gaps.high) - (Eight::load(packet.inner) + Eight(v_.shrink[cell])), used, same);
    alignas(32) float lower[kBalls];
    Bits open = least_.sift(Eight::load(gaps.low) - outer, used, lower, same);
    for (; open; open &= open - 1) {
      const int i = lowest(open);
      push(level + 1, {lower[i], item.obstacle, item.at, packet.children[i], 0},
           packet.children[i] == kNone || !is_worth_children(level, stand_out(packet, i)));
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
                 !is_worth_children(level, stand_out(of.a, i) + stand_out(of.b, j)));
      }
    }
  }

  const DistanceBatch& batch_;
  const DecisionView& v_;
  const DistanceRoom& room_;
  PlacedBalls placed_;
  LeastBounds least_;
  float table_low_[kMostTabledPairs];
  std::uint32_t count_[kLevels] = {};
  int packets_left_ = 0;
};

inline void bound_distances(const DistanceBatch& batch, const DistanceRoom& room) {
  DistanceBounder bounder(batch, room);
  std::uint32_t used = 0;
  for (std::size_t k = 0; k < batch.states; ++k) {
    DistanceBounds& bounds = room.bounds[k];
    bounds = {};
    if (batch.usable[k])
      bounds = bounder.bound(batch.poses + k * batch.stride, batch.positions + k * batch.position_stride, used);
    used = bounds.is_listed ? bounds.left_end : used;
  }
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
