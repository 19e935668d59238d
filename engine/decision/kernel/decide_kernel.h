// Decisions about states and spans of motions by covers, compiled once for each instruction set (decide_avx512.cpp and
// similar).
//
// Lanes are balls of one body against one obstacle or ball, so that one state costs as much as its share of many. All
// versions do the same operations on each ball, and give the same results (docs/trust/bounds_covers.md, "Decisions").
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "engine/decision/kernel/ball_pairs.h"
#include "engine/decision/kernel/hit_guess.h"
#include "engine/decision/kernel/placed_balls.h"
#include "engine/decision/kernel/table_lookup.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// Decides states, or spans of motions if `kMoves`, one after another.
template <bool kMoves>
class Decider {
 public:
  explicit Decider(const DecisionView& view) : v_(view), placed_(view), tables_(view) {}

  /// Places bodies for states of a batch with frames.
  void place(const DecisionBatch& batch) {
    for (std::size_t k = 0; k < batch.states && !batch.cells; ++k) tables_.find(k, positions(batch, k));
    usable_ = placed_.place(batch.frames, batch.states);
  }
  /// Decides state k of a batch.
  /// \param open receives at most `capacity` positions
  Decision decide(const DecisionBatch& batch, std::size_t k, std::uint64_t* open, std::uint32_t capacity) {
    Decision result;
    if (!batch.frames) {
      if (!batch.cells) tables_.find(0, positions(batch, k));
      if (!placed_.place(batch.poses + k * batch.stride)) return result;
    } else if (usable_ >> k & 1) {
      placed_.take_state(k);
    } else {
      return result;
    }
    begin(batch.any_hit, capacity);
    open_ = open;
    const TableCell* const* const cells =
        batch.cells ? batch.cells + k * v_.tabled_count : tables_.cells(batch.frames ? k : 0);
    tables_.look_up(cells, [&](std::uint64_t position) { record(position, {}, kHit); });
    if (!is_over()) decide_obstacles();
    if (!is_over()) decide_moved_pairs();
    if (overflow_) return result;
    result.is_listed = true;
    result.hit = hit_;
    result.open_end = keep_before_hit();
    result.verdict = verdict();
    return result;
  }

  void decide_spans(const SpanBatch& batch) {
    span_ = &batch;
    usable_ = batch.frames ? placed_.place(batch) : placed_.place(batch.poses);
    for (number_ = 0; number_ < batch.count; ++number_)
      if (!batch.decided(batch.context, number_, decide_span(batch.spans[number_]))) return;
  }

 private:
  static constexpr std::uint64_t kNoHit = ~std::uint64_t{0};
  static constexpr int kMostPackets = 160;  // of one body against one obstacle

  SpanDecision decide_span(const SpanInput& span) {
    SpanDecision result;
    if (!(usable_ >> number_ & 1)) return result;
    begin(true, static_cast<std::uint32_t>(span_->capacity));
    if (span_->frames)
      placed_.take_span(number_);
    else
      placed_.take_bodies(span_->bodies);
    for (std::size_t i = 0; span.items && i < span.count && !is_over(); ++i) decide_item(span.items[i]);
    if (!span.items) decide_obstacles();
    if (!span.items && !is_over()) decide_moved_pairs();
    if (overflow_) return result;
    result.open = count_;
    result.verdict = verdict();
    if (hit_ != kNoHit) result.hit = ball_hit_;
    return result;
  }
  template <class Batch>
  static const double* positions(const Batch& batch, std::size_t k) {
    return batch.positions ? batch.positions + k * batch.position_stride : nullptr;
  }
  void begin(bool any_hit, std::uint32_t capacity) {
    any_hit_ = any_hit, capacity_ = capacity;
    hit_ = kNoHit, count_ = 0, overflow_ = false, ball_hit_ = {};
  }
  Verdict verdict() const { return hit_ != kNoHit ? Verdict::kHit : count_ ? Verdict::kUnresolved : Verdict::kFree; }
  bool is_over() const { return overflow_ || (any_hit_ && hit_ != kNoHit); }

  /// Records the result of a pair.
  void record(std::uint64_t position, SpanItem item, Bits result) {
    if (result & kHit) hit_ = position < hit_ ? position : hit_;
    if (!(result & kOpen)) return;
    item.is_near = (result & kNear) != 0;
    if (count_ == capacity_)
      overflow_ = true;
    else if constexpr (kMoves)
      span_->open[count_++] = item;
    else
      open_[count_++] = position;
  }
  std::uint32_t keep_before_hit() {
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < count_; ++i)
      if (open_[i] < hit_) open_[kept++] = open_[i];
    return kept;
  }

  void decide_obstacles() {
    for (std::uint32_t n = 0; n < v_.node_count && !is_over();) {
      const ObstacleNode& node = v_.nodes[n];
      const bool is_beyond = placed_.template are_roots_beyond<kMoves>(n);
      for (std::uint32_t o = node.first; !is_beyond && o < node.last && !is_over(); ++o) decide_obstacle(o);
      n = is_beyond ? node.skip : n + 1;
    }
  }
  HWY_INLINE void decide_obstacle(std::uint32_t o) {
    for (std::uint32_t begin = 0; begin < v_.columns; begin += kColumns)
      for (Bits near = placed_.roots_near<kMoves>(o, begin), at = begin; near; near >>= kBalls, at += kBalls)
        if (near & 0xff) decide_roots(o, at);
  }
  void decide_roots(std::uint32_t o, std::uint32_t begin) {
    const std::size_t at = std::size_t{o} * v_.columns + begin;
    const Eight still = Eight::load(v_.root_outer + at), inner = Eight::load(v_.root_inner + at);
    Eight bound = still;
    if constexpr (kMoves) bound = bound + placed_.root_ways(begin);
    PointGaps gaps;
    placed_.root_gaps(v_.obstacles[o], begin, {bound, still, inner}, gaps);
    for (Bits in = greater(inner, Eight::load(gaps.high)); in; in &= in - 1)
      record(v_.position[at + static_cast<std::size_t>(lowest(in))], {}, kHit);
    for (Bits open = ~greater(Eight::load(gaps.low), bound) & 0xff; open; open &= open - 1) {
      if (is_over()) return;
      decide_item({o, begin + static_cast<std::uint32_t>(lowest(open))});
    }
  }
  void decide_item(SpanItem item) {
    if (item.obstacle == kNone) {
      const MovedPair& pair = v_.moved_pairs[item.at];
      return decide_tabled(pair.table, pair.position, item, [&] { return pairs_.decide(item.at, span_, number_); });
    }
    const std::size_t cell = std::size_t{item.obstacle} * v_.columns + item.at;
    if (v_.position[cell] > hit_ || tables_.is_free(v_.table[cell])) return;
    const float shrink = kMoves ? grown_shrink(v_.shrink[cell], placed_.grown(item.at)) : v_.shrink[cell];
    decide_tabled(v_.table[cell], v_.position[cell], item,
                  [&] { return against_obstacle(item.at, v_.obstacles[item.obstacle], v_.grow[cell], shrink); });
  }

  /// Decides a pair in a span by its table, and otherwise by balls.
  template <class ByBalls>
  HWY_INLINE void decide_tabled(std::uint32_t table, std::uint64_t position, SpanItem item, const ByBalls& by_balls) {
    if constexpr (!kMoves) return record(position, item, by_balls());
    const TableLookup::Span span = tables_.in_span(table, positions(*span_, number_), span_->reach);
    if (span.verdict == Verdict::kUnresolved)
      record(position, item, by_balls() & (span.is_middle_free ? ~kNear : ~Bits{0}));
    else if (span.verdict == Verdict::kHit)
      record(position, {}, kHit);
  }
  Bits against_obstacle(std::uint32_t body, const Obstacle& obstacle, float grow, float shrink) {
    const DecidedBody& b = v_.bodies[body];
    if (b.root_packets == 0) return kOpen;
    const Centres* c = placed_.children_of_root<kMoves>(body);
    packets_left_ = kMostPackets;
    Bits result = 0;
    for (std::uint32_t p = 0; p < b.root_packets; ++p) {
      result |= packet_against_obstacle(body, b.packets[p], c[p], obstacle, grow, shrink);
      if (result & kHit) return kHit;
    }
    return result;
  }
  Bits packet_against_obstacle(std::uint32_t body, const BallPacket& packet, const Centres& c, const Obstacle& obstacle,
                               float grow, float shrink) {
    const Bits used = first(packet.count);
    const Eight still = Eight::load(packet.outer) + Eight(grow), inner = Eight::load(packet.inner) + Eight(shrink);
    Eight bound = still;
    if constexpr (kMoves) bound = bound + Eight::load(c.way);
    PointGaps gaps;
    obstacle_gaps(obstacle, c.x, c.y, c.z, {bound, kMoves ? larger(still, inner) : still, inner}, gaps);
    if (const Bits in = greater(inner, Eight::load(gaps.high)) & used) {
      if constexpr (kMoves)
        ball_hit_ = {static_cast<std::uint32_t>(&obstacle - v_.obstacles), body,
                     static_cast<std::uint32_t>(&packet - v_.bodies[body].packets),
                     static_cast<std::uint32_t>(lowest(in))};
      return kHit;
    }
    Bits result = 0, open = ~greater(Eight::load(gaps.low), bound) & used;
    if (kMoves && open && obstacle.kind != Obstacle::Kind::kCloud) {
      const Eight low = Eight::load(gaps.low);
      open &= ~greater(low, still + placed_.approach(obstacle, c, body, low));
    }
    for (; open; open &= open - 1) {
      const int i = lowest(open);
      const std::uint32_t child = packet.children[i];
      // A shorter span helps more than smaller balls where the movement exceeds the stand-out by far.
      if (child == kNone || (kMoves && c.way[i] > 2 * stand_out(packet, i)) || --packets_left_ < 0) {
        result |= kOpen;
        if (kMoves && child == kNone && !(gaps.low[i] > packet.outer[i] + grow)) result |= kNear;
        continue;
      }
      const BallPacket& next = v_.bodies[body].packets[child];
      Centres below;
      placed_.template centres<kMoves>(next, body, below);
      result |= packet_against_obstacle(body, next, below, obstacle, grow, shrink);
      if (result & kHit) return kHit;
    }
    return result;
  }
  void decide_moved_pairs() {
    for (std::uint32_t r = 0; r < v_.moved_row_count; ++r) {
      const MovedRow& row = v_.moved_rows[r];
      for (Bits near = placed_.roots_near<kMoves>(row); near; near &= near - 1) {
        if (is_over()) return;
        const std::uint32_t k = row.pair[lowest(near)];
        if (!tables_.is_free(v_.moved_pairs[k].table)) decide_moved_pair(k);
      }
    }
  }
  void decide_moved_pair(std::uint32_t k) {
    const MovedPair& pair = v_.moved_pairs[k];
    if (pair.position > hit_) return;
    decide_tabled(pair.table, pair.position, {kNone, k}, [&] {
      const float inner = v_.moved_root_inner[pair.a] + v_.moved_root_inner[pair.b] + pair.shrink;
      return placed_.distance_of_roots(pair.a, pair.b) < inner ? kHit : pairs_.decide(k, span_, number_);
    });
  }

  const DecisionView& v_;
  PlacedBalls placed_;
  TableLookup tables_;
  BallPairs<kMoves> pairs_{v_, placed_};
  const SpanBatch* span_ = nullptr;
  std::size_t number_ = 0;  // of the span
  BallHit ball_hit_;
  bool any_hit_ = true, overflow_ = false;
  Bits usable_ = 0;  // states of a batch with frames, or spans
  std::uint64_t hit_ = kNoHit;
  std::uint64_t* open_ = nullptr;
  std::uint32_t capacity_ = 0, count_ = 0;
  int packets_left_ = 0;
};

inline void decide(const DecisionBatch& batch, const DecisionRoom& room) {
  Decider<false> decider(*batch.view);
  if (batch.frames) decider.place(batch);
  std::uint32_t used = 0;
  for (std::size_t k = 0; k < batch.states; ++k) {
    Decision& decision = room.decisions[k];
    decision = {};
    if (batch.usable[k]) decision = decider.decide(batch, k, room.open + used, room.capacity - used);
    decision.open_begin = used;
    decision.open_end += used;
    used = decision.open_end;
  }
}

inline void decide_spans(const SpanBatch& batch) {
  Decider<true>(*batch.view).decide_spans(batch);
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
