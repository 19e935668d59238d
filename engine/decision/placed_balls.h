// Balls of covers, placed in a query's common frame, for the kernel of decisions (decide_kernel.h).
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/cover/point_gaps.h"
#include "engine/decision/decision_view.h"
#include "engine/decision/eight.h"

namespace clearance {
namespace CLEARANCE_ISA {

constexpr int kBalls = BallPacket::kBalls;

HWY_INLINE Bits first(std::uint32_t count) {
  return (Bits{1} << count) - 1;
}
HWY_INLINE int lowest(Bits bits) {
  return __builtin_ctz(bits);
}

/// Balls in the common frame, and how far each can move within half a span.
struct Centres {
  alignas(32) float x[kBalls], y[kBalls], z[kBalls];
  float way[kBalls];  ///< for spans only

  HWY_INLINE EightPoints points() const { return {Eight::load(x), Eight::load(y), Eight::load(z)}; }
};
HWY_INLINE Eight distances(const EightPoints& c, float x, float y, float z) {
  return length(c - EightPoints{Eight(x), Eight(y), Eight(z)});
}

/// A body's pose in the common frame.
struct Frame64 {
  double R[9], t[3];
};
struct Frame32 {
  float R[9], t[3];
};

/// R and t of a unit quaternion's pose.
HWY_INLINE Frame64 frame_of(const Pose& X) {
  const double w = X.qw, x = X.qx, y = X.qy, z = X.qz;
  return {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),  //
           2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),  //
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

/// The bodies of a query in one state.
class PlacedBalls {
 public:
  explicit PlacedBalls(const DecisionView& view) : v_(view) {
    for (std::uint32_t b = v_.body_count; b < v_.columns; ++b) root_.x[b] = root_.y[b] = root_.z[b] = root_.way[b] = 0;
  }

  /// Returns false for a pose beyond what the bounds hold for.
  bool place(const Pose* poses) {
    for (std::uint32_t b = 0; b < v_.body_count; ++b) {
      const DecidedBody& body = v_.bodies[b];
      Frame64 f = frame_of(body.pose == kNone ? body.constant : poses[body.pose]);
      if (!body.is_direct) {
        if (body.pose != kNone) f = product(frame_of(body.constant), f);
        if (body.carrier != kNone) f = product(frames_[body.carrier], f);
      }
      frames_[b] = f;
      const auto is_near = [&](double t) { return -body.farthest <= t && t <= body.farthest; };
      if (!(is_near(f.t[0]) && is_near(f.t[1]) && is_near(f.t[2])) || !(f.R[0] == f.R[0])) return false;
      for (int k = 0; k < 9; ++k) placed_[b].R[k] = static_cast<float>(f.R[k]);
      for (int k = 0; k < 3; ++k) placed_[b].t[k] = static_cast<float>(f.t[k]);
      const float *R = placed_[b].R, *t = placed_[b].t, x = v_.root_x[b], y = v_.root_y[b], z = v_.root_z[b];
      root_.x[b] = t[0] + (R[0] * x + R[1] * y + R[2] * z);
      root_.y[b] = t[1] + (R[3] * x + R[4] * y + R[5] * z);
      root_.z[b] = t[2] + (R[6] * x + R[7] * y + R[8] * z);
      has_children_[b] = false;
    }
    return true;
  }
  /// \param spans (columns,) of the bodies
  void take_spans(const SpanBody* spans) {
    spans_ = spans;
    for (std::uint32_t b = 0; b < v_.body_count; ++b) {
      const float *t = placed_[b].t, *w = spans[b].twist.turn, *v = spans[b].twist.shift;
      const float x = root_.x[b] - t[0], y = root_.y[b] - t[1], z = root_.z[b] - t[2];
      const float u = v[0] + (w[1] * z - w[2] * y), s = v[1] + (w[2] * x - w[0] * z), r = v[2] + (w[0] * y - w[1] * x);
      const float along = __builtin_sqrtf(u * u + s * s + r * r) + spans[b].bend;
      root_.way[b] = along < spans[b].way ? along : spans[b].way;
    }
  }

  HWY_INLINE void root_gaps(const Obstacle& obstacle, std::uint32_t begin, PointGaps& gaps) const {
    using Row = const float(&)[kBalls];
    point_gaps(obstacle, reinterpret_cast<Row>(root_.x[begin]), reinterpret_cast<Row>(root_.y[begin]),
               reinterpret_cast<Row>(root_.z[begin]), gaps);
  }
  HWY_INLINE Eight root_ways(std::uint32_t begin) const { return Eight::load(root_.way + begin); }
  HWY_INLINE float root_way(std::uint32_t body) const { return root_.way[body]; }
  HWY_INLINE float distance_of_roots(std::uint32_t a, std::uint32_t b) const {
    const float dx = root_.x[a] - root_.x[b], dy = root_.y[a] - root_.y[b], dz = root_.z[a] - root_.z[b];
    return __builtin_sqrtf(dx * dx + dy * dy + dz * dz);
  }

  template <bool kMoves>
  HWY_INLINE void centres(const BallPacket& packet, std::uint32_t body, Centres& c) const {
    const float *R = placed_[body].R, *t = placed_[body].t;
    const Eight x = Eight::load(packet.x), y = Eight::load(packet.y), z = Eight::load(packet.z);
    const auto coordinate = [&](int k) {
      return Eight(t[k]) + (Eight(R[3 * k]) * x + Eight(R[3 * k + 1]) * y + Eight(R[3 * k + 2]) * z);
    };
    const EightPoints points{coordinate(0), coordinate(1), coordinate(2)};
    points.x.store(c.x);
    points.y.store(c.y);
    points.z.store(c.z);
    if constexpr (kMoves) {
      const SpanBody& span = spans_[body];
      lesser(movement(points, body, span.twist) + Eight(span.bend), Eight(span.way)).store(c.way);
    }
  }
  /// |shift + turn x r| of each ball, r from its body's origin.
  HWY_INLINE Eight movement(const EightPoints& c, std::uint32_t body, const SpanTwist& twist) const {
    const float *t = placed_[body].t, *w = twist.turn, *v = twist.shift;
    const EightPoints r = c - EightPoints{Eight(t[0]), Eight(t[1]), Eight(t[2])};
    return length({Eight(v[0]) + (Eight(w[1]) * r.z - Eight(w[2]) * r.y),
                   Eight(v[1]) + (Eight(w[2]) * r.x - Eight(w[0]) * r.z),
                   Eight(v[2]) + (Eight(w[0]) * r.y - Eight(w[1]) * r.x)});
  }
  /// The children of a body's root, computed once for a state.
  template <bool kMoves>
  const Centres* children_of_root(std::uint32_t body) {
    if (!has_children_[body])
      for (std::uint32_t p = 0; p < v_.bodies[body].root_packets; ++p)
        centres<kMoves>(v_.bodies[body].packets[p], body, children_[body][p]);
    has_children_[body] = true;
    return children_[body];
  }
  /// Balls that are near the root of another body.
  HWY_INLINE Bits near_root(const BallPacket& packet, const Centres& c, std::uint32_t other, float grow) const {
    const Eight bound = Eight::load(packet.outer) + Eight(v_.moved_root_outer[other] + grow);
    const Eight d = distances(c.points(), root_.x[other], root_.y[other], root_.z[other]);
    return ~greater(d, bound) & first(packet.count);
  }

 private:
  const DecisionView& v_;
  const SpanBody* spans_ = nullptr;
  Frame64 frames_[kMostDecidedBodies];
  Frame32 placed_[kMostDecidedBodies];
  struct Roots {
    alignas(32) float x[kMostDecidedBodies], y[kMostDecidedBodies], z[kMostDecidedBodies], way[kMostDecidedBodies];
  } root_;
  bool has_children_[kMostDecidedBodies];
  Centres children_[kMostDecidedBodies][2];
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
