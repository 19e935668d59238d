// Frames of bodies and centres of balls, for the kernel of decisions (decide_kernel.h).
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "engine/cover/point_gaps.h"
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

/// One body in up to eight states, which are the lanes.
class BodyInStates {
 public:
  /// \param frame (7, 8) of the body
  explicit BodyInStates(const double* frame) {
    alignas(32) float parts[7 * kBalls];
    CLEARANCE_LANES
    for (int i = 0; i < 7 * kBalls; ++i) parts[i] = static_cast<float>(frame[i]);
    const auto part = [&](int i) { return Eight::load(parts + i * kBalls); };
    rotations(part(0), part(1), part(2), part(3), [&](int i, const Eight& value) { R_[i] = value; });
    for (int i = 0; i < 3; ++i) t_[i] = part(4 + i);
  }

  HWY_INLINE void place(const std::array<float, 3>& p, Centres& c) const {
    const auto coordinate = [&](int k) {
      return t_[k] + (R_[3 * k] * Eight(p[0]) + R_[3 * k + 1] * Eight(p[1]) + R_[3 * k + 2] * Eight(p[2]));
    };
    coordinate(0).store(c.x);
    coordinate(1).store(c.y);
    coordinate(2).store(c.z);
  }
  /// From the body's origins to a point that is placed.
  HWY_INLINE EightPoints from_origin(const Centres& c) const { return c.points() - EightPoints{t_[0], t_[1], t_[2]}; }
  /// The rotations row by row, then the translations.
  HWY_INLINE void store(float (&to)[12][kBalls]) const {
    for (int i = 0; i < 9; ++i) R_[i].store(to[i]);
    for (int i = 0; i < 3; ++i) t_[i].store(to[9 + i]);
  }

 private:
  Eight R_[9], t_[3];
};

/// shift + turn x r, of a point r from the body's origin.
template <class T, class Point>
HWY_INLINE Point displaced(const T* turn, const T* shift, const Point& r) {
  return {shift[0] + (turn[1] * r.z - turn[2] * r.y), shift[1] + (turn[2] * r.x - turn[0] * r.z),
          shift[2] + (turn[0] * r.y - turn[1] * r.x)};
}

/// The movement of one body within half of up to eight spans, which are the lanes.
class BodyInSpans {
 public:
  /// \param twists (6, 8) of the body, per unit of time
  /// \param kept receives them, within half a span
  BodyInSpans(const double* twists, double half, float (&kept)[6][kBalls]) {
    for (int i = 0; i < 6; ++i, twists += kBalls) {
      CLEARANCE_LANES
      for (int k = 0; k < kBalls; ++k) kept[i][k] = static_cast<float>(twists[k] * half);
      part_[i] = Eight::load(kept[i]);
    }
  }
  /// Bounds the way of a point within half a span.
  HWY_INLINE void move(const BodyInStates& body, const SpanBody& span, Centres& point) const {
    const EightPoints by = displaced(part_, part_ + 3, body.from_origin(point));
    lesser(length(by) + Eight(span.bend), Eight(span.way)).store(point.way);
  }

 private:
  Eight part_[6];
};

/// States in which a body is no farther than its bounds allow.
inline Bits usable_states(const DecidedBody& body, const double* frame, std::size_t states) {
  const double farthest = body.farthest;
  std::uint64_t usable = 0;
  CLEARANCE_LANES
  for (int k = 0; k < kBalls; ++k) {
    const auto is_near = [&](int i) { return std::abs(frame[i * kBalls + k]) <= farthest; };
    usable |= (is_near(4) & is_near(5) & is_near(6)) ? std::uint64_t{1} << k : 0;
  }
  return static_cast<Bits>(usable) & first(static_cast<std::uint32_t>(states));
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
