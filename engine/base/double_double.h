// Double-double arithmetic: an unevaluated sum hi + lo of two doubles, about 106 significant bits.
//
// Sum and product: M. Joldes, J.-M. Muller, V. Popescu, "Tight and rigorous error bounds for basic building blocks of
// double-word arithmetic", ACM TOMS 44(2), 2017: AccurateDWPlusDW (algorithm 6, relative error <= 3u^2 + 13u^3) and
// DWTimesDW1 (algorithm 10, <= 7u^2), u = 2^-53. The quotient is Y. Hida, X. Li, D. Bailey, "Algorithms for quad-double
// precision floating point arithmetic", ARITH 15, 2001; its bound, <= 10u^2 + O(u^3), and the root's, <= 33/8 u^2 +
// O(u^3), are derived in docs/trust/bounds.md. Needs round-to-nearest and no contraction.
#pragma once

#include <cmath>

#include "engine/base/vec.h"

namespace clearance {

struct DoubleDouble {
  double hi = 0, lo = 0;

  DoubleDouble() = default;
  CLEARANCE_HD constexpr DoubleDouble(double h) : hi(h), lo(0) {}
  CLEARANCE_HD constexpr DoubleDouble(double h, double l) : hi(h), lo(l) {}
  CLEARANCE_HD explicit operator double() const { return hi; }
};

namespace dd {

/// s + e = a + b exactly (Knuth).
CLEARANCE_HD inline DoubleDouble two_sum(double a, double b) {
  const double s = a + b, bb = s - a;
  return {s, (a - (s - bb)) + (b - bb)};
}
/// The same for |a| >= |b| or a = 0 (Dekker).
CLEARANCE_HD inline DoubleDouble fast_two_sum(double a, double b) {
  const double s = a + b;
  return {s, b - (s - a)};
}
/// p + e = a b exactly, barring underflow (Dekker and Veltkamp). A fused multiply-add would differ if the error
/// underflows, but a pose must give the same rotation on every machine.
CLEARANCE_HD inline DoubleDouble two_prod(double a, double b) {
  const double p = a * b;
  constexpr double kSplit = 134217729.0;  // 2^27 + 1
  const double ca = kSplit * a, ah = ca - (ca - a), al = a - ah;
  const double cb = kSplit * b, bh = cb - (cb - b), bl = b - bh;
  return {p, ((ah * bh - p) + ah * bl + al * bh) + al * bl};
}

}  // namespace dd

CLEARANCE_HD inline DoubleDouble operator-(const DoubleDouble& a) {
  return {-a.hi, -a.lo};
}
CLEARANCE_HD inline DoubleDouble operator+(const DoubleDouble& a, const DoubleDouble& b) {
  const DoubleDouble s = dd::two_sum(a.hi, b.hi), t = dd::two_sum(a.lo, b.lo);
  const DoubleDouble v = dd::fast_two_sum(s.hi, s.lo + t.hi);
  return dd::fast_two_sum(v.hi, t.lo + v.lo);
}
CLEARANCE_HD inline DoubleDouble operator-(const DoubleDouble& a, const DoubleDouble& b) {
  return a + (-b);
}
CLEARANCE_HD inline DoubleDouble operator*(const DoubleDouble& a, const DoubleDouble& b) {
  const DoubleDouble p = dd::two_prod(a.hi, b.hi);
  return dd::fast_two_sum(p.hi, p.lo + (a.hi * b.lo + a.lo * b.hi));
}
/// Long division with three quotient digits, each computed from the previous remainder.
CLEARANCE_HD inline DoubleDouble operator/(const DoubleDouble& a, const DoubleDouble& b) {
  const double q1 = a.hi / b.hi;
  DoubleDouble r = a - b * DoubleDouble(q1);
  const double q2 = r.hi / b.hi;
  r = r - b * DoubleDouble(q2);
  const double q3 = r.hi / b.hi;
  return dd::fast_two_sum(q1, q2) + DoubleDouble(q3);
}
CLEARANCE_HD inline DoubleDouble& operator+=(DoubleDouble& a, const DoubleDouble& b) {
  return a = a + b;
}
CLEARANCE_HD inline DoubleDouble& operator-=(DoubleDouble& a, const DoubleDouble& b) {
  return a = a - b;
}
CLEARANCE_HD inline DoubleDouble& operator*=(DoubleDouble& a, const DoubleDouble& b) {
  return a = a * b;
}

CLEARANCE_HD inline bool operator<(const DoubleDouble& a, const DoubleDouble& b) {
  return a.hi < b.hi || (a.hi == b.hi && a.lo < b.lo);
}
CLEARANCE_HD inline bool operator>(const DoubleDouble& a, const DoubleDouble& b) {
  return b < a;
}
CLEARANCE_HD inline bool operator<=(const DoubleDouble& a, const DoubleDouble& b) {
  return a.hi < b.hi || (a.hi == b.hi && a.lo <= b.lo);
}
CLEARANCE_HD inline bool operator>=(const DoubleDouble& a, const DoubleDouble& b) {
  return b <= a;
}
CLEARANCE_HD inline bool operator==(const DoubleDouble& a, const DoubleDouble& b) {
  return a.hi == b.hi && a.lo == b.lo;
}

/// Square root by one Newton step from the double one (Karp and Markstein); 0 for a <= 0.
CLEARANCE_HD inline DoubleDouble sqrt(const DoubleDouble& a) {
  if (!(a.hi > 0)) return {0, 0};
  using std::sqrt;
  const double s = sqrt(a.hi);
  const DoubleDouble r = a - dd::two_prod(s, s);
  return dd::fast_two_sum(s, r.hi / (2 * s));
}
CLEARANCE_HD inline DoubleDouble abs(const DoubleDouble& a) {
  return a.hi < 0 ? -a : a;
}

}  // namespace clearance
