// Sine and cosine from additions and products only, so that a scalar, a SIMD lane and a GPU thread give the same bits,
// with a proved error bound (docs/trust/bounds_robots.md, "Sine and cosine").
#pragma once

#include "engine/base/lane.h"

namespace clearance {

/// Largest angle, in radians, for which the bound of sin_cos() is proved.
inline constexpr double kMaxAngle = 1e6;

template <class T>
struct SinCos {
  T sine, cosine;
};

/// Unevaluated sum value + rest, which represents a number exactly.
template <class T>
struct TwoPart {
  T value, rest;
};

/// a + b exactly (Knuth).
template <class T>
CLEARANCE_INLINE TwoPart<T> exact_sum(const T& a, const T& b) {
  const T s = a + b, bb = s - a;
  return {s, (a - (s - bb)) + (b - bb)};
}

/// a b exactly, barring underflow and |a|, |b| > 1e300 (Dekker and Veltkamp).
template <class T>
CLEARANCE_INLINE TwoPart<T> exact_product(const T& a, const T& b) {
  const T p = a * b, split(134217729.0);  // 2^27 + 1
  const T ca = split * a, ah = ca - (ca - a), al = a - ah;
  const T cb = split * b, bh = cb - (cb - b), bl = b - bh;
  return {p, ((ah * bh - p) + ah * bl + al * bh) + al * bl};
}

/// pi/2 = kHalfPi[0] + kHalfPi[1] + kHalfPi[2] within 2^-118; the first two are short enough that their products with
/// integers up to 2^20 are exact.
inline constexpr double kHalfPi[3] = {0x1.921fb544p0, 0x1.0b4611a4p-34, 0x1.13198a2e03707p-65};

/// first + z (second + z (...)).
template <class T, class... Coefficients>
CLEARANCE_INLINE T polynomial(const T& z, double first, Coefficients... others) {
  if constexpr (sizeof...(others) == 0)
    return T(first);
  else
    return T(first) + z * polynomial(z, others...);
}

/// Sine and cosine of the angle x + rest, each within 1.25 * 2^-53 for |x| <= kMaxAngle and |rest| <= 2^-31.
template <class T>
CLEARANCE_INLINE SinCos<T> sin_cos(const T& x, const T& rest) {
  const T shift(0x1.8p52);  // adding it rounds to an integer
  const T n = (x * T(0x1.45f306dc9c883p-1) + shift) - shift;
  const TwoPart<T> r = exact_sum(x - n * T(kHalfPi[0]), -(n * T(kHalfPi[1])));
  const T low = (r.rest - n * T(kHalfPi[2])) + rest;
  const T& high = r.value;
  // Taylor's series: up to pi/4, the remainders are below 2^-63 and 2^-58.
  const T z = high * high;
  const T s = polynomial(z, -1 / 6.0, 1 / 120.0, -1 / 5040.0, 1 / 362880.0, -1 / 39916800.0, 1 / 6227020800.0,
                         -1 / 1307674368000.0, 1 / 355687428096000.0);
  const T c = polynomial(z, 1 / 24.0, -1 / 720.0, 1 / 40320.0, -1 / 3628800.0, 1 / 479001600.0, -1 / 87178291200.0,
                         1 / 20922789888000.0);
  const T cubic = (high * z) * s, half = z * T(0.5), most = T(1) - half, fourth = (z * z) * c;
  const T sine = high + (cubic + low * (most + fourth));
  const T cosine = most + (((T(1) - most) - half) + (fourth - low * (high + cubic)));
  // n modulo 4 is one of -2, ..., 2.
  const T quarter = n - T(4) * ((n * T(0.25) + shift) - shift);
  const auto odd = quarter * quarter == T(1);
  const T first = select(odd, cosine, sine), second = select(odd, sine, cosine);
  return {select((quarter < T(0)) | (quarter == T(2)), -first, first),
          select((quarter > T(0)) | (quarter == T(-2)), -second, second)};
}

}  // namespace clearance
