#include "engine/robot/exact_frame.h"

#include <cmath>

#include "engine/pose/sin_cos.h"

namespace clearance {

namespace {

using Exact = DoubleDouble;

// Sine and cosine within 2^-95, for |x| <= kMaxAngle: Taylor's series after the reduction of sin_cos.h.
SinCos<Exact> exact_sin_cos(double x) {
  const double n = std::nearbyint(x * 0x1.45f306dc9c883p-1);
  const Exact r = dd::two_sum(x - n * kHalfPi[0], -(n * kHalfPi[1])) + dd::two_prod(-n, kHalfPi[2]);
  const Exact z = r * r;
  Exact sine = r, cosine = 1, power = r;
  for (int k = 2; k <= 30; k += 2) {
    // power is r^(k-1) / (k-1)!, with its sign
    const Exact even = -(power * r) / Exact(k);
    power = -(power * z) / Exact(k * (k + 1));
    cosine += even;
    sine += power;
  }
  switch (static_cast<long>(n) & 3) {
    case 0:
      return {sine, cosine};
    case 1:
      return {cosine, -sine};
    case 2:
      return {-sine, -cosine};
    default:
      return {-cosine, sine};
  }
}

}  // namespace

ExactFrame exact_frame(const Origin& origin) {
  const SinCos<Exact> roll = exact_sin_cos(origin.rpy.x / 2), pitch = exact_sin_cos(origin.rpy.y / 2),
                      yaw = exact_sin_cos(origin.rpy.z / 2);
  const Quaternion<Exact> x{roll.cosine, roll.sine, 0, 0}, y{pitch.cosine, 0, pitch.sine, 0},
      z{yaw.cosine, 0, 0, yaw.sine};
  return {product(z, product(y, x)), cast<Exact>(origin.xyz)};
}

Vec3d rounded(const Vec3<Exact>& v, double* off) {
  *off = std::hypot(v.x.lo, v.y.lo, v.z.lo);
  return cast<double>(v);
}
Quaternion<double> rounded(const Quaternion<Exact>& q, double* off) {
  *off = std::hypot(std::hypot(q.w.lo, q.x.lo), std::hypot(q.y.lo, q.z.lo));
  return {q.w.hi, q.x.hi, q.y.hi, q.z.hi};
}

}  // namespace clearance
