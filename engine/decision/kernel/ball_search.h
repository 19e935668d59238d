// Search of balls, level by level, for the least distance of a group of pairs (distance_kernel.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "engine/decision/kernel/distance_view.h"
#include "engine/decision/kernel/least_bounds.h"
#include "engine/decision/kernel/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// Narrows the bounds of pairs whose roots are near, by the balls below: those with the least lower bound first.
class BallSearch {
 protected:
  BallSearch(const DistanceBatch& batch, const DistanceRoom& room)
      : batch_(batch), v_(*batch.view), room_(room), placed_(v_), least_(batch.limits, room) {}

  /// Begins with a group of pairs.
  /// \param used entries of DistanceRoom::left that belong to earlier states
  /// \param packets most packets of balls: beyond them, pairs are left
  void begin(std::uint32_t used, int packets) {
    least_.begin(used);
    packets_ = packets_left_ = packets;
    for (auto& count : count_) count = 0;
  }
  /// Adds a pair whose roots are near.
  /// \param width stand-out of the roots
  /// \param is_smallest whether balls need not be compared: the pair is left
  void push_root(const DistanceItem& item, float width, bool is_smallest) {
    const bool is_pair = item.obstacle == kNone;
    // The children of two roots are compared as a whole, and must suffice if no more packets may follow.
    const bool is_last = is_pair && packets_ <= kPacketsOfRoots && !(width < kOfChildren * least_.width());
    push(1, item, is_smallest || is_last || !is_worth_children(0, width, is_pair));
  }
  /// Compares the balls of all pairs that were added.
  void finish(DistanceBounds& result) {
    for (int level = 1; level <= kLevels; ++level) search(level);
    least_.end(result);
    result.packets = static_cast<std::uint32_t>(packets_ - packets_left_);
  }

  const DistanceBatch& batch_;
  const DecisionView& v_;
  const DistanceRoom& room_;
  PlacedBalls placed_;
  LeastBounds least_;

 private:
  static constexpr int kLevels = 3;
  static constexpr int kPacketsOfRoots = 32;  // of the children of two roots
  static constexpr float kOfChildren = 3.5f;  // stand-out of a ball over that of its children, or less

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
  /// Adds work to a level, or leaves the pair.
  void push(int level, const DistanceItem& item, bool is_smallest) {
    if (is_smallest || count_[level - 1] == kMostDistanceItems || packets_left_ <= 0)
      return least_.leave(position_of(item), item.lower);
    DistanceItem* const items = items_of(level);
    const std::uint32_t i = count_[level - 1]++;
    items[i] = item;
    if (i > 0 && !(item.lower < items[nearest_[level - 1]].lower)) return;
    nearest_[level - 1] = i;
    prefetch(item, level);
  }
  DistanceItem* items_of(int level) const { return room_.items + (level - 1) * static_cast<int>(kMostDistanceItems); }
  /// Lets the balls of an item arrive from memory.
  void prefetch(const DistanceItem& item, int level) const {
    if (level == 1) return;
    const auto arrive = [](const BallPacket& packet) {
      for (std::size_t byte = 0; byte < sizeof packet; byte += 64)
        __builtin_prefetch(reinterpret_cast<const char*>(&packet) + byte);
    };
    if (item.obstacle != kNone) return arrive(v_.bodies[item.at].packets[item.a]);
    const MovedPair& pair = v_.moved_pairs[item.at];
    arrive(v_.bodies[pair.a].packets[item.a]);
    arrive(v_.bodies[pair.b].packets[item.b]);
  }
  /// The balls of a level, the nearest first.
  void search(int level) {
    DistanceItem* const items = items_of(level);
    const std::uint32_t count = count_[level - 1];
    if (count == 0) return;
    const bool is_decided = least_.width() <= 0 && is_one_pair(items, count);
    std::swap(items[0], items[nearest_[level - 1]]);
    for (std::uint32_t i = 0; i < count && !least_.is_over(); ++i) {
      const DistanceItem item = items[i];
      if (i + 1 < count) prefetch(items[i + 1], level);
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
      return packets_against_obstacle<Eight>(item, body.packets + item.a, &c, position, level);
    }
    if (body.root_packets == 0) return least_.leave(position, item.lower);
    const Centres* c = placed_.children_of_root<false>(item.at);
    if (body.root_packets == 2 && !takes_long(v_.obstacles[item.obstacle]))
      return packets_against_obstacle<Sixteen>(item, body.packets, c, position, level);
    for (std::uint32_t p = 0; p < body.root_packets; ++p)
      packets_against_obstacle<Eight>(item, body.packets + p, c + p, position, level);
  }
  /// Bounds on the gaps of balls from an obstacle that takes long.
  HWY_INLINE void find_gaps(const Obstacle& obstacle, const Centres& c, const Eight& outer, Eight& low,
                            Eight& high) const {
    PointGaps gaps;
    obstacle_gaps(obstacle, c.x, c.y, c.z, least_.gap_limits(outer), gaps);
    low = Eight::load(gaps.low), high = Eight::load(gaps.high);
  }
  void find_gaps(const Obstacle&, const Centres&, const Sixteen&, Sixteen&, Sixteen&) const {}  // not for two packets
  /// Compares balls with an obstacle.
  /// \tparam F numbers of one or two packets of balls
  template <class F>
  HWY_INLINE void packets_against_obstacle(const DistanceItem& item, const BallPacket* packets, const Centres* c,
                                           std::uint64_t position, int level) {
    constexpr std::uint32_t kPackets = F::kNumbers / kBalls;
    packets_left_ -= static_cast<int>(kPackets);
    const Obstacle& obstacle = v_.obstacles[item.obstacle];
    const std::size_t cell = std::size_t{item.obstacle} * v_.columns + item.at;
    const auto of_balls = [&](const float* from) { return F::load_blocks(from, sizeof(BallPacket) / sizeof(float)); };
    const auto of_centres = [&](const float* from) { return F::load_blocks(from, sizeof(Centres) / sizeof(float)); };
    const F outer = of_balls(packets->outer) + F(v_.grow[cell]), inner = of_balls(packets->inner) + F(v_.shrink[cell]);
    F low, high;
    if (takes_long(obstacle))
      find_gaps(obstacle, *c, outer, low, high);
    else
      low = high = gaps_in_lanes(obstacle, of_centres(c->x), of_centres(c->y), of_centres(c->z));
    const auto same = [&](int) { return position; };
    least_.take_upper(high - inner, same);
    alignas(64) float lower[F::kNumbers];
    Bits open = least_.sift(low - outer, lower, same);
    for (; open; open &= open - 1) {
      const int at = lowest(open), i = at % kBalls;
      const BallPacket& packet = packets[at / kBalls];
      push(level + 1, {lower[at], item.obstacle, item.at, packet.children[i], 0},
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
      const Bits open = least_.sift(d - outer, lower, [&](int) { return position; });
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
    const auto same = [&](int) { return position; };
    alignas(32) float lower[kBalls];
    for (Bits of_b = of.open; of_b; of_b &= of_b - 1) {
      const int j = lowest(of_b);
      --packets_left_;
      const Eight d = distances(centres, of.cb.x[j], of.cb.y[j], of.cb.z[j]);
      least_.take_upper(d - (inner + Eight(of.b.inner[j])), same);
      for (Bits open = least_.sift(d - (outer + Eight(of.b.outer[j])), lower, same); open; open &= open - 1) {
        const int i = lowest(open);
        push(level + 1, {lower[i], kNone, item.at, of.a.children[i], of.b.children[j]},
             of.a.children[i] == kNone || of.b.children[j] == kNone ||
                 !is_worth_children(level, stand_out(of.a, i) + stand_out(of.b, j), true));
      }
    }
  }

  std::uint32_t count_[kLevels] = {}, nearest_[kLevels];  // of the items of each level; which is nearest
  int packets_ = 0, packets_left_ = 0;                    // of the group
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
