// The error bounds of double-double arithmetic that docs/trust/bounds.md cites and derives, compared with exact
// rationals.
#include <gmpxx.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "engine/base/arithmetic.h"
#include "tests/oracle/cases/cases.h"

namespace clearance::exact {
namespace {

constexpr int kTries = 40000;

mpq_class exact(const DoubleDouble& x) {
  return mpq_class(x.hi) + mpq_class(x.lo);
}
/// In units of u^2 = 2^-106.
double in_units(const mpq_class& relative) {
  return mpq_class(abs(relative)).get_d() * 0x1p106;
}

/// Leading parts just above and below powers of two, where relative errors are the largest, trailing parts of maximum
/// size, and random ones.
DoubleDouble hard(Random& random) {
  double hi = 1 + (random.chance(0.5) ? random.uniform() : random.integer(0, 64) * 0x1p-52);
  if (random.chance(0.2)) hi = 2 - random.integer(1, 64) * 0x1p-52;
  if (random.chance(0.1)) hi = std::sqrt(2.0) + random.integer(-8, 8) * 0x1p-52;
  const double half_ulp = 0x1p-53;
  double lo = (random.chance(0.5) ? random.uniform() : 1 - random.integer(1, 64) * 0x1p-53) * half_ulp * random.sign();
  if (random.chance(0.1)) lo = 0;
  const DoubleDouble x = dd::two_sum(hi, lo);
  const double s = std::ldexp(random.sign(), random.integer(-40, 40));
  return {s * x.hi, s * x.lo};
}

/// The largest error of an operation in units of u^2.
/// \param relative_error of its result, for two operands
template <class Error>
double worst(std::uint64_t seed, Error relative_error) {
  Random random(seed);
  double most = 0;
  for (int i = 0; i < kTries; ++i) {
    const DoubleDouble a = hard(random), b = hard(random);
    most = std::max(most, in_units(relative_error(a, b)));
  }
  return most;
}

void expect_bound(const char* what, double most, double bound) {
  std::printf("%s: %.2f u^2, of at most %.3g\n", what, most, bound);
  EXPECT_LE(most, bound) << what;
  EXPECT_GT(most, bound / 8) << what << ": the operands are not hard, or the bound is far off";
  EXPECT_LE(bound * 0x1p-106, Arithmetic<DoubleDouble>::kUnit) << what;
}

TEST(DoubleDouble, SumsAreWithinTheirBound) {
  expect_bound("sum",
               worst(1,
                     [](const DoubleDouble& a, const DoubleDouble& b) {
                       const mpq_class sum = exact(a) + exact(b);
                       return sum == 0 ? mpq_class(0) : mpq_class((exact(a + b) - sum) / sum);
                     }),
               3);
}

TEST(DoubleDouble, ProductsAreWithinTheirBound) {
  expect_bound("product",
               worst(2,
                     [](const DoubleDouble& a, const DoubleDouble& b) {
                       const mpq_class product = exact(a) * exact(b);
                       return mpq_class((exact(a * b) - product) / product);
                     }),
               7);
}

TEST(DoubleDouble, QuotientsAreWithinTheirBound) {
  expect_bound("quotient",
               worst(3, [](const DoubleDouble& a,
                           const DoubleDouble& b) { return mpq_class(exact(a / b) * exact(b) / exact(a) - 1); }),
               10);
}

TEST(DoubleDouble, RootsAreWithinTheirBound) {
  // sqrt(x)(1 + e) squared is x (1 + 2 e + e^2), and e^2 is far below u^2's units.
  expect_bound("root",
               worst(4,
                     [](const DoubleDouble& a, const DoubleDouble&) {
                       const DoubleDouble x = abs(a), root = sqrt(x);
                       return mpq_class((exact(root) * exact(root) / exact(x) - 1) / 2);
                     }),
               33.0 / 8);
}

}  // namespace
}  // namespace clearance::exact
