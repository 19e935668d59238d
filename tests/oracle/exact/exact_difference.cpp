#include "tests/oracle/exact/exact_difference.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <stdexcept>

namespace clearance::exact {

namespace {

/// mantissa * 2^exponent, the mantissa odd or zero.
struct Dyadic {
  long mantissa = 0;
  int exponent = 0;
};

Dyadic dyadic(double v) {
  if (!std::isfinite(v)) throw std::invalid_argument("exact_distance: a number is not finite");
  if (v == 0) return {};
  int exponent;
  long mantissa = static_cast<long>(std::ldexp(std::frexp(v, &exponent), 53));
  exponent -= 53;
  const int zeros = std::countr_zero(static_cast<unsigned long>(mantissa));
  return {mantissa / (1L << zeros), exponent + zeros};
}

/// An integer vector scaled by a power of two so that its largest used component is about 1; the error of each
/// component is below 2^-52 of itself, or 2^-1074 if it underflows. Components not used (all vertices have 0 there)
/// become 0.
Vec3d rounded(const Vec3z& v, const Vec3d& used) {
  double mantissa[3] = {0, 0, 0};
  long exponent[3] = {0, 0, 0}, largest = std::numeric_limits<long>::min();
  for (int k = 0; k < 3; ++k) {
    if (used[k] == 0 || v[k] == 0) continue;
    mantissa[k] = mpz_get_d_2exp(&exponent[k], v[k].get_mpz_t());
    largest = std::max(largest, exponent[k]);
  }
  Vec3d r{0, 0, 0};
  for (int k = 0; k < 3; ++k)
    if (mantissa[k] != 0) r[k] = std::ldexp(mantissa[k], static_cast<int>(std::max(exponent[k] - largest, -5000L)));
  return r;
}

}  // namespace

void LeastExponent::include(double v) {
  if (const Dyadic d = dyadic(v); d.mantissa != 0) value = std::min(value, d.exponent);
}

mpz_class integer(double v, int unit) {
  const Dyadic d = dyadic(v);
  mpz_class z = d.mantissa;
  if (d.mantissa != 0) z <<= static_cast<unsigned>(d.exponent - unit);
  return z;
}

Vec3z integer(const Vec3d& v, int unit) {
  return {integer(v.x, unit), integer(v.y, unit), integer(v.z, unit)};
}

mpq_class rational(double v) {
  dyadic(v);  // throws for NaN and infinity
  return mpq_class(v);
}

PosedPart::PosedPart(const ConvexPartView& part, const Pose& X) : vertices_(part.vertices) {
  if (vertices_.empty()) throw std::invalid_argument("exact_distance: a piece has no vertices");
  for (const Vec3d& v : vertices_) {
    exponent_.include(v);
    for (int k = 0; k < 3; ++k) largest_[k] = std::max(largest_[k], std::abs(v[k]));
  }
  LeastExponent e;
  for (const double q : {X.qw, X.qx, X.qy, X.qz}) e.include(q);
  const mpz_class w = integer(X.qw, e.get()), x = integer(X.qx, e.get()), y = integer(X.qy, e.get()),
                  z = integer(X.qz, e.get());
  n = w * w + x * x + y * y + z * z;
  if (n == 0) throw std::invalid_argument("exact_distance: a quaternion is zero");
  M.row[0] = {w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)};
  M.row[1] = {2 * (x * y + w * z), w * w + y * y - x * x - z * z, 2 * (y * z - w * x)};
  M.row[2] = {2 * (x * z - w * y), 2 * (y * z + w * x), w * w + z * z - x * x - y * y};
  mpz_class common = n;
  for (const Vec3z& row : M.row)
    for (int k = 0; k < 3; ++k) common = gcd(common, row[k]);
  n /= common;
  for (Vec3z& row : M.row)
    for (int k = 0; k < 3; ++k) row[k] /= common;
}

std::uint32_t PosedPart::highest(const Vec3z& direction) const {
  const Vec3z m = M.transpose_times(direction);
  const Vec3d f = rounded(m, largest_);
  // |f.v as computed - its exact value| <= (2^-52 + 4 * 2^-53) sum |f_k v_k|, and a little more if it underflows.
  const double reach = std::abs(f.x) * largest_.x + std::abs(f.y) * largest_.y + std::abs(f.z) * largest_.z;
  const double margin = 0x1p-48 * reach + 0x1p-1060 * (1 + largest_.x + largest_.y + largest_.z);
  approximate_.resize(vertices_.size());
  double best = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    const Vec3d& v = vertices_[i];
    approximate_[i] = f.x * v.x + f.y * v.y + f.z * v.z;
    best = std::max(best, approximate_[i]);
  }
  std::optional<std::uint32_t> winner;
  mpz_class winning, height;
  candidates_.clear();
  for (std::size_t i = 0; i < vertices_.size(); ++i)
    if (!(approximate_[i] < best - 2 * margin)) candidates_.push_back(static_cast<std::uint32_t>(i));
  if (candidates_.size() == 1) return candidates_[0];
  for (const std::uint32_t i : candidates_) {
    height = 0;
    for (int k = 0; k < 3; ++k) add_product(height, m[k], vertices_[i][k]);
    if (!winner || height > winning) {
      winner = i;
      swap(winning, height);
    }
  }
  return *winner;
}

/// sum += m v / 2^exponent_
void PosedPart::add_product(mpz_class& sum, const mpz_class& m, double v) const {
  if (v == 0) return;
  const Dyadic d = dyadic(v);
  product_ = m * d.mantissa;
  product_ <<= static_cast<unsigned>(d.exponent - exponent_.get());
  sum += product_;
}

Difference::Difference(const ConvexPartView& a, const Pose& X_wa, const ConvexPartView& b, const Pose& X_wb)
    : a_(a, X_wa), b_(b, X_wb) {
  LeastExponent e = a_.exponent();
  e.value = std::min(e.value, b_.exponent().value);
  e.include(X_wa.translation);
  e.include(X_wb.translation);
  unit_ = e.get();
  const mpz_class n = a_.n * b_.n;
  offset_ = n * (integer(X_wb.translation, unit_) - integer(X_wa.translation, unit_));
  radius_ = rational(a.radius) + rational(b.radius);
}

Value Difference::value(int sign, const mpz_class& height, const Vec3z& direction) const {
  Value v;
  v.sign = height == 0 ? 0 : sign;
  v.radius = radius_;
  if (v.sign == 0) return v;
  const mpz_class n = a_.n * b_.n;
  v.numerator = height * height;
  v.denominator = squared_norm(direction) * n * n;
  if (unit_ >= 0)
    v.numerator <<= static_cast<unsigned>(2 * unit_);
  else
    v.denominator <<= static_cast<unsigned>(-2 * unit_);
  return v;
}

}  // namespace clearance::exact
