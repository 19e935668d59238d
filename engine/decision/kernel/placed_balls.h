// Balls of covers, placed in a query's common frame, for the kernel of decisions (decide_kernel.h).
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/decision/kernel/ball_frames.h"
#include "engine/decision/kernel/placed_roots.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// `shrink` (DecisionView) of a pair whose bodies are grown, rounded down by more than the sums with it round.
/// \param grown lower bound on the sum of their growths, metres
HWY_INLINE float grown_shrink(float shrink, float grown) {
  if (grown <= 0) return shrink;
  return shrink + grown - 0x1p-21f * (__builtin_fabsf(shrink) + grown);
}

/// The bodies of a query in one state.
class PlacedBalls : public PlacedRoots {
 public:
  explicit PlacedBalls(const DecisionView& view) : PlacedRoots(view) {
    for (std::uint32_t b = 0; b < v_.columns; ++b) {
      if (b < v_.body_count && v_.bodies[b].is_direct) continue;
      q_[0][b] = 1;
      for (int k = 1; k < 4; ++k) q_[k][b] = 0;
      for (int k = 9; k < 12; ++k) own_[k][b] = 0;
      root_.way[b] = 0;
    }
  }

  /// Places bodies that are direct in up to eight states, of which take_state() selects one.
  /// \param frames DecisionBatch::frames
  /// \return the states whose poses are within the limits of the bounds
  Bits place(const double* const* frames, std::size_t states) {
    return place_in_lanes<false>(frames, states, [](auto&&...) {});
  }
  /// The same in the middles of spans, of which take_span() selects one.
  Bits place(const SpanBatch& spans) {
    spans_in_lanes_ = spans.bodies;
    return place_in_lanes<true>(
        spans.frames, spans.count, [&](std::uint32_t b, const BodyInStates& body, Centres& root) {
          BodyInSpans(spans.twists[b], spans.half, of_spans_[b]).move(body, spans.bodies[b], root);
        });
  }
  void take_state(std::size_t k) {
    frames_ = &of_states_[0][0][k], by_part_ = kBalls, by_body_ = 12 * kBalls;
    for (std::uint32_t begin = 0; begin < v_.columns; begin += kColumns) {
      Sixteen::load(roots_[k].x + begin).store(root_.x + begin);
      Sixteen::load(roots_[k].y + begin).store(root_.y + begin);
      Sixteen::load(roots_[k].z + begin).store(root_.z + begin);
    }
    forget();
  }
  void take_span(std::size_t k) {
    take_state(k);
    for (std::uint32_t begin = 0; begin < v_.columns; begin += kColumns)
      Sixteen::load(roots_[k].way + begin).store(root_.way + begin);
    spans_ = nullptr;
    number_ = k;
  }
  /// Returns false for a pose beyond the limits of the bounds.
  bool place(const Pose* poses) {
    frames_ = own_[0], by_part_ = kMostDecidedBodies, by_body_ = 1;
    bool all_direct = true;
    for (std::uint32_t b = 0; b < v_.body_count; ++b) {
      const DecidedBody& body = v_.bodies[b];
      all_direct &= body.is_direct;
      if (!body.is_direct) continue;
      const Pose& X = poses[body.pose];
      if (!is_near(X.translation.x, X.translation.y, X.translation.z, body.farthest)) return false;
      const double parts[7] = {X.qw, X.qx, X.qy, X.qz, X.translation.x, X.translation.y, X.translation.z};
      for (int k = 0; k < 4; ++k) q_[k][b] = static_cast<float>(parts[k]);
      for (int k = 0; k < 3; ++k) own_[9 + k][b] = static_cast<float>(parts[4 + k]);
    }
    for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) rotate(begin);
    if (!all_direct && !place_carried(poses)) return false;
    for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) place_roots(begin);
    forget();
    return true;
  }
  /// Takes the bodies of one span, after place() of its poses.
  /// \param spans (columns,)
  void take_bodies(const SpanBody* spans) {
    spans_ = spans;
    for (std::uint32_t b = 0; b < v_.body_count; ++b) {
      const Vec3<float> by =
          displaced(spans[b].twist.turn, spans[b].twist.shift,
                    Vec3<float>{root_.x[b] - part(9, b), root_.y[b] - part(10, b), root_.z[b] - part(11, b)});
      const float along = __builtin_sqrtf(by.x * by.x + by.y * by.y + by.z * by.z) + spans[b].bend;
      root_.way[b] = along < spans[b].way ? along : spans[b].way;
    }
  }

  /// SpanBody::grown. Bodies in lanes do not grow.
  HWY_INLINE float grown(std::uint32_t body) const { return spans_ ? spans_[body].grown : 0; }
  template <bool kMoves>
  HWY_INLINE void centres(const BallPacket& packet, std::uint32_t body, Centres& c) const {
    const Eight x = Eight::load(packet.x), y = Eight::load(packet.y), z = Eight::load(packet.z);
    const float* const f = frame(body);
    const auto coordinate = [&](int k) {
      return Eight(f[9 + k]) + (Eight(f[3 * k]) * x + Eight(f[3 * k + 1]) * y + Eight(f[3 * k + 2]) * z);
    };
    const EightPoints points{coordinate(0), coordinate(1), coordinate(2)};
    points.x.store(c.x);
    points.y.store(c.y);
    points.z.store(c.z);
    if constexpr (kMoves) {
      const SpanBody& span = span_of(body);
      lesser(length(displacement(points, body, span.twist)) + Eight(span.bend), Eight(span.way)).store(c.way);
    }
  }
  /// shift + turn x r of each ball, r from its body's origin.
  HWY_INLINE EightPoints displacement(const EightPoints& c, std::uint32_t body, const SpanTwist& twist) const {
    const float *w = twist.turn, *v = twist.shift, *f = frame(body);
    const Eight turn[3] = {Eight(w[0]), Eight(w[1]), Eight(w[2])}, shift[3] = {Eight(v[0]), Eight(v[1]), Eight(v[2])};
    return displaced(turn, shift, c - EightPoints{Eight(f[9]), Eight(f[10]), Eight(f[11])});
  }
  /// The same, with its length as `way`.
  HWY_INLINE void displace(const EightPoints& c, std::uint32_t body, const SpanTwist& twist, Centres& to) const {
    const EightPoints d = displacement(c, body, twist);
    d.x.store(to.x);
    d.y.store(to.y);
    d.z.store(to.z);
    length(d).store(to.way);
  }
  /// How much nearer to a convex obstacle the balls come within half a span, from their gaps at the ends of their way.
  /// \param low of their gaps in the middle
  HWY_INLINE Eight approach(const Obstacle& obstacle, const Centres& centres, std::uint32_t body,
                            const Eight& low) const {
    const EightPoints c = centres.points(), d = displacement(c, body, span_of(body).twist);
    const auto highest = [&](const EightPoints& at) {
      alignas(32) float x[kBalls], y[kBalls], z[kBalls];
      at.x.store(x);
      at.y.store(y);
      at.z.store(z);
      PointGaps gaps;
      point_gaps(obstacle, x, y, z, gaps);
      return Eight::load(gaps.high);
    };
    const Eight rise = larger(highest({c.x + d.x, c.y + d.y, c.z + d.z}), highest(c - d)) - low;
    const Eight rounding = Eight(4 * obstacle.error) + Eight(0x1p-19f) * length(d);
    return larger(rise, Eight(0.0f)) + Eight(span_of(body).bend) + rounding;
  }
  /// The children of a body's root, computed once for a state.
  template <bool kMoves>
  const Centres* children_of_root(std::uint32_t body) {
    if (!(has_children_ >> body & 1))
      for (std::uint32_t p = 0; p < v_.bodies[body].root_packets; ++p)
        centres<kMoves>(v_.bodies[body].packets[p], body, children_[body][p]);
    has_children_ |= std::uint64_t{1} << body;
    return children_[body];
  }
  HWY_INLINE Eight distances_to_root(const Centres& c, std::uint32_t other) const {
    return distances(c.points(), root_.x[other], root_.y[other], root_.z[other]);
  }
  /// Balls that are near the root of another body.
  HWY_INLINE Bits near_root(const BallPacket& packet, const Centres& c, std::uint32_t other, float grow) const {
    const Eight bound = Eight::load(packet.outer) + Eight(v_.moved_root_outer[other] + grow);
    return ~greater(distances_to_root(c, other), bound) & first(packet.count);
  }

 private:
  HWY_INLINE float part(std::size_t k, std::uint32_t body) const { return frames_[k * by_part_ + body * by_body_]; }
  /// R row by row, then t.
  HWY_INLINE const float* frame(std::uint32_t body) const {
    if (!(has_frame_ >> body & 1))
      for (std::size_t k = 0; k < 12; ++k) frame_[body][k] = part(k, body);
    has_frame_ |= std::uint64_t{1} << body;
    return frame_[body];
  }
  HWY_INLINE const SpanBody& span_of(std::uint32_t body) const {
    if (spans_) return spans_[body];
    if (!(has_span_ >> body & 1)) {
      const auto part = [&](int i) { return of_spans_[body][i][number_]; };
      span_[body] = {{{part(0), part(1), part(2)}, {part(3), part(4), part(5)}},
                     spans_in_lanes_[body].way,
                     spans_in_lanes_[body].bend};
    }
    has_span_ |= std::uint64_t{1} << body;
    return span_[body];
  }
  void forget() { has_children_ = has_frame_ = has_span_ = 0; }
  /// \param move called with each body and its root's centres
  template <bool kMoves, class Move>
  HWY_INLINE Bits place_in_lanes(const double* const* frames, std::size_t states, const Move& move) {
    Bits usable = first(static_cast<std::uint32_t>(states));
    for (std::uint32_t b = 0; b < v_.columns; ++b) {
      Centres roots{};
      if (b < v_.body_count) {
        const BodyInStates body(frames[b]);
        usable &= usable_states(v_.bodies[b], frames[b], states);
        body.store(of_states_[b]);
        body.place({v_.root_x[b], v_.root_y[b], v_.root_z[b]}, roots);
        move(b, body, roots);
      }
      for (std::size_t k = 0; k < states; ++k) {
        roots_[k].x[b] = roots.x[k], roots_[k].y[b] = roots.y[k], roots_[k].z[b] = roots.z[k];
        if constexpr (kMoves) roots_[k].way[b] = roots.way[k];
      }
    }
    return usable;
  }
  static bool is_near(double x, double y, double z, double farthest) {
    const auto is_within = [&](double t) { return -farthest <= t && t <= farthest; };
    return is_within(x) && is_within(y) && is_within(z);
  }
  /// Rotations of the quaternions of eight columns.
  HWY_INLINE void rotate(std::uint32_t begin) {
    rotations(Eight::load(q_[0] + begin), Eight::load(q_[1] + begin), Eight::load(q_[2] + begin),
              Eight::load(q_[3] + begin), [&](int k, const Eight& value) { value.store(own_[k] + begin); });
  }
  HWY_INLINE void place_roots(std::uint32_t begin) {
    const Eight x = Eight::load(v_.root_x + begin), y = Eight::load(v_.root_y + begin),
                z = Eight::load(v_.root_z + begin);
    const auto coordinate = [&](int k) {
      return Eight::load(own_[9 + k] + begin) +
             (Eight::load(own_[3 * k] + begin) * x + Eight::load(own_[3 * k + 1] + begin) * y +
              Eight::load(own_[3 * k + 2] + begin) * z);
    };
    coordinate(0).store(root_.x + begin);
    coordinate(1).store(root_.y + begin);
    coordinate(2).store(root_.z + begin);
  }
  /// Bodies that others carry, in float64.
  bool place_carried(const Pose* poses) {
    for (std::uint32_t b = 0; b < v_.body_count; ++b) {
      const DecidedBody& body = v_.bodies[b];
      Frame64 f = frame_of(body.pose == kNone ? body.constant : poses[body.pose]);
      if (!body.is_direct && body.pose != kNone) f = product(frame_of(body.constant), f);
      if (body.carrier != kNone) f = product(exact_[body.carrier], f);
      exact_[b] = f;
      if (body.is_direct) continue;
      if (!is_near(f.t[0], f.t[1], f.t[2], body.farthest)) return false;
      for (int k = 0; k < 9; ++k) own_[k][b] = static_cast<float>(f.R[k]);
      for (int k = 0; k < 3; ++k) own_[9 + k][b] = static_cast<float>(f.t[k]);
    }
    return true;
  }

  const SpanBody* spans_ = nullptr;
  // Parts of the bodies' frames in the state, R row by row and then t.
  const float* frames_ = nullptr;
  std::size_t by_part_ = 0, by_body_ = 0;
  alignas(32) float q_[4][kMostDecidedBodies], own_[12][kMostDecidedBodies];  // of one state
  alignas(32) float of_states_[kMostDecidedBodies][12][kBalls];               // of eight
  Frame64 exact_[kMostDecidedBodies];
  Roots roots_[kBalls];  // of eight states
  const SpanBody* spans_in_lanes_ = nullptr;
  std::size_t number_ = 0;                         // of the span in lanes
  float of_spans_[kMostDecidedBodies][6][kBalls];  // twists within half of each span
  mutable SpanBody span_[kMostDecidedBodies];      // of one of them, once needed
  mutable std::uint64_t has_span_ = 0;             // bit b of body b
  mutable float frame_[kMostDecidedBodies][12];    // side by side, once needed
  mutable std::uint64_t has_frame_ = 0;
  std::uint64_t has_children_ = 0;
  Centres children_[kMostDecidedBodies][2];
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
