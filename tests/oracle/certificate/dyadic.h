// Numbers m 2^e: all values of float64, with their exact sums, differences and products.
#pragma once

#include <gmpxx.h>

#include <array>
#include <compare>

namespace clearance::certificate_oracle {

/// m 2^e, exactly. Quotients and roots are no such numbers; the names of their functions give the direction of
/// rounding.
class Dyadic {
 public:
  Dyadic() = default;
  Dyadic(double x);  // NOLINT: any finite float64
  Dyadic(mpz_class m, long e) : m_(std::move(m)), e_(e) {}
  static Dyadic power_of_two(long e) { return {mpz_class(1), e}; }

  int sign() const { return sgn(m_); }
  const mpz_class& mantissa() const { return m_; }
  long exponent() const { return e_; }
  /// Approximates the number as a float64 in [0.5, 1) or (-1, -0.5], truncated, times a power of two. For 0, both are
  /// 0.
  double rough(long& power) const;

  Dyadic operator-() const { return {-m_, e_}; }
  Dyadic& operator+=(const Dyadic& x);
  Dyadic& operator-=(const Dyadic& x);
  /// += x y, and -= x y, without a temporary if it has the same exponent.
  Dyadic& add_product(const Dyadic& x, const Dyadic& y);
  Dyadic& subtract_product(const Dyadic& x, const Dyadic& y);
  friend Dyadic operator+(Dyadic x, const Dyadic& y) { return x += y; }
  friend Dyadic operator-(Dyadic x, const Dyadic& y) { return x -= y; }
  friend Dyadic operator*(const Dyadic& x, const Dyadic& y) { return {x.m_ * y.m_, x.e_ + y.e_}; }
  friend bool operator==(const Dyadic& x, const Dyadic& y) { return (x - y).sign() == 0; }
  friend std::strong_ordering operator<=>(const Dyadic& x, const Dyadic& y) { return (x - y).sign() <=> 0; }

 private:
  mpz_class m_;
  long e_ = 0;
};

Dyadic abs(const Dyadic& x);
/// The largest multiple of 2^-bits that is at most x / y. y > 0.
Dyadic quotient_below(const Dyadic& x, const Dyadic& y, long bits);
/// At least x / y, and above it by less than 2^-384 of it. y > 0.
Dyadic quotient_above(const Dyadic& x, const Dyadic& y);
/// Above the root of x > 0 by less than 2^-380 of it; 0 for 0.
Dyadic root_above(const Dyadic& x);

using Vector = std::array<Dyadic, 3>;
using Rows = std::array<Vector, 3>;

Vector operator+(const Vector& u, const Vector& v);
Vector operator-(const Vector& u, const Vector& v);
Vector operator*(const Dyadic& factor, const Vector& v);
Dyadic dot(const Vector& u, const Vector& v);
Vector cross(const Vector& u, const Vector& v);
bool is_zero(const Vector& v);
/// A matrix, or its transpose, times v.
Vector turned(const Rows& rows, const Vector& v);
Vector turned_back(const Rows& rows, const Vector& v);
/// At least |v|: root_above().
Dyadic length_above(const Vector& v);

}  // namespace clearance::certificate_oracle
