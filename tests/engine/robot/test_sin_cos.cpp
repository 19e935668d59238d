// The engine's sine and cosine compared with 60 digits.
#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <random>

#include "engine/pose/sin_cos.h"
#include "tests/engine/robot/exact_robot.h"

namespace clearance {
namespace {

using test::Real;

constexpr double kUnit = 0x1p-53;

// The larger error of the two, in units of 2^-53.
double error_of(double x, double rest = 0) {
  const SinCos<double> got = sin_cos(x, rest);
  const Real exact = Real(x) + rest;
  const Real off[2] = {abs(got.sine - sin(exact)), abs(got.cosine - cos(exact))};
  return static_cast<double>(off[0] > off[1] ? off[0] : off[1]) / kUnit;
}

TEST(SinCos, AnyAngleIsWithinWhatIsProved) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  double worst = 0;
  for (int i = 0; i < 20'000; ++i) {
    const double x = uniform(random) * (i % 3 == 0 ? 1 : i % 3 == 1 ? 10 : kMaxAngle);
    worst = std::max(worst, error_of(x));
  }
  EXPECT_LE(worst, 1.25);
  EXPECT_GT(worst, 0.6) << "a worst case has been met";
  std::printf("worst of random angles: %.4f units of 2^-53\n", worst);
}

// Angles where all digits cancel in the reduction: the float64 nearest to multiples of a right angle, and next to the
// borders between quadrants, where the series have the largest terms.
TEST(SinCos, AnglesBesideMultiplesOfPiOver4) {
  const Real quarter = atan(Real(1));
  std::mt19937_64 random(2);
  double worst = 0, nearest = 1;
  for (int i = 0; i < 10'000; ++i) {
    const int most = static_cast<int>(kMaxAngle / 0.7854) - 1;
    const int k = i < 200 ? i : std::uniform_int_distribution<int>(-most, most)(random);
    const Real exact = quarter * k;
    const auto x = static_cast<double>(exact);
    if (k != 0 && k % 2 == 0) nearest = std::min(nearest, static_cast<double>(abs(exact - Real(x))));
    for (const double beside : {x, std::nextafter(x, -INFINITY), std::nextafter(x, INFINITY)})
      if (std::abs(beside) <= kMaxAngle) worst = std::max(worst, error_of(beside));
  }
  EXPECT_LE(worst, 1.25);
  EXPECT_LT(nearest, 1e-14) << "angles within 1e-14 of a multiple of a right angle";
  std::printf("worst beside multiples of pi/4: %.4f units; nearest to one of pi/2: %.2g\n", worst, nearest);
}

TEST(SinCos, EndsAndTinyAngles) {
  for (const double x : {0.0, -0.0, 5e-324, 1e-300, -1e-20, 0x1p-27, kMaxAngle, -kMaxAngle, 1.0, 0.7853981633974483})
    EXPECT_LE(error_of(x), 1.25) << x;
  EXPECT_EQ(sin_cos(0.0, 0.0).sine, 0);
  EXPECT_EQ(sin_cos(0.0, 0.0).cosine, 1);
}

// Angles of mimic joints have two parts.
TEST(SinCos, TheSecondPartOfAnAngleCounts) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  double worst = 0, without = 0;
  for (int i = 0; i < 5'000; ++i) {
    const double x = uniform(random) * kMaxAngle, rest = uniform(random) * 0x1p-31;
    worst = std::max(worst, error_of(x, rest));
    const Real off = abs(sin_cos(x, 0.0).sine - sin(Real(x) + rest));
    without = std::max(without, static_cast<double>(off) / kUnit);
  }
  EXPECT_LE(worst, 1.25);
  EXPECT_GT(without, 1e5) << "left out, it would be seen";
}

}  // namespace
}  // namespace clearance
