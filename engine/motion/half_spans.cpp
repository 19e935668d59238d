#include "engine/motion/half_spans.h"

#include <algorithm>
#include <limits>

#include "engine/hull/support.h"

namespace clearance {

namespace {

// Support of a body along a direction in world axes, from its origin.
double reach_along(const MovingBody& moving, const Vec3d& n) {
  if (moving.box) return reach_of_box(*moving.box, moving.pose.t_w, n);
  const Vec3d n_b = moving.pose.R_wb.transpose_times(n);
  const double length = norm(n);
  if (moving.part) return reach_of_core(*moving.part, n_b) + moving.part->radius * length;
  double most = -std::numeric_limits<double>::infinity();
  for (const ConvexPartPtr& part : moving.body.parts)
    most = std::max(most, reach_of_core(*part, n_b) + part->radius * length);
  return most;
}

// Upper bound on the distance of the bounded geometry from the body's origin.
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
