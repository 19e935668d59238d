// Exact distances of points from cores in closed form, in 450 bits.
#pragma once

#include <gmpxx.h>

#include "engine/hull/primitive.h"
#include "engine/pose/pose.h"

namespace clearance::exact {

/// Of every number below. Tests set it as GMP's default, for what their expressions hold in between.
inline constexpr unsigned kBits = 450;

using Real = mpf_class;
using Vec3r = Vec3<Real>;

inline Real real(double x) {
  return Real(x, kBits);
}
inline Vec3r real(const Vec3d& v) {
  return {real(v.x), real(v.y), real(v.z)};
}
inline Real product(const Vec3r& a, const Vec3r& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline Real length(const Vec3r& v) {
  return sqrt(Real(product(v, v)));
}
inline Vec3r difference(const Vec3r& a, const Vec3r& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Real larger(const Real& a, const Real& b) {
  return a < b ? b : a;
}

/// M(q) / |q|^2, or its inverse, times v.
inline Vec3r turned(const Pose& X, const Vec3r& v, bool back = false) {
  const double s = back ? -1 : 1;
  const Real w = real(X.qw), x = real(s * X.qx), y = real(s * X.qy), z = real(s * X.qz);
  const Real n = w * w + x * x + y * y + z * z;
  const Vec3r rows[3] = {{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                         {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
                         {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}};
  return {product(rows[0], v) / n, product(rows[1], v) / n, product(rows[2], v) / n};
}

/// Signed distance of a point from an ellipsoid: the nearest point of its surface is a^2 p / (a^2 + t) for the largest
/// root t of sum (a p / (a^2 + t))^2 = 1.
inline Real from_ellipsoid(const Vec3d& axes, const Vec3r& p) {
  const Vec3r a = real(axes);
  const auto excess = [&](const Real& t) {
    Real sum = real(-1);
    for (int k = 0; k < 3; ++k) {
      const Real part = a[k] * p[k] / (a[k] * a[k] + t);
      sum += part * part;
    }
    return sum;
  };
  int shortest = 0;
  for (int k = 1; k < 3; ++k) shortest = a[k] < a[shortest] ? k : shortest;
  Real low = -a[shortest] * a[shortest] + abs(Real(a[shortest] * p[shortest])), high = low;
  for (Real step = real(1e-30); excess(high) > 0; step *= 4) high += step;
  for (unsigned i = 0; i < 400; ++i) {
    const Real middle = (low + high) / 2;
    (excess(middle) > 0 ? low : high) = middle;
  }
  Vec3r off;
  for (int k = 0; k < 3; ++k) off[k] = p[k] - a[k] * a[k] * p[k] / (a[k] * a[k] + high);
  return excess(real(0)) > 0 ? length(off) : Real(-length(off));
}

/// Signed distance of a point from a cone: a triangle in the half-plane through the axis.
inline Real from_cone(const Vec3d& size, const Vec3r& p) {
  const Real r = real(size.x), h = real(size.z), across = sqrt(Real(p.x * p.x + p.y * p.y)),
             side = sqrt(Real(r * r + 4 * h * h));
  const Real beyond_base = -h - p.z;                                 // of the base's plane
  const Real beyond_side = (2 * h * across + r * (p.z - h)) / side;  // of the line from rim to apex
  if (beyond_base <= 0 && beyond_side <= 0) return larger(beyond_base, beyond_side);
  const auto from_segment = [&](const Real& u0, const Real& v0, const Real& u1, const Real& v1) {
    const Real du = u1 - u0, dv = v1 - v0;
    Real t = ((across - u0) * du + (p.z - v0) * dv) / (du * du + dv * dv);
    if (t < 0) t = 0;
    if (t > 1) t = 1;
    const Real u = across - (u0 + t * du), v = p.z - (v0 + t * dv);
    return Real(sqrt(Real(u * u + v * v)));
  };
  const Real to_base = from_segment(real(0), -h, r, -h), to_side = from_segment(r, -h, real(0), h);
  return to_base < to_side ? to_base : to_side;
}

/// Signed distance of a point from a cylinder: a rectangle in the half-plane through the axis.
inline Real from_cylinder(const Vec3d& size, const Vec3r& p) {
  const Real beyond_side = sqrt(Real(p.x * p.x + p.y * p.y)) - real(size.x), beyond_end = abs(p.z) - real(size.z);
  if (beyond_side <= 0 || beyond_end <= 0) return larger(beyond_side, beyond_end);
  return sqrt(Real(beyond_side * beyond_side + beyond_end * beyond_end));
}

//// Signed distance of a point from a core in closed form, in the core's axes.
inline Real from_round(const Primitive& core, const Vec3r& p) {
  switch (core.kind) {
    case Primitive::Kind::kEllipsoid:
      return from_ellipsoid(core.size, p);
    case Primitive::Kind::kCone:
      return from_cone(core.size, p);
    case Primitive::Kind::kHalfSpace:
      return p.z;
    default:
      return from_cylinder(core.size, p);
  }
}

}  // namespace clearance::exact
