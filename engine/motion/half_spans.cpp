#include "engine/motion/half_spans.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/hull/primitive.h"
#include "engine/hull/support.h"

namespace clearance {

namespace {

// How far a piece's core reaches along a direction of about length 1, its body's axes. The normal of a half-space's
// plane comes back from the world's axes as computed: a direction so near to it counts as that normal, which changes
// what the other body reaches by less than gaps_along() leaves room for.
double along(const Piece& piece, const Vec3d& n) {
  constexpr double kSame = 0x1p-46;
  if (is_half_space(piece) && std::hypot(n.x, n.y) <= kSame * n.z) return 0;
  return support(piece, n).value;
}

// How far a body reaches along a direction, world axes, from its origin.
double reach_along(const MovingBody& moving, const Vec3d& n) {
  if (moving.box) return reach_of_box(*moving.box, moving.pose.t_w, n);
  const Vec3d n_b = moving.pose.R_wb.transpose_times(n);
  const double length = norm(n);
  if (moving.piece) return along(*moving.piece, n_b) + moving.piece->radius * length;
  double most = -std::numeric_limits<double>::infinity();
  for (const PiecePtr& piece : moving.body.pieces) most = std::max(most, along(*piece, n_b) + piece->radius * length);
  return most;
}

// The length of what is looked at, from the origin, or more.
double size_of(const MovingBody& moving) {
  return moving.box ? size_of_box(*moving.box, moving.pose.t_w) : moving.body.reach;
}

}  // namespace

HalfSpans gaps_along(const Vec3d& normal, const MovingBody& a, const MovingBody& b, double half, double bend) {
  return gaps_along(
      normal, b.pose.t_w - a.pose.t_w, a.twist, b.twist, [&](const Vec3d& n) { return reach_along(a, n); },
      [&](const Vec3d& n) { return reach_along(b, n); }, size_of(a) + size_of(b), half, bend);
}

}  // namespace clearance
