// Balls of covers, placed in a query's common frame, for the kernel of decisions (decide_kernel.h).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/decision/kernel/cloud_gaps.h"
#include "engine/decision/kernel/decision_view.h"
#include "engine/decision/kernel/eight.h"

namespace clearance {
namespace CLEARANCE_ISA {

constexpr int kBalls = BallPacket::kBalls;

HWY_INLINE Bits first(std::uint32_t count) {
  return (Bits{1} << count) - 1;
}
HWY_INLINE int lowest(Bits bits) {
  return __builtin_ctz(bits);
}

/// Difference of the bounds that one ball gives of a body's distance, metres.
HWY_INLINE float stand_out(const BallPacket& packet, int i) {
  return packet.outer[i] - (packet.inner[i] > 0 ? packet.inner[i] : 0);
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

/// Rotations of eight unit quaternions, row by row.
template <class Store>
HWY_INLINE void rotations(const Eight& w, const Eight& x, const Eight& y, const Eight& z, const Store& store) {
  const Eight one(1), two(2);
  store(0, one - two * (y * y + z * z));
  store(1, two * (x * y - w * z));
  store(2, two * (x * z + w * y));
  store(3, two * (x * y + w * z));
  store(4, one - two * (x * x + z * z));
  store(5, two * (y * z - w * x));
  store(6, two * (x * z - w * y));
  store(7, two * (y * z + w * x));
  store(8, one - two * (x * x + y * y));
}

/// The bodies of a query in one state.
class PlacedBalls {
 public:
  explicit PlacedBalls(const DecisionView& view) : v_(view) {
    for (std::uint32_t b = 0; b < v_.columns; ++b) {
      q_[0][b] = 1;
      for (int k = 1; k < 4; ++k) q_[k][b] = 0;
      for (auto& t : t_) t[b] = 0;
      root_.way[b] = 0;
    }
  }

  /// Returns false for a pose beyond the limits of the bounds.
  bool place(const Pose* poses) {
    bool all_direct = true;
    for (std::uint32_t b = 0; b < v_.body_count; ++b) {
      const DecidedBody& body = v_.bodies[b];
      all_direct &= body.is_direct;
      if (!body.is_direct) continue;
      const Pose& X = poses[body.pose];
      if (!is_near(X.translation.x, X.translation.y, X.translation.z, body.farthest)) return false;
      const double parts[7] = {X.qw, X.qx, X.qy, X.qz, X.translation.x, X.translation.y, X.translation.z};
      for (int k = 0; k < 4; ++k) q_[k][b] = static_cast<float>(parts[k]);
      for (int k = 0; k < 3; ++k) t_[k][b] = static_cast<float>(parts[4 + k]);
    }
    for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) rotate(begin);
    if (!all_direct && !place_carried(poses)) return false;
    for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) place_roots(begin);
    for (std::uint32_t b = 0; b < v_.body_count; ++b) has_children_[b] = false;
    return true;
  }
  /// \param spans (columns,) of the bodies
  void take_spans(const SpanBody* spans) {
    spans_ = spans;
    for (std::uint32_t b = 0; b < v_.body_count; ++b) {
      const float *w = spans[b].twist.turn, *v = spans[b].twist.shift;
      const float x = root_.x[b] - t_[0][b], y = root_.y[b] - t_[1][b], z = root_.z[b] - t_[2][b];
      const float u = v[0] + (w[1] * z - w[2] * y), s = v[1] + (w[2] * x - w[0] * z), r = v[2] + (w[0] * y - w[1] * x);
      const float along = __builtin_sqrtf(u * u + s * s + r * r) + spans[b].bend;
      root_.way[b] = along < spans[b].way ? along : spans[b].way;
    }
  }

  HWY_INLINE void root_gaps(const Obstacle& obstacle, std::uint32_t begin, const GapLimits& limits,
                            PointGaps& gaps) const {
    using Row = const float(&)[kBalls];
    obstacle_gaps(obstacle, reinterpret_cast<Row>(root_.x[begin]), reinterpret_cast<Row>(root_.y[begin]),
                  reinterpret_cast<Row>(root_.z[begin]), limits, gaps);
  }
  HWY_INLINE Eight root_ways(std::uint32_t begin) const { return Eight::load(root_.way + begin); }
  /// Distances of the roots of eight columns from a point.
  HWY_INLINE Eight distances_to_roots(std::uint32_t begin, const std::array<float, 3>& point) const {
    const EightPoints c{Eight::load(root_.x + begin), Eight::load(root_.y + begin), Eight::load(root_.z + begin)};
    return distances(c, point[0], point[1], point[2]);
  }
  /// Roots of kColumns columns that may be within their margins of an obstacle.
  template <bool kMoves>
  HWY_INLINE Bits roots_near(std::uint32_t obstacle, std::uint32_t begin) const {
    const ObstacleBox& box = v_.boxes[obstacle];
    const auto beyond = [&](const float* root, std::size_t k) {
      return larger(magnitude(Sixteen::load(root + begin) - Sixteen(box.at[k])) - Sixteen(box.half[k]), Sixteen(0.0f));
    };
    const Sixteen x = beyond(root_.x, 0), y = beyond(root_.y, 1), z = beyond(root_.z, 2);
    Sixteen reach = Sixteen::load(v_.box_reach + std::size_t{obstacle} * v_.columns + begin);
    if constexpr (kMoves) reach = reach + Sixteen::load(root_.way + begin);
    return ~greater(x * x + y * y + z * z, reach * magnitude(reach)) & 0xffff;
  }
  /// Whether all roots of eight columns are beyond their bounds from a ball.
  HWY_INLINE bool are_roots_beyond(std::uint32_t begin, const std::array<float, 3>& centre, const Eight& bound) const {
    return greater(distances_to_roots(begin, centre), bound) == 0xff;
  }
  /// Whether the roots of all bodies are beyond their margins from the obstacles below a node.
  template <bool kMoves>
  HWY_INLINE bool are_roots_beyond(std::uint32_t node) const {
    for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) {
      Eight bound = Eight::load(v_.node_bound + std::size_t{node} * v_.columns + begin);
      if constexpr (kMoves) bound = bound + root_ways(begin);
      if (!are_roots_beyond(begin, v_.nodes[node].at, bound)) return false;
    }
    return true;
  }
  /// Distances of the roots of eight pairs of bodies.
  HWY_INLINE Eight distances_of_roots(const std::int32_t* a, const std::int32_t* b) const {
    const auto difference = [&](const float* of) { return Eight::gather(of, a) - Eight::gather(of, b); };
    return length({difference(root_.x), difference(root_.y), difference(root_.z)});
  }
  /// Pairs of a row whose roots may be within their margins.
  template <bool kMoves>
  HWY_INLINE Bits roots_near(const MovedRow& row) const {
    const auto apart = [&](const float* root) { return Sixteen::load(root + row.begin) - Sixteen(root[row.a]); };
    const Sixteen x = apart(root_.x), y = apart(root_.y), z = apart(root_.z);
    Sixteen reach = Sixteen::load(row.reach);
    if constexpr (kMoves) reach = reach + (Sixteen::load(root_.way + row.begin) + Sixteen(root_.way[row.a]));
    return ~greater(x * x + y * y + z * z, reach * magnitude(reach)) & 0xffff;
  }
  HWY_INLINE float distance_of_roots(std::uint32_t a, std::uint32_t b) const {
    const float dx = root_.x[a] - root_.x[b], dy = root_.y[a] - root_.y[b], dz = root_.z[a] - root_.z[b];
    return __builtin_sqrtf(dx * dx + dy * dy + dz * dz);
  }

  template <bool kMoves>
  HWY_INLINE void centres(const BallPacket& packet, std::uint32_t body, Centres& c) const {
    const Eight x = Eight::load(packet.x), y = Eight::load(packet.y), z = Eight::load(packet.z);
    const auto coordinate = [&](int k) {
      return Eight(t_[k][body]) +
             (Eight(R_[3 * k][body]) * x + Eight(R_[3 * k + 1][body]) * y + Eight(R_[3 * k + 2][body]) * z);
    };
    const EightPoints points{coordinate(0), coordinate(1), coordinate(2)};
    points.x.store(c.x);
    points.y.store(c.y);
    points.z.store(c.z);
    if constexpr (kMoves) {
      const SpanBody& span = spans_[body];
      lesser(length(displacement(points, body, span.twist)) + Eight(span.bend), Eight(span.way)).store(c.way);
    }
  }
  /// shift + turn x r of each ball, r from its body's origin.
  HWY_INLINE EightPoints displacement(const EightPoints& c, std::uint32_t body, const SpanTwist& twist) const {
    const float *w = twist.turn, *v = twist.shift;
    const EightPoints r = c - EightPoints{Eight(t_[0][body]), Eight(t_[1][body]), Eight(t_[2][body])};
    return {Eight(v[0]) + (Eight(w[1]) * r.z - Eight(w[2]) * r.y),
            Eight(v[1]) + (Eight(w[2]) * r.x - Eight(w[0]) * r.z),
            Eight(v[2]) + (Eight(w[0]) * r.y - Eight(w[1]) * r.x)};
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
    const EightPoints c = centres.points(), d = displacement(c, body, spans_[body].twist);
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
    return larger(rise, Eight(0.0f)) + Eight(spans_[body].bend) + rounding;
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
  HWY_INLINE Eight distances_to_root(const Centres& c, std::uint32_t other) const {
    return distances(c.points(), root_.x[other], root_.y[other], root_.z[other]);
  }
  /// Balls that are near the root of another body.
  HWY_INLINE Bits near_root(const BallPacket& packet, const Centres& c, std::uint32_t other, float grow) const {
    const Eight bound = Eight::load(packet.outer) + Eight(v_.moved_root_outer[other] + grow);
    return ~greater(distances_to_root(c, other), bound) & first(packet.count);
  }

 private:
  static bool is_near(double x, double y, double z, double farthest) {
    const auto is_within = [&](double t) { return -farthest <= t && t <= farthest; };
    return is_within(x) && is_within(y) && is_within(z);
  }
  /// Rotations of the quaternions of eight columns.
  HWY_INLINE void rotate(std::uint32_t begin) {
    rotations(Eight::load(q_[0] + begin), Eight::load(q_[1] + begin), Eight::load(q_[2] + begin),
              Eight::load(q_[3] + begin), [&](int k, const Eight& value) { value.store(R_[k] + begin); });
  }
  HWY_INLINE void place_roots(std::uint32_t begin) {
    const Eight x = Eight::load(v_.root_x + begin), y = Eight::load(v_.root_y + begin),
                z = Eight::load(v_.root_z + begin);
    const auto coordinate = [&](int k) {
      return Eight::load(t_[k] + begin) + (Eight::load(R_[3 * k] + begin) * x + Eight::load(R_[3 * k + 1] + begin) * y +
                                           Eight::load(R_[3 * k + 2] + begin) * z);
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
      if (body.carrier != kNone) f = product(frames_[body.carrier], f);
      frames_[b] = f;
      if (body.is_direct) continue;
      if (!is_near(f.t[0], f.t[1], f.t[2], body.farthest)) return false;
      for (int k = 0; k < 9; ++k) R_[k][b] = static_cast<float>(f.R[k]);
      for (int k = 0; k < 3; ++k) t_[k][b] = static_cast<float>(f.t[k]);
    }
    return true;
  }

  const DecisionView& v_;
  const SpanBody* spans_ = nullptr;
  alignas(32) float q_[4][kMostDecidedBodies], R_[9][kMostDecidedBodies], t_[3][kMostDecidedBodies];
  Frame64 frames_[kMostDecidedBodies];
  struct Roots {
    alignas(32) float x[kMostDecidedBodies], y[kMostDecidedBodies], z[kMostDecidedBodies], way[kMostDecidedBodies];
  } root_;
  bool has_children_[kMostDecidedBodies];
  Centres children_[kMostDecidedBodies][2];
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
