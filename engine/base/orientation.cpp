#include "engine/base/orientation.h"

#include <array>
#include <cmath>
#include <vector>

#include "engine/base/double_double.h"

namespace clearance {

namespace {

constexpr double kU = 0x1p-53;  // unit roundoff

int sign(double x) {
  return (x > 0) - (x < 0);
}

// An exact sum of nonoverlapping doubles, ascending in magnitude. Its sign is that of the last.
using Expansion = std::vector<double>;

// Shewchuk's Grow-Expansion (theorem 10) without zeros: e + b. Nonoverlapping if e is.
void grow(Expansion* e, double b) {
  double q = b;
  std::size_t kept = 0;
  for (const double c : *e) {
    const DoubleDouble s = dd::two_sum(q, c);
    q = s.hi;
    if (s.lo != 0) (*e)[kept++] = s.lo;
  }
  e->resize(kept);
  if (q != 0) e->push_back(q);
}

// Expansion-Sum (theorem 12): e + f.
void add(Expansion* e, const Expansion& f) {
  for (const double c : f) grow(e, c);
}

// Scale-Expansion (theorem 19) without zeros: b e. Nonoverlapping if e is.
Expansion scaled(const Expansion& e, double b) {
  Expansion out;
  if (e.empty() || b == 0) return out;
  DoubleDouble product = dd::two_prod(e[0], b);
  double q = product.hi;
  if (product.lo != 0) out.push_back(product.lo);
  for (std::size_t i = 1; i < e.size(); ++i) {
    product = dd::two_prod(e[i], b);
    const DoubleDouble s = dd::two_sum(q, product.lo), t = dd::fast_two_sum(product.hi, s.hi);
    if (s.lo != 0) out.push_back(s.lo);
    if (t.lo != 0) out.push_back(t.lo);
    q = t.hi;
  }
  if (q != 0) out.push_back(q);
  return out;
}

Expansion times(const Expansion& e, const DoubleDouble& f) {
  Expansion out = scaled(e, f.lo);
  add(&out, scaled(e, f.hi));
  return out;
}

Expansion expansion_of(const DoubleDouble& f) {
  Expansion out;
  if (f.lo != 0) out.push_back(f.lo);
  if (f.hi != 0) out.push_back(f.hi);
  return out;
}

using Difference = Vec3<DoubleDouble>;  // each entry exact

DoubleDouble exact_difference(double a, double b) {
  return dd::two_sum(a, -b);
}

Difference exact_difference(const Vec3d& a, const Vec3d& b) {
  return {exact_difference(a.x, b.x), exact_difference(a.y, b.y), exact_difference(a.z, b.z)};
}

int exact_sign(const Difference& u, const Difference& v, const Difference& w) {
  Expansion total;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    // u_i (v_j w_k - v_k w_j)
    add(&total, times(times(expansion_of(u[i]), v[j]), w[k]));
    add(&total, times(times(expansion_of(-u[i]), v[k]), w[j]));
  }
  return total.empty() ? 0 : sign(total.back());
}

}  // namespace

bool orientation_applies(const Vec3d& v) {
  for (int k = 0; k < 3; ++k) {
    const double m = std::abs(v[k]);
    if (m != 0 && !(m >= kMinOrientationCoordinate && m <= kMaxOrientationCoordinate)) return false;
  }
  return true;
}

int orientation(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& p) {
  double permanent;
  if (const int sure = orientation_in_float64(a, b, c, p, permanent); sure != kUnsure) return sure;

  // The differences are exact here. Each of the six triple products has a relative error below 2 * 7 u^2, and each of
  // the five additions one of 3 u^2: in total less than 64 u^2 of the permanent. The factor 1 + 2^-20 covers the
  // permanent's own rounding.
  const Difference du = exact_difference(b, a), dv = exact_difference(c, a), dw = exact_difference(p, a);
  const DoubleDouble fine = dot(dw, cross(du, dv));
  const double bound = 64 * kU * kU * (1 + 0x1p-20) * permanent;
  if (fine.hi > bound || -fine.hi > bound) return sign(fine.hi);
  return exact_sign(dw, du, dv);
}

}  // namespace clearance
