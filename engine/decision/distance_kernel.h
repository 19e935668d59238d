// Bounds on the least distance of a state by covers, compiled once for each instruction set (decide_avx512.cpp and
// similar).
//
// Level by level, the balls with the least lower bound first. All versions do the same operations on each ball, and
// give the same results (docs/bounds_covers.md, "Distances").
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/cover/point_gaps.h"
#include "engine/decision/distance_view.h"
#include "engine/decision/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// Bounds states one after another.
class DistanceBounder {
 public:
  DistanceBounder(const DistanceBatch& batch, const DistanceRoom& room)
      : batch_(batch), v_(*batch.view), room_(room), placed_(v_) {}

  /// \param used entries of DistanceRoom::left that belong to earlier states
  DistanceBounds bound(const Pose* poses, const double* positions, std::uint32_t used) {
    DistanceBounds result;
    if (!placed_.place(poses)) return result;
    begin(used);
    look_up(positions);
    bound_roots();
    open_roots();
    for (int level = 1; level <= kLevels; ++level) search(level);
    drop_far();
    if (overflow_) return result;
    result.is_listed = true;
    result.lower = aside_ > 0 ? double{aside_} * (1 - kRounding) : 0;
    result.upper = upper_ > 0 ? double{upper_} * (1 + kRounding) : upper_;
    result.lower_at = aside_at_;
    result.upper_at = hit_ != kNowhere ? hit_ : upper_at_;
    result.left_begin = begin_;
    result.left_end = begin_ + left_;
    return result;
  }

 private:
  static constexpr int kLevels = 3;
  static constexpr double kRounding = 0x1p-22;  // of differences of float32 numbers, relative
  static constexpr float kFar = -BallPacket::kNoRadius;
  static constexpr double kMost = 1e29;  // less than the lower bounds of unused columns
  static constexpr std::uint64_t kNowhere = ~std::uint64_t{0};
  static constexpr int kMostPackets = 768;  // of one state

  void begin(std::uint32_t used) {
    begin_ = used;
    left_ = 0;
    aside_ = upper_ = kFar;
    aside_at_ = upper_at_ = hit_ = kNowhere;
    overflow_ = false;
    packets_left_ = kMostPackets;
    for (auto& count : count_) count = 0;
    limit();
  }
  bool is_over() const { return overflow_ || (batch_.limits.any_overlap && upper_ <= 0); }

  void limit() {
    const DistanceLimits& l = batch_.limits;
    const double first = l.scale[0] * upper_ + l.shift[0], second = l.scale[1] * upper_ + l.shift[1];
    double t = first < second ? first : second;
    t = t < l.most ? t : l.most;
    t = t < 0 ? 0 : t > kMost ? kMost : t;
    threshold_ = static_cast<float>(t * (1 + 0x1p-23));
    width_ = upper_ - threshold_;
  }
  /// Takes the upper bounds of eight balls or pairs.
  template <class Position>
  HWY_INLINE void take_upper(const Eight& upper, Bits used, const Position& position) {
    const Bits better = greater(Eight(upper_), upper) & used;
    if (!better) return;
    alignas(32) float values[kBalls];
    upper.store(values);
    for (Bits b = better; b; b &= b - 1) take_upper(values[lowest(b)], position(lowest(b)));
  }
  void take_upper(float upper, std::uint64_t position) {
    if (!(upper < upper_)) return;
    upper_ = upper;
    upper_at_ = position;
    if (upper <= 0) hit_ = position < hit_ ? position : hit_;
    limit();
  }
  void lay_aside(float lower, std::uint64_t position) {
    if (!(lower < aside_)) return;
    aside_ = lower;
    aside_at_ = position;
  }
  /// Lays balls or pairs beyond the threshold aside, and returns the others.
  /// \param values receives the lower bounds
  template <class Position>
  HWY_INLINE Bits sift(const Eight& lower, Bits used, float* values, const Position& position) {
    lower.store(values);
    const Bits far = greater(lower, Eight(threshold_)) & used;
    for (Bits b = greater(Eight(aside_), lower) & far; b; b &= b - 1) lay_aside(values[lowest(b)], position(lowest(b)));
    return used & ~far;
  }

  /// Bounds of the pairs that have joint tables.
  void look_up(const double* positions) {
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t) {
      const TabledPair& pair = v_.tabled[t];
      double at[2];
      for (int c = 0; c < 2; ++c) at[c] = pair.at[c] == kNone ? pair.fixed[c] : positions[pair.at[c]];
      const TableCell cell = pair.table.at(at);
      constexpr float kUnit = static_cast<float>(JointTable::kUnit);
      table_low_[t] = cell.low == TableCell::kNoLow ? -kFar : kUnit * static_cast<float>(cell.low - pair.free_above);
      if (cell.high != TableCell::kNoHigh && pair.hit_below != TableCell::kNoLow)
        take_upper(kUnit * static_cast<float>(cell.high - pair.hit_below), pair.position);
    }
  }
  float* moved_lows() const { return room_.lows + std::size_t{v_.obstacle_count} * v_.columns; }

  void bound_roots() {
    for (std::uint32_t o = 0; o < v_.obstacle_count; ++o)
      for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) bound_roots(o, begin);
    for (std::uint32_t k = 0; k < v_.moved_pair_count; k += kBalls) {
      const Eight d = placed_.distances_of_roots(v_.moved_a + k, v_.moved_b + k);
      (d - Eight::load(v_.moved_reach + k)).store(moved_lows() + k);
      take_upper(d - Eight::load(batch_.moved_inner + k), 0xff,
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
  void bound_roots(std::uint32_t o, std::uint32_t begin) {
    const std::size_t at = std::size_t{o} * v_.columns + begin;
    const Obstacle& obstacle = v_.obstacles[o];
    const Eight outer = Eight::load(v_.root_outer + at);
    if (obstacle.kind == Obstacle::Kind::kPlanes) {  // whose gaps take long
      const Eight low = placed_.distances_to_roots(begin, obstacle.at) - Eight(obstacle.outer_radius) -
                        Eight(obstacle.radius) - outer;
      low.store(room_.lows + at);
      if (greater(low, Eight(threshold_)) == 0xff) return;
    }
    PointGaps gaps;
    placed_.root_gaps(obstacle, begin, gaps);
    (Eight::load(gaps.low) - outer).store(room_.lows + at);
    take_upper(Eight::load(gaps.high) - Eight::load(v_.root_inner + at), 0xff,
               [&](int i) { return v_.position[at + static_cast<std::size_t>(i)]; });
  }

  /// Opens the pairs whose roots are not beyond the threshold.
  void open_roots() {
    alignas(32) float values[kBalls];
    for (std::uint32_t o = 0; o < v_.obstacle_count; ++o)
      for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) {
        const std::size_t at = std::size_t{o} * v_.columns + begin;
        const auto position = [&](int i) { return v_.position[at + static_cast<std::size_t>(i)]; };
        for (Bits b = sift(Eight::load(room_.lows + at), 0xff, values, position); b; b &= b - 1) {
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
      for (Bits b = sift(Eight::load(moved_lows() + begin), 0xff, values, position); b; b &= b - 1) {
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
    return level < kLevels && width < width_ * (level == 1 ? 10.0f : 3.5f);
  }
  /// Adds work to a level, or leaves the pair.
  void push(int level, const DistanceItem& item, bool is_smallest) {
    if (is_smallest || count_[level - 1] == kMostDistanceItems || packets_left_ <= 0)
      return leave(position_of(item), item.lower);
    room_.items[(level - 1) * static_cast<int>(kMostDistanceItems) + static_cast<int>(count_[level - 1]++)] = item;
  }
  LeftPair* find_left(std::uint64_t position) const {
    LeftPair* const of = room_.left + begin_;
    for (std::uint32_t i = 0; i < left_; ++i)
      if (of[i].position == position) return of + i;
    return nullptr;
  }
  void leave(std::uint64_t position, float lower) {
    if (LeftPair* const known = find_left(position)) {
      known->lower = lower < known->lower ? lower : known->lower;
    } else if (begin_ + left_ == room_.capacity) {
      overflow_ = true;
    } else {
      room_.left[begin_ + left_++] = {position, lower};
    }
  }
  /// Lays pairs aside that are beyond the threshold by now, and drops those after an overlapping one.
  void drop_far() {
    LeftPair* const of = room_.left + begin_;
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < left_; ++i) {
      if (of[i].lower > threshold_)
        lay_aside(of[i].lower, of[i].position);
      else if (of[i].position <= hit_)
        of[kept++] = of[i];
    }
    left_ = kept;
  }

  /// The balls of a level, the nearest first.
  void search(int level) {
    DistanceItem* const items = room_.items + (level - 1) * static_cast<int>(kMostDistanceItems);
    const std::uint32_t count = count_[level - 1];
    if (count == 0) return;
    const bool is_decided = width_ <= 0 && is_one_pair(items, count);
    std::uint32_t first = 0;
    for (std::uint32_t i = 1; i < count; ++i)
      if (items[i].lower < items[first].lower) first = i;
    const DistanceItem nearest = items[first];
    items[first] = items[0];
    items[0] = nearest;
    for (std::uint32_t i = 0; i < count && !is_over(); ++i) {
      const DistanceItem item = items[i];
      const std::uint64_t position = position_of(item);
      if (item.lower > threshold_)
        lay_aside(item.lower, position);
      else if (position > hit_)
        continue;
      else if (is_decided || packets_left_ <= 0 || find_left(position))
        leave(position, item.lower);
      else if (item.obstacle == kNone)
        level == 1 ? roots_of_pair(item, position) : packets(item, position, level);
      else
        against_obstacle(item, position, level);
    }
  }
  bool is_one_pair(const DistanceItem* items, std::uint32_t count) const {
    const std::uint64_t position = position_of(items[0]);
    for (std::uint32_t i = 1; i < count; ++i)
      if (items[i].lower <= threshold_ && position_of(items[i]) != position) return false;
    return left_ == 0 || (left_ == 1 && room_.left[begin_].position == position);
  }

  void against_obstacle(const DistanceItem& item, std::uint64_t position, int level) {
    const DecidedBody& body = v_.bodies[item.at];
    if (level > 1) {
      Centres c;
      placed_.template centres<false>(body.packets[item.a], item.at, c);
      return packet_against_obstacle(item, body.packets[item.a], c, position, level);
    }
    if (body.root_packets == 0) return leave(position, item.lower);
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
    point_gaps(v_.obstacles[item.obstacle], c.x, c.y, c.z, gaps);
    take_upper(Eight::load(gaps.high) - (Eight::load(packet.inner) + Eight(v_.shrink[cell])), used, same);
    alignas(32) float lower[kBalls];
    Bits open = sift(Eight::load(gaps.low) - (Eight::load(packet.outer) + Eight(v_.grow[cell])), used, lower, same);
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
    if (a.root_packets == 0 || b.root_packets == 0) return leave(position, item.lower);
    const Centres *ca = placed_.children_of_root<false>(pair.a), *cb = placed_.children_of_root<false>(pair.b);
    alignas(32) float lower[kBalls];
    for (std::uint32_t q = 0; q < b.root_packets; ++q) {
      const Eight d = placed_.distances_to_root(cb[q], pair.a);
      const Eight outer = Eight::load(b.packets[q].outer) + Eight(v_.moved_root_outer[pair.a] + pair.grow);
      const Bits open = sift(d - outer, first(b.packets[q].count), lower, [&](int) { return position; });
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
      take_upper(d - (inner + Eight(of.b.inner[j])), used, same);
      for (Bits open = sift(d - (outer + Eight(of.b.outer[j])), used, lower, same); open; open &= open - 1) {
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
  float table_low_[kMostTabledPairs];
  float upper_ = 0, aside_ = 0, threshold_ = 0, width_ = 0;
  std::uint64_t upper_at_ = 0, aside_at_ = 0, hit_ = 0;
  std::uint32_t begin_ = 0, left_ = 0, count_[kLevels] = {};
  bool overflow_ = false;
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
