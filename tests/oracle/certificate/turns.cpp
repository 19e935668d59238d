#include "tests/oracle/certificate/turns.h"

#include <numbers>

#include "tests/oracle/certificate/document.h"

namespace clearance::certificate_oracle {
namespace {

// Fixed-point numbers: x represents x 2^-kFixed. The errors of series and roots stay far below 2^-kBits.
constexpr long kFixed = 512;

mpz_class fixed(const Dyadic& x) {
  return quotient_below(x, 1.0, kFixed).mantissa();
}

mpz_class shifted_down(const mpz_class& x, mp_bitcnt_t bits) {
  mpz_class result;
  mpz_fdiv_q_2exp(result.get_mpz_t(), x.get_mpz_t(), bits);
  return result;
}

mpz_class product(const mpz_class& x, const mpz_class& y) {
  return shifted_down(x * y, kFixed);
}

const mpz_class& one() {
  static const mpz_class value = mpz_class(1) << kFixed;
  return value;
}

// Taylor's sums of a 2^-kHalvings-th of the angle, doubled as often: 1 - 2 s^2 and 2 s c lose two bits each time.
void sine_and_cosine(const Dyadic& angle, mpz_class& sine, mpz_class& cosine) {
  constexpr int kHalvings = 40;
  const mpz_class x = shifted_down(fixed(angle), kHalvings), square = product(x, x);
  mpz_class term = x;
  sine = x;
  for (unsigned k = 2; abs(term) > 1; k += 2) {
    term = -product(term, square) / (k * (k + 1));
    sine += term;
  }
  cosine = sqrt(mpz_class((one() - product(sine, sine)) << kFixed));
  for (int k = 0; k < kHalvings; ++k) {
    const mpz_class both = product(sine, cosine);
    cosine = one() - 2 * product(sine, sine);
    sine = 2 * both;
  }
}

// The angle whose tangent is y / x, for y > 0 and x >= 0. It is halved until Taylor's sum is short.
Dyadic angle_of(const Dyadic& x, const Dyadic& y) {
  constexpr int kHalvings = 24;
  // tan(angle / 2) = y / (x + |(x, y)|), at most 1; and tan(a / 2) = tan(a) / (1 + sqrt(1 + tan(a)^2)).
  mpz_class t = quotient_below(y, x + length_above({x, y, Dyadic()}), kFixed).mantissa();
  for (int k = 0; k < kHalvings; ++k)
    t = (t << kFixed) / mpz_class(one() + sqrt(mpz_class((one() + product(t, t)) << kFixed)));
  const mpz_class square = product(t, t);
  mpz_class sum = t, power = t;
  for (unsigned k = 3; abs(power) > 1; k += 2) {
    power = -product(power, square);
    sum += power / k;
  }
  return {sum, kHalvings + 1 - kFixed};
}

Quaternion operator*(const Dyadic& factor, const Quaternion& q) {
  return {factor * q.w, factor * q.v};
}

}  // namespace

const Dyadic& blur() {
  static const Dyadic value = Dyadic::power_of_two(-150);
  return value;
}

Vector rounded(const Vector& v, const Dyadic& divisor) {
  return {quotient_below(v[0], divisor, kBits), quotient_below(v[1], divisor, kBits),
          quotient_below(v[2], divisor, kBits)};
}

Vector unit(const Vector& v) {
  return rounded(v, length_above(v));
}

Pose pose_of(const Vector& origin, const Quaternion& q) {
  const Dyadic &w = q.w, &x = q.v[0], &y = q.v[1], &z = q.v[2], two = 2.0;
  const Dyadic ww = w * w, xx = x * x, yy = y * y, zz = z * z;
  Pose pose;
  pose.origin = origin;
  pose.divisor = ww + xx + yy + zz;
  require(pose.divisor.sign() > 0, "a quaternion is 0");
  const Dyadic xy = x * y, xz = x * z, yz = y * z, wx = w * x, wy = w * y, wz = w * z;
  pose.rows = {{{ww + xx - yy - zz, two * (xy - wz), two * (xz + wy)},
                {two * (xy + wz), ww - xx + yy - zz, two * (yz - wx)},
                {two * (xz - wy), two * (yz + wx), ww - xx - yy + zz}}};
  return pose;
}

Pose turn_about(const Vector& axis, const Dyadic& angle) {
  require(abs(angle) < Dyadic::power_of_two(21), "an angle is too large");
  mpz_class sine, cosine;
  sine_and_cosine(Dyadic(0.5) * angle, sine, cosine);
  Pose pose = pose_of({}, {Dyadic(cosine, -kFixed), Dyadic(sine, -kFixed) * axis});
  for (Vector& row : pose.rows) row = rounded(row, pose.divisor);
  pose.divisor = 1.0;
  pose.is_rounded = true;
  return pose;
}

Turn turn_between(const Quaternion& from, const Quaternion& to) {
  // The conjugate of `from`, times `to`; negated, which is the same rotation, if that is the longer way.
  Quaternion way{from.w * to.w + dot(from.v, to.v), from.w * to.v - to.w * from.v - cross(from.v, to.v)};
  if (way.w.sign() < 0) way = Dyadic(-1.0) * way;
  if (is_zero(way.v)) return {};
  const Dyadic half = angle_of(way.w, length_above(way.v));
  return {unit(way.v), quotient_below(half + half, 1.0, kBits)};
}

Pose composed(const Pose& outer, const Pose& inner) {
  const Dyadic both = outer.divisor * inner.divisor;
  Pose pose;
  pose.origin = rounded(outer.divisor * outer.origin + turned(outer.rows, inner.origin), outer.divisor);
  for (std::size_t k = 0; k < 3; ++k) pose.rows[k] = rounded(turned_back(inner.rows, outer.rows[k]), both);
  pose.is_rounded = true;
  return pose;
}

Dyadic chord_above(const Dyadic& angle) {
  if (angle.sign() == 0) return {};
  const Pose turn = turn_about({0.0, 0.0, 1.0}, angle);
  if (angle >= Dyadic(std::numbers::pi)) return 2.0;
  return length_above(turn.rows[0] - Vector{1.0, 0.0, 0.0}) + blur();
}

}  // namespace clearance::certificate_oracle
