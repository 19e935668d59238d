// Points and balls of covers in rational numbers.
#pragma once

#include <vector>

#include "engine/cover/cover.h"
#include "tests/oracle/exact/exact_distance.h"
#include "wire/types.h"

namespace clearance {

using Vec3q = Vec3<mpq_class>;

inline Vec3q rational(const Vec3d& v) {
  return {mpq_class(v.x), mpq_class(v.y), mpq_class(v.z)};
}
inline mpq_class squared(const Vec3q& v) {
  return v.x * v.x + v.y * v.y + v.z * v.z;
}
inline Vec3q times(const Vec3q& v, const mpq_class& f) {
  return {v.x * f, v.y * f, v.z * f};
}

/// A rational vector of length 1 exactly.
inline Vec3q unit(exact::Random& random) {
  const mpq_class s(random.integer(-30, 30), 10), t(random.integer(-30, 30), 10), sum = s * s + t * t;
  return times({2 * s, 2 * t, 1 - sum}, mpq_class(random.chance(0.5) ? 1 : -1) / (1 + sum));
}

/// Whether a ball holds a point, decided exactly.
inline bool holds(const CoverBall& ball, const Vec3q& p) {
  const Vec3q d = p - rational({ball.centre[0], ball.centre[1], ball.centre[2]});
  return squared(d) <= mpq_class(ball.outer) * mpq_class(ball.outer);
}

inline CoverBall ball_of(const BallPacket& packet, std::uint32_t i) {
  return {{packet.x[i], packet.y[i], packet.z[i]}, packet.outer[i], packet.inner[i]};
}

/// Whether a path of balls holds a point, from a packet to a ball without children. Then every complete cut holds it.
inline bool has_path(const Cover& cover, const BallPacket& packet, const Vec3q& p) {
  for (std::uint32_t i = 0; i < packet.count; ++i)
    if (holds(ball_of(packet, i), p) &&
        (packet.children[i] == kNone || has_path(cover, cover.packets[packet.children[i]], p)))
      return true;
  return false;
}
inline bool has_path(const Cover& cover, const Vec3q& p) {
  if (!holds(cover.root, p)) return false;
  for (const BallPacket& packet : cover.level(1))
    if (has_path(cover, packet, p)) return true;
  return false;
}

inline std::vector<CoverBall> all_balls(const Cover& cover) {
  std::vector<CoverBall> balls{cover.root};
  for (const BallPacket& packet : cover.packets)
    for (std::uint32_t i = 0; i < packet.count; ++i) balls.push_back(ball_of(packet, i));
  return balls;
}

}  // namespace clearance
