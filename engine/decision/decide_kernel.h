// Decisions about states by covers, compiled once for each instruction set (decide_avx512.cpp and similar).
//
// Lanes are balls of one body against one obstacle or ball, so that one state costs as much as its share of many. All
// versions do the same operations on each ball, and give the same results (docs/bounds_covers.md, "Decisions").
#pragma once

#include <hwy/highway.h>

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "engine/cover/point_gaps.h"
#include "engine/decision/decision_view.h"

#ifndef CLEARANCE_ISA
#error "define CLEARANCE_ISA, the instruction set this file is compiled for"
#endif

namespace clearance {
namespace CLEARANCE_ISA {

namespace hn = hwy::HWY_NAMESPACE;

using Bits = std::uint32_t;
constexpr int kBalls = BallPacket::kBalls;

/// Bit i: whether a[i] > b[i].
HWY_INLINE Bits greater(const float* a, const float* b) {
  const hn::CappedTag<float, kBalls> d;
  constexpr int kLanes = static_cast<int>(HWY_LANES(float)) < kBalls ? static_cast<int>(HWY_LANES(float)) : kBalls;
  Bits bits = 0;
  for (int i = 0; i < kBalls; i += kLanes) {
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, hn::Gt(hn::LoadU(d, a + i), hn::LoadU(d, b + i)), bytes);
    bits |= static_cast<Bits>(bytes[0]) << i;
  }
  return bits;
}
/// The same for the sums a[i] + add.
HWY_INLINE void sum(const float* a, float add, float* out) {
  for (int i = 0; i < kBalls; ++i) out[i] = a[i] + add;
}
HWY_INLINE Bits first(std::uint32_t count) {
  return (Bits{1} << count) - 1;
}
HWY_INLINE int lowest(Bits bits) {
  return __builtin_ctz(bits);
}

/// Centres of a packet's balls in the common frame.
struct Centres {
  alignas(32) float x[kBalls], y[kBalls], z[kBalls];
};
/// A body's pose in the common frame, in float32.
struct Placed {
  float R[9], t[3];
};
struct Frame64 {
  double R[9], t[3];
};

/// R and t of a unit quaternion's pose.
HWY_INLINE Frame64 frame_of(const Pose& X) {
  const double w = X.qw, x = X.qx, y = X.qy, z = X.qz;
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),      //
           2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),      //
           2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
          {X.translation.x, X.translation.y, X.translation.z}};
}
HWY_INLINE Frame64 product(const Frame64& a, const Frame64& b) {
  Frame64 c;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      c.R[3 * i + j] = a.R[3 * i] * b.R[j] + a.R[3 * i + 1] * b.R[3 + j] + a.R[3 * i + 2] * b.R[6 + j];
    c.t[i] = a.t[i] + (a.R[3 * i] * b.t[0] + a.R[3 * i + 1] * b.t[1] + a.R[3 * i + 2] * b.t[2]);
  }
  return c;
}

/// Decides states one after another.
class Decider {
 public:
  Decider(const DecisionView& view, bool any_hit) : v_(view), any_hit_(any_hit) {}

  /// \param open receives at most `capacity` positions
  Decision decide(const Pose* poses, std::uint64_t* open, std::uint32_t capacity) {
    open_ = open;
    capacity_ = capacity;
    Decision result;
    if (!place(poses)) return result;
    hit_ = kNoHit;
    count_ = 0;
    overflow_ = false;
    decide_obstacles();
    if (!(any_hit_ && hit_ != kNoHit)) decide_moved_pairs();
    if (overflow_) return result;
    result.is_listed = true;
    result.hit = hit_;
    result.open_end = keep_before_hit();
    result.verdict = hit_ != kNoHit ? Verdict::kHit : count_ == 0 ? Verdict::kFree : Verdict::kUnresolved;
    return result;
  }

 private:
  static constexpr std::uint64_t kNoHit = ~std::uint64_t{0};
  static constexpr Bits kOpen = 1, kHit = 2;
  static constexpr int kMostPackets = 160;  // of one body against one obstacle
  static constexpr int kMostSelf = 64;      // pairs of packets of two moved bodies

  bool place(const Pose* poses) {
    for (std::uint32_t b = 0; b < v_.body_count; ++b) {
      const DecidedBody& body = v_.bodies[b];
      Frame64 f = frame_of(body.pose == kNone ? body.constant : poses[body.pose]);
      if (!body.is_direct) {
        if (body.pose != kNone && body.carrier == kNone) f = product(frame_of(body.constant), f);
        if (body.carrier != kNone) f = product(frames_[body.carrier], f);
      }
      frames_[b] = f;
      double far = 0;
      for (int k = 0; k < 3; ++k) far = far > std::fabs(f.t[k]) ? far : std::fabs(f.t[k]);
      if (!(far <= body.farthest) || f.R[0] != f.R[0]) return false;
      for (int k = 0; k < 9; ++k) placed_[b].R[k] = static_cast<float>(f.R[k]);
      for (int k = 0; k < 3; ++k) placed_[b].t[k] = static_cast<float>(f.t[k]);
      const float *R = placed_[b].R, *t = placed_[b].t, x = v_.root_x[b], y = v_.root_y[b], z = v_.root_z[b];
      root_x_[b] = t[0] + (R[0] * x + R[1] * y + R[2] * z);
      root_y_[b] = t[1] + (R[3] * x + R[4] * y + R[5] * z);
      root_z_[b] = t[2] + (R[6] * x + R[7] * y + R[8] * z);
      has_children_[b] = false;
    }
    for (std::uint32_t b = v_.body_count; b < v_.columns; ++b) root_x_[b] = root_y_[b] = root_z_[b] = 0;
    return true;
  }

  HWY_INLINE void centres(const BallPacket& packet, std::uint32_t body, Centres& c) const {
    const float *R = placed_[body].R, *t = placed_[body].t;
    for (int i = 0; i < kBalls; ++i) {
      c.x[i] = t[0] + (R[0] * packet.x[i] + R[1] * packet.y[i] + R[2] * packet.z[i]);
      c.y[i] = t[1] + (R[3] * packet.x[i] + R[4] * packet.y[i] + R[5] * packet.z[i]);
      c.z[i] = t[2] + (R[6] * packet.x[i] + R[7] * packet.y[i] + R[8] * packet.z[i]);
    }
  }
  /// The centres of the root's children, computed once for a state.
  const Centres* children_of_root(std::uint32_t body) {
    if (!has_children_[body])
      for (std::uint32_t p = 0; p < v_.bodies[body].root_packets; ++p)
        centres(v_.bodies[body].packets[p], body, children_[body][p]);
    has_children_[body] = true;
    return children_[body];
  }

  /// Notes what a pair came to.
  void note(std::uint64_t position, Bits result) {
    if (result & kHit) hit_ = position < hit_ ? position : hit_;
    if (result != kOpen) return;
    if (count_ == capacity_)
      overflow_ = true;
    else
      open_[count_++] = position;
  }
  bool is_over() const { return overflow_ || (any_hit_ && hit_ != kNoHit); }

  std::uint32_t keep_before_hit() {
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < count_; ++i)
      if (open_[i] < hit_) open_[kept++] = open_[i];
    return kept;
  }

  void decide_obstacles() {
    for (std::uint32_t o = 0; o < v_.obstacle_count; ++o)
      for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) {
        const std::size_t at = std::size_t{o} * v_.columns + begin;
        point_gaps(v_.obstacles[o], reinterpret_cast<const float(&)[kBalls]>(root_x_[begin]),
                   reinterpret_cast<const float(&)[kBalls]>(root_y_[begin]),
                   reinterpret_cast<const float(&)[kBalls]>(root_z_[begin]), gaps_);
        for (Bits in = greater(v_.root_inner + at, gaps_.high); in; in &= in - 1)
          note(v_.position[at + static_cast<std::size_t>(lowest(in))], kHit);
        for (Bits open = ~greater(gaps_.low, v_.root_outer + at) & 0xff; open; open &= open - 1) {
          if (is_over()) return;
          const std::uint32_t i = static_cast<std::uint32_t>(lowest(open));
          if (v_.position[at + i] > hit_) continue;
          note(v_.position[at + i], against_obstacle(begin + i, v_.obstacles[o], v_.grow[at + i], v_.shrink[at + i]));
        }
      }
  }

  Bits against_obstacle(std::uint32_t body, const Obstacle& obstacle, float grow, float shrink) {
    const DecidedBody& b = v_.bodies[body];
    if (b.root_packets == 0) return kOpen;
    const Centres* c = children_of_root(body);
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
    PointGaps gaps;
    alignas(32) float bound[kBalls];
    point_gaps(obstacle, c.x, c.y, c.z, gaps);
    sum(packet.inner, shrink, bound);
    if (greater(bound, gaps.high) & first(packet.count)) return kHit;
    sum(packet.outer, grow, bound);
    Bits result = 0;
    for (Bits open = ~greater(gaps.low, bound) & first(packet.count); open; open &= open - 1) {
      const std::uint32_t child = packet.children[lowest(open)];
      if (child == kNone || --packets_left_ < 0) {
        result |= kOpen;
        continue;
      }
      const BallPacket& next = v_.bodies[body].packets[child];
      Centres below;
      centres(next, body, below);
      result |= packet_against_obstacle(body, next, below, obstacle, grow, shrink);
      if (result & kHit) return kHit;
    }
    return result;
  }

  void decide_moved_pairs() {
    for (std::uint32_t k = 0; k < v_.moved_pair_count; ++k) {
      const MovedPair& pair = v_.moved_pairs[k];
      const float dx = root_x_[pair.a] - root_x_[pair.b], dy = root_y_[pair.a] - root_y_[pair.b],
                  dz = root_z_[pair.a] - root_z_[pair.b], d = std::sqrt(dx * dx + dy * dy + dz * dz);
      if (d > v_.moved_root_outer[pair.a] + v_.moved_root_outer[pair.b] + pair.grow) continue;
      if (is_over()) return;
      if (pair.position > hit_) continue;
      const bool in = d < v_.moved_root_inner[pair.a] + v_.moved_root_inner[pair.b] + pair.shrink;
      note(pair.position, in ? kHit : moved_pair(pair));
    }
  }

  /// Balls of a packet of `body` that are near the root of another body.
  HWY_INLINE Bits near_root(const BallPacket& packet, const Centres& c, std::uint32_t other, float grow) const {
    alignas(32) float d[kBalls], bound[kBalls];
    distances(c, root_x_[other], root_y_[other], root_z_[other], d);
    sum(packet.outer, v_.moved_root_outer[other] + grow, bound);
    return ~greater(d, bound) & first(packet.count);
  }
  HWY_INLINE static void distances(const Centres& c, float x, float y, float z, float* d) {
    for (int i = 0; i < kBalls; ++i) {
      const float dx = c.x[i] - x, dy = c.y[i] - y, dz = c.z[i] - z;
      d[i] = std::sqrt(dx * dx + dy * dy + dz * dz);
    }
  }

  Bits moved_pair(const MovedPair& pair) {
    const DecidedBody &a = v_.bodies[pair.a], &b = v_.bodies[pair.b];
    if (a.root_packets == 0 || b.root_packets == 0) return kOpen;
    const Centres *ca = children_of_root(pair.a), *cb = children_of_root(pair.b);
    Bits near_a[2] = {0, 0}, near_b[2] = {0, 0}, any_a = 0, any_b = 0;
    for (std::uint32_t p = 0; p < a.root_packets; ++p)
      any_a |= near_a[p] = near_root(a.packets[p], ca[p], pair.b, pair.grow);
    for (std::uint32_t p = 0; p < b.root_packets && any_a; ++p)
      any_b |= near_b[p] = near_root(b.packets[p], cb[p], pair.a, pair.grow);
    if (!any_b) return 0;
    packets_left_ = kMostSelf;
    Bits result = 0;
    for (std::uint32_t p = 0; p < a.root_packets; ++p)
      for (std::uint32_t q = 0; q < b.root_packets; ++q) {
        if (!near_a[p] || !near_b[q]) continue;
        result |= packets(pair, a.packets[p], ca[p], near_a[p], b.packets[q], cb[q], near_b[q]);
        if (result & kHit) return kHit;
      }
    return result;
  }

  /// Balls of two bodies against each other, those of the masks alone.
  Bits packets(const MovedPair& pair, const BallPacket& p, const Centres& cp, Bits of_p, const BallPacket& q,
               const Centres& cq, Bits of_q) {
    Bits result = 0;
    for (; of_p; of_p &= of_p - 1) {
      const int i = lowest(of_p);
      alignas(32) float d[kBalls], bound[kBalls];
      distances(cq, cp.x[i], cp.y[i], cp.z[i], d);
      sum(q.inner, p.inner[i] + pair.shrink, bound);
      if (greater(bound, d) & first(q.count)) return kHit;
      sum(q.outer, p.outer[i] + pair.grow, bound);
      Bits open = ~greater(d, bound) & of_q;
      if (!open) continue;
      if (p.children[i] == kNone) {
        result |= kOpen;
        continue;
      }
      const BallPacket& below_p = v_.bodies[pair.a].packets[p.children[i]];
      Centres c_p, c_q;
      centres(below_p, pair.a, c_p);
      for (; open; open &= open - 1) {
        const std::uint32_t child = q.children[lowest(open)];
        if (child == kNone || --packets_left_ < 0) {
          result |= kOpen;
          continue;
        }
        const BallPacket& below_q = v_.bodies[pair.b].packets[child];
        centres(below_q, pair.b, c_q);
        result |= packets(pair, below_p, c_p, first(below_p.count), below_q, c_q, first(below_q.count));
        if (result & kHit) return kHit;
      }
    }
    return result;
  }

  const DecisionView& v_;
  const bool any_hit_;
  std::uint64_t hit_ = kNoHit;
  std::uint64_t* open_ = nullptr;
  std::uint32_t capacity_ = 0, count_ = 0;
  bool overflow_ = false;
  int packets_left_ = 0;
  PointGaps gaps_;
  Frame64 frames_[kMostDecidedBodies];
  Placed placed_[kMostDecidedBodies];
  alignas(32) float root_x_[kMostDecidedBodies], root_y_[kMostDecidedBodies], root_z_[kMostDecidedBodies];
  bool has_children_[kMostDecidedBodies];
  Centres children_[kMostDecidedBodies][2];
};

inline void decide(const DecisionBatch& batch, const DecisionRoom& room) {
  Decider decider(*batch.view, batch.any_hit);
  std::uint32_t used = 0;
  for (std::size_t k = 0; k < batch.states; ++k) {
    Decision& decision = room.decisions[k];
    decision = {};
    if (batch.usable[k]) decision = decider.decide(batch.poses + k * batch.stride, room.open + used, room.capacity - used);
    decision.open_begin = used;
    decision.open_end += used;
    used = decision.open_end;
  }
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
