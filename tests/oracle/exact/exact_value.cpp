#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "tests/oracle/exact/exact_difference.h"

namespace clearance::exact {

namespace {

/// Maps doubles to integers in the same order.
std::int64_t rank_of(double x) {
  const std::int64_t bits = std::bit_cast<std::int64_t>(x);
  return bits >= 0 ? bits : std::numeric_limits<std::int64_t>::min() - bits;
}
double of_rank(std::int64_t r) {
  return std::bit_cast<double>(r >= 0 ? r : std::numeric_limits<std::int64_t>::min() - r);
}

}  // namespace

int Value::compare(double x) const {
  const mpq_class y = rational(x) + radius;  // sign * sqrt(numerator / denominator) compared with y
  const int y_sign = sgn(y);
  if (sign != y_sign) return sign > y_sign ? 1 : -1;
  if (sign == 0) return 0;
  const mpz_class left = numerator * y.get_den() * y.get_den(), right = denominator * y.get_num() * y.get_num();
  return sign * sgn(mpz_class(left - right));
}

int Value::compare(const Value& other) const {
  if (radius != other.radius) throw std::invalid_argument("exact::Value::compare: radii differ");
  if (sign != other.sign) return sign > other.sign ? 1 : -1;
  if (sign == 0) return 0;
  return sign * sgn(mpz_class(numerator * other.denominator - other.numerator * denominator));
}

double Value::lower() const {
  constexpr unsigned kBits = 512;
  mpf_class root(0, kBits), quotient(0, kBits);
  quotient = mpf_class(numerator, kBits) / mpf_class(denominator, kBits);
  root = sqrt(quotient);
  mpf_class guess(0, kBits);
  guess = sign * root - mpf_class(radius, kBits);
  // The guess is almost always right or one off; the steps double in case it is not.
  const auto not_above = [&](std::int64_t r) { return compare(of_rank(r)) >= 0; };
  std::int64_t low = rank_of(compare(0.0) == 0 ? 0.0 : guess.get_d()), high = low;
  for (std::int64_t step = 1; !not_above(low); step *= 2) high = low, low -= step;
  for (std::int64_t step = 1; not_above(high); step *= 2) low = high, high += step;
  while (high - low > 1) {
    const std::int64_t middle = low + (high - low) / 2;
    (not_above(middle) ? low : high) = middle;
  }
  return of_rank(low);
}

double Value::upper() const {
  const double x = lower();
  return compare(x) == 0 ? x : std::nextafter(x, std::numeric_limits<double>::infinity());
}

}  // namespace clearance::exact
