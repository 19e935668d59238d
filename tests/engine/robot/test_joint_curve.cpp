// Curves of joints compared with 60 digits: positions, and what a span of time claims of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "engine/robot/joint_curve.h"
#include "tests/engine/robot/exact_curve.h"
#include "tests/engine/robot/random_robot.h"

namespace clearance {
namespace {

using test::Real;
using test::RobotRandom;

std::vector<double> random_points(RobotRandom& random) {
  std::vector<double> points(2 + random.below(7));
  const double far = random.below(4) ? 0 : random.uniform(-1e6, 1e6), size = std::pow(10.0, random.uniform(-6, 1));
  for (double& p : points) p = far + size * random.uniform(-1, 1);
  if (random.below(3) == 0)  // at rest at both ends, as far as there are points
    for (std::size_t i = 0; i < points.size(); ++i) points[i] = 2 * i < points.size() ? points.front() : points.back();
  return points;
}
JointCurve curve_of(const std::vector<double>& points) {
  return {points.data(), static_cast<std::uint32_t>(points.size()), 1};
}

// What a curve does in a span, at 200 times.
struct Seen {
  Real middle, way = 0, rest = 0;

  Seen(const std::vector<double>& points, double begin, double end, double slope) {
    const Real m = (Real(begin) + Real(end)) / 2, h = (Real(end) - Real(begin)) / 2;
    middle = test::real_curve(points.data(), points.size(), 1, m);
    for (int k = -100; k <= 100; ++k) {
      const Real s = h * k / 100, q = test::real_curve(points.data(), points.size(), 1, m + s) - middle;
      way = std::max<Real>(way, abs(q));
      rest = std::max<Real>(rest, abs(q - slope * s));
    }
  }
};

TEST(JointCurve, SpansHoldTheExactCurve) {
  RobotRandom random(1);
  int tight = 0, spans = 0;
  for (int n = 0; n < 600; ++n) {
    const std::vector<double> points = random_points(random);
    const JointCurve curve = curve_of(points);
    const double end = std::ldexp(1.0, -static_cast<int>(random.below(random.below(4) ? 8 : 42)));
    const double begin = end * std::floor(random.uniform(0, 1 / end));
    const JointSpan span = curve.span(begin, begin + end);
    const Real h = Real(end) / 2;
    const Seen seen(points, begin, begin + end, span.slope);
    ASSERT_LE(abs(Real(span.middle) - seen.middle), Real(curve.rounding())) << n;
    ASSERT_LE(seen.way, Real(span.change) * h) << n;
    ASSERT_LE(seen.rest, Real(span.bend) * h * h / 2) << n;
    ASSERT_LE(std::abs(span.slope), span.change) << n;
    if (seen.way < 1e6 * curve.rounding()) continue;
    ++spans;
    tight += seen.rest >= 0.5 * Real(span.bend) * h * h / 2;
    EXPECT_LE(Real(span.change) * h, 2.01 * seen.way) << n;
  }
  std::printf("%d of %d spans within twice what remains\n", tight, spans);
  EXPECT_GT(spans, 300);
  EXPECT_GT(tight, spans / 3);
}

TEST(JointCurve, ShortSpansAreTight) {
  RobotRandom random(2);
  for (int n = 0; n < 100; ++n) {
    std::vector<double> points(3 + random.below(6));
    for (double& p : points) p = random.uniform(-2, 2);
    const double begin = random.below(32) / 32.0;
    const JointSpan span = curve_of(points).span(begin, begin + 1.0 / 32);
    const Seen seen(points, begin, begin + 1.0 / 32, span.slope);
    EXPECT_LE(Real(span.change) / 64, 1.05 * seen.way + 1e-4);
    EXPECT_LE(Real(span.bend) / (2 * 64 * 64), 1.2 * seen.rest + 1e-4);
  }
}

TEST(JointCurve, AJointThatStaysHasNoRates) {
  const std::vector<double> points(5, 0.1);
  const JointSpan span = curve_of(points).span(0.25, 0.375);
  EXPECT_EQ(span.middle, 0.1);
  EXPECT_EQ(span.slope, 0);
  EXPECT_EQ(span.change, 0);
  EXPECT_EQ(span.bend, 0);
  EXPECT_EQ(curve_of(points).rounding(), 0);
}

TEST(JointCurve, AStraightLineHasTodaysBits) {
  RobotRandom random(3);
  for (int n = 0; n < 1000; ++n) {
    const std::vector<double> points{random.uniform(-3, 3), random.uniform(-3, 3)};
    const double t = random.below(1 << 20) / double(1 << 20);
    EXPECT_EQ(curve_of(points).at(t), points[0] + t * (points[1] - points[0]));
  }
}

TEST(JointCurve, Limits) {
  // Control points beyond a limit, and a curve that reaches 0.5 halfway.
  const std::vector<double> arc{0, 1, 0};
  EXPECT_TRUE(curve_of(arc).stays_within(0, 0.5));
  EXPECT_TRUE(curve_of(arc).stays_within(0, 0.500001));
  EXPECT_FALSE(curve_of(arc).stays_within(0, 0.4999));
  EXPECT_FALSE(curve_of(arc).stays_within(0.0001, 1));
  EXPECT_TRUE(curve_of({1, 0, 1}).stays_within(0.4999, 1));
  EXPECT_FALSE(curve_of({1, 0, 1}).stays_within(0.5001, 1));
  EXPECT_FALSE(curve_of({0, NAN, 0}).stays_within(-HUGE_VAL, HUGE_VAL));
  EXPECT_TRUE(std::isinf(curve_of({0, NAN, 0}).greatest()));
  EXPECT_TRUE(std::isinf(curve_of({NAN, 0, 0}).least()));
}

}  // namespace
}  // namespace clearance
