// Balls of two bodies with covers against each other, for the kernel of decisions (decide_kernel.h).
#pragma once

#include <cstdint>

#include "engine/decision/kernel/placed_balls.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// Results of a pair. kNear: SpanItem::is_near.
constexpr Bits kOpen = 1, kHit = 2, kNear = 4;

/// Decides pairs of moved bodies in one state, or in a span of a motion if `kMoves`.
template <bool kMoves>
class BallPairs {
 public:
  BallPairs(const DecisionView& view, PlacedBalls& placed) : v_(view), placed_(placed) {}

  /// Decides a pair by its covers' balls.
  /// \param index of a moved pair
  /// \param spans null for states
  Bits decide(std::uint32_t index, const SpanBatch* spans, std::size_t span) {
    const MovedPair& pair = v_.moved_pairs[index];
    const DecidedBody &a = v_.bodies[pair.a], &b = v_.bodies[pair.b];
    if (a.root_packets == 0 || b.root_packets == 0) return kOpen;
    if constexpr (kMoves) pair_span_ = spans->pair(spans->context, span, index);
    const float way = kMoves ? pair_span_.way : 0;
    shrink_ = kMoves ? grown_shrink(pair.shrink, pair_span_.grown) : pair.shrink;
    const Centres *ca = placed_.template children_of_root<kMoves>(pair.a),
                  *cb = placed_.template children_of_root<kMoves>(pair.b);
    Bits near_a[2] = {0, 0}, near_b[2] = {0, 0}, any_a = 0, any_b = 0;
    for (std::uint32_t p = 0; p < a.root_packets; ++p)
      any_a |= near_a[p] = placed_.near_root(a.packets[p], ca[p], pair.b, pair.grow + way);
    for (std::uint32_t p = 0; p < b.root_packets && any_a; ++p)
      any_b |= near_b[p] = placed_.near_root(b.packets[p], cb[p], pair.a, pair.grow + way);
    if (!any_b) return 0;
    packets_left_ = kMoves && spans->is_left[index] ? 0 : kMostPacketPairs;
    Bits result = 0;
    for (std::uint32_t p = 0; p < a.root_packets; ++p)
      for (std::uint32_t q = 0; q < b.root_packets; ++q) {
        if (!near_a[p] || !near_b[q]) continue;
        result |= packets(pair, a.packets[p], ca[p], near_a[p], b.packets[q], cb[q], near_b[q]);
        if (result & kHit) return kHit;
      }
    return result;
  }

 private:
  static constexpr int kMostPacketPairs = kMoves ? 24 : 64;

  /// Balls of two bodies against each other, those of the masks alone.
  Bits packets(const MovedPair& pair, const BallPacket& p, const Centres& cp, Bits of_p, const BallPacket& q,
               const Centres& cq, Bits of_q) {
    const EightPoints centres_q = cq.points();
    const Eight outer_q = Eight::load(q.outer) + Eight(pair.grow), inner_q = Eight::load(q.inner) + Eight(shrink_);
    Centres move_p, move_q;  // `way` is their length
    if constexpr (kMoves) {
      placed_.displace(cp.points(), pair.a, pair_span_.a, move_p);
      placed_.displace(centres_q, pair.b, pair_span_.b, move_q);
    }
    Bits result = 0;
    for (; of_p; of_p &= of_p - 1) {
      const int i = lowest(of_p);
      const Eight d = distances(centres_q, cp.x[i], cp.y[i], cp.z[i]);
      if (greater(inner_q + Eight(p.inner[i]), d) & first(q.count)) return kHit;
      const Eight still = outer_q + Eight(p.outer[i]);
      Bits open = of_q;
      if constexpr (kMoves)
        open &= ~beyond_in_span(centres_q, cp, move_q, move_p, i, d, still);
      else
        open &= ~greater(d, still);
      if (open) result |= children(pair, {&p, &cp, Bits{1} << i}, {&q, &cq, open}, kMoves ? ~greater(d, still) : 0);
      if (result & kHit) return kHit;
    }
    return result;
  }
  /// Balls of q that stay beyond a ball of p in a span. Their distance changes by their movement along the line between
  /// them, and by the bend.
  HWY_INLINE Bits beyond_in_span(const EightPoints& centres_q, const Centres& cp, const Centres& move_q,
                                 const Centres& move_p, int i, const Eight& d, const Eight& still) const {
    const Eight ways = Eight::load(move_q.way) + Eight(move_p.way[i]), bent = still + Eight(pair_span_.bend);
    const Bits beyond = greater(d, lesser(bent + ways, still + Eight(pair_span_.way)));
    if (beyond == 0xff) return beyond;
    const EightPoints apart = centres_q - EightPoints{Eight(cp.x[i]), Eight(cp.y[i]), Eight(cp.z[i])},
                      move = move_q.points() - EightPoints{Eight(move_p.x[i]), Eight(move_p.y[i]), Eight(move_p.z[i])};
    const Eight spare = d - (bent + Eight(0x1p-19f) * ways);
    return beyond | greater(d * spare, magnitude(apart.x * move.x + apart.y * move.y + apart.z * move.z));
  }
  /// Some balls of a packet.
  struct Balls {
    const BallPacket* packet;
    const Centres* centres;
    Bits of;
  };
  /// The children of a ball of p against those of some balls of q. A ball without children takes their place.
  /// \param near those that are open even without movement
  Bits children(const MovedPair& pair, Balls p, const Balls& q, Bits near) {
    Centres c_p, c_q;
    if (is_too_fast(*p.packet, lowest(p.of))) return kOpen;
    const bool divides_p = divide(p, pair.a, c_p);
    Bits result = 0;
    for (Bits open = q.of; open; open &= open - 1) {
      const int j = lowest(open);
      if (!divides_p && is_too_fast(*q.packet, j)) {
        result |= kOpen;
        continue;
      }
      Balls one{q.packet, q.centres, Bits{1} << j};
      if ((!divide(one, pair.b, c_q) && !divides_p) || --packets_left_ < 0) {
        result |= near >> j & 1 ? kOpen | kNear : kOpen;
        continue;
      }
      result |= packets(pair, *p.packet, *p.centres, p.of, *one.packet, *one.centres, one.of);
      if (result & kHit) return kHit;
    }
    return result;
  }
  /// Replaces a ball by its children. Returns false for one without.
  bool divide(Balls& ball, std::uint32_t body, Centres& below) const {
    const std::uint32_t child = ball.packet->children[lowest(ball.of)];
    if (child == kNone) return false;
    const BallPacket& packet = v_.bodies[body].packets[child];
    placed_.template centres<false>(packet, body, below);
    ball = {&packet, &below, first(packet.count)};
    return true;
  }
  /// Whether a ball has children, and the movement exceeds its stand-out by far, so that a shorter span helps more.
  bool is_too_fast(const BallPacket& packet, int i) const {
    return kMoves && packet.children[i] != kNone && pair_span_.way > 4 * stand_out(packet, i);
  }

  const DecisionView& v_;
  PlacedBalls& placed_;
  PairSpan pair_span_{};
  float shrink_ = 0;  // of the pair, with its growth
  int packets_left_ = 0;
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
