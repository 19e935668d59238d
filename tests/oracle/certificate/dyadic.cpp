#include "tests/oracle/certificate/dyadic.h"

#include <cmath>

namespace clearance::certificate_oracle {
namespace {

constexpr long kBits = 384;  // of quotients and roots, at least

mpz_class shifted(const mpz_class& m, long bits) {
  mpz_class result;
  if (bits >= 0)
    mpz_mul_2exp(result.get_mpz_t(), m.get_mpz_t(), static_cast<mp_bitcnt_t>(bits));
  else
    mpz_fdiv_q_2exp(result.get_mpz_t(), m.get_mpz_t(), static_cast<mp_bitcnt_t>(-bits));
  return result;
}

long length_in_bits(const mpz_class& m) {
  return static_cast<long>(mpz_sizeinbase(m.get_mpz_t(), 2));
}

}  // namespace

Dyadic::Dyadic(double x) {
  if (x == 0) return;
  int exponent = 0;
  m_ = std::ldexp(std::frexp(x, &exponent), 53);
  const mp_bitcnt_t zeros = mpz_scan1(m_.get_mpz_t(), 0);
  mpz_tdiv_q_2exp(m_.get_mpz_t(), m_.get_mpz_t(), zeros);
  e_ = exponent - 53 + static_cast<long>(zeros);
}

double Dyadic::rough(long& power) const {
  long exponent = 0;
  const double d = mpz_get_d_2exp(&exponent, m_.get_mpz_t());
  power = d == 0 ? 0 : exponent + e_;
  return d;
}

Dyadic& Dyadic::operator+=(const Dyadic& x) {
  if (x.e_ == e_) {
    m_ += x.m_;
  } else if (x.sign() == 0) {
    return *this;
  } else if (sign() == 0) {
    *this = x;
  } else if (x.e_ > e_) {
    m_ += shifted(x.m_, x.e_ - e_);
  } else {
    mpz_mul_2exp(m_.get_mpz_t(), m_.get_mpz_t(), static_cast<mp_bitcnt_t>(e_ - x.e_));
    m_ += x.m_;
    e_ = x.e_;
  }
  return *this;
}

Dyadic& Dyadic::operator-=(const Dyadic& x) {
  m_ = -m_;
  *this += x;
  m_ = -m_;
  return *this;
}

Dyadic& Dyadic::add_product(const Dyadic& x, const Dyadic& y) {
  if (x.e_ + y.e_ != e_) return *this += x * y;
  mpz_addmul(m_.get_mpz_t(), x.m_.get_mpz_t(), y.m_.get_mpz_t());
  return *this;
}

Dyadic& Dyadic::subtract_product(const Dyadic& x, const Dyadic& y) {
  if (x.e_ + y.e_ != e_) return *this -= x * y;
  mpz_submul(m_.get_mpz_t(), x.m_.get_mpz_t(), y.m_.get_mpz_t());
  return *this;
}

Dyadic abs(const Dyadic& x) {
  return x.sign() < 0 ? -x : x;
}

Dyadic quotient_below(const Dyadic& x, const Dyadic& y, long bits) {
  const long shift = x.exponent() - y.exponent() + bits;
  if (y.mantissa() == 1) return {shifted(x.mantissa(), shift), -bits};
  mpz_class over = x.mantissa(), under = y.mantissa(), quotient;
  if (shift >= 0)
    over = shifted(over, shift);
  else
    under = shifted(under, -shift);
  mpz_fdiv_q(quotient.get_mpz_t(), over.get_mpz_t(), under.get_mpz_t());
  return {quotient, -bits};
}

Dyadic quotient_above(const Dyadic& x, const Dyadic& y) {
  if (x.sign() == 0) return x;
  const long digits = length_in_bits(x.mantissa()) + x.exponent() - length_in_bits(y.mantissa()) - y.exponent();
  return -quotient_below(-x, y, kBits + 2 - digits);
}

Dyadic root_above(const Dyadic& x) {
  if (x.sign() == 0) return x;
  long shift = 2 * kBits - length_in_bits(x.mantissa());
  if ((x.exponent() - shift) % 2 != 0) ++shift;
  mpz_class m = shifted(x.mantissa(), shift);
  if (shift < 0) ++m;  // for the truncated bits
  return {sqrt(m) + 1, (x.exponent() - shift) / 2};
}

Vector operator+(const Vector& u, const Vector& v) {
  return {u[0] + v[0], u[1] + v[1], u[2] + v[2]};
}
Vector operator-(const Vector& u, const Vector& v) {
  return {u[0] - v[0], u[1] - v[1], u[2] - v[2]};
}
Vector operator*(const Dyadic& factor, const Vector& v) {
  return {factor * v[0], factor * v[1], factor * v[2]};
}

Dyadic dot(const Vector& u, const Vector& v) {
  Dyadic sum = u[0] * v[0];
  sum.add_product(u[1], v[1]).add_product(u[2], v[2]);
  return sum;
}

Vector cross(const Vector& u, const Vector& v) {
  Vector w{u[1] * v[2], u[2] * v[0], u[0] * v[1]};
  w[0].subtract_product(u[2], v[1]);
  w[1].subtract_product(u[0], v[2]);
  w[2].subtract_product(u[1], v[0]);
  return w;
}

bool is_zero(const Vector& v) {
  return v[0].sign() == 0 && v[1].sign() == 0 && v[2].sign() == 0;
}

Vector turned(const Rows& rows, const Vector& v) {
  return {dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)};
}

Vector turned_back(const Rows& rows, const Vector& v) {
  Vector w = v[0] * rows[0];
  for (std::size_t k = 0; k < 3; ++k) w[k].add_product(v[1], rows[1][k]).add_product(v[2], rows[2][k]);
  return w;
}

Dyadic length_above(const Vector& v) {
  return root_above(dot(v, v));
}

}  // namespace clearance::certificate_oracle
