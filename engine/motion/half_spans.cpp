#include "engine/motion/half_spans.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/hull/primitive.h"
#include "engine/hull/support.h"

namespace clearance {

namespace {

constexpr double kRounding = 0x1p-44;  // of all sums below, of the lengths that go into them

// How far a piece's core reaches along a direction of about length 1, its body's axes. The normal of a half-space's
// plane comes back from the world's axes as computed: a direction so near to it counts as that normal, which changes
// what the other body reaches by less than kRounding leaves room for.
double along(const Piece& piece, const Vec3d& n) {
  constexpr double kSame = 0x1p-46;
  if (is_half_space(piece) && std::hypot(n.x, n.y) <= kSame * n.z) return 0;
  return support(piece, n).value;
}

// How far a body reaches along a direction, world axes, from its origin.
double reach_along(const MovingBody& moving, const Vec3d& n) {
  if (moving.box) {
    const Vec3d low = moving.box->low - moving.pose.t_w, high = moving.box->high - moving.pose.t_w;
    return std::max(n.x * low.x, n.x * high.x) + std::max(n.y * low.y, n.y * high.y) +
           std::max(n.z * low.z, n.z * high.z);
  }
  const Vec3d n_b = moving.pose.R_wb.transpose_times(n);
  const double length = norm(n);
  if (moving.piece) return along(*moving.piece, n_b) + moving.piece->radius * length;
  double most = -std::numeric_limits<double>::infinity();
  for (const PiecePtr& piece : moving.body.pieces) most = std::max(most, along(*piece, n_b) + piece->radius * length);
  return most;
}

// The length of what is looked at, from the origin, or more.
double size_of(const MovingBody& moving) {
  if (!moving.box) return moving.body.reach;
  const Vec3d low = moving.box->low - moving.pose.t_w, high = moving.box->high - moving.pose.t_w;
  return norm(low) + norm(high);
}

}  // namespace

// The points of a move linearly but for the bend, so that what it reaches along n at a time s is what it reaches along
// n + s (n x turn) where it stands, and s n . shift. That is concave in s, as seen from the gap: the ends suffice.
HalfSpans gaps_along(const Vec3d& normal, const MovingBody& a, const MovingBody& b, double half, double bend) {
  const double length = norm(normal);
  const Vec3d n = normal * (1 / length);
  const Vec3d D = b.pose.t_w - a.pose.t_w, shift = b.twist.shift - a.twist.shift;
  const Vec3d lean_a = cross(n, a.twist.turn), lean_b = cross(n, b.twist.turn);
  const auto gap = [&](double s) {
    return (dot(n, D) + s * dot(n, shift)) - reach_along(a, n + lean_a * s) - reach_along(b, -(n + lean_b * s));
  };
  const double longest = 1 + half * std::max(norm(lean_a), norm(lean_b));
  const double error =
      kRounding * (longest * (size_of(a) + size_of(b) + norm(D)) + half * (norm(a.twist.shift) + norm(b.twist.shift)));
  const double middle = gap(0);
  const auto least = [&](double end) { return std::min(middle, gap(end) - bend) - error; };
  return {least(-half), least(half), middle - error};
}

}  // namespace clearance
