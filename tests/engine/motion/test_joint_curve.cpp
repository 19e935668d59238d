// Curves of joints compared with 60 digits: positions, and the bounds on them in a span of time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <span>
#include <vector>

#include "engine/selection/curve_sides.h"
#include "engine/selection/joint_curve.h"
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

// Curves of some joints, of one degree.
struct Joints {
  std::vector<std::vector<double>> points;
  std::vector<JointCurve> curves;
  CurveSpan span;

  void add(std::vector<double> of_one) {
    points.push_back(std::move(of_one));
    curves.push_back(curve_of(points.back()));
  }
  void take_span(double begin, double end) {
    std::vector<double> part((curves[0].degree() + 1) * curves.size());
    for (std::size_t j = 0; j < curves.size(); ++j) curves[j].part(begin, end, &part[j], curves.size());
    span.take(curves, part.data(), 0.5 * (end - begin));
  }
  /// Positions relative to those in the middle, at a time after it.
  std::vector<Real> at(const Real& middle, const Real& s) const {
    std::vector<Real> q;
    for (const auto& p : points)
      q.push_back(test::real_curve(p.data(), p.size(), 1, middle + s) -
                  test::real_curve(p.data(), p.size(), 1, middle));
    return q;
  }
};

const Real kDigits("1e-45");  // rounding of 60 digits

// At 100 times of a span, an r exists with which the bounds of all joints hold.
void expect_bounds(const Joints& joints, double begin, double end) {
  const Real middle = (Real(begin) + Real(end)) / 2, h = (Real(end) - Real(begin)) / 2;
  const CurveSpan& span = joints.span;
  for (int k = -50; k <= 50; ++k) {
    const Real s = h * k / 50;
    const std::vector<Real> q = joints.at(middle, s);
    Real low = s > 0 ? Real(0) : -h, high = s < 0 ? Real(0) : h;
    for (std::size_t j = 0; j < q.size(); ++j) {
      const JointSpan& joint = span.joints()[j];
      ASSERT_LE(abs(q[j]), Real(joint.change) * h + kDigits);
      const Real rest = Real(joint.bend) * h * h / 2 + kDigits;
      if (joint.slope == 0) {
        ASSERT_LE(abs(q[j]), rest);
        continue;
      }
      const Real one = (q[j] - rest) / joint.slope, other = (q[j] + rest) / joint.slope;
      low = std::max<Real>(low, std::min<Real>(one, other));
      high = std::min<Real>(high, std::max<Real>(one, other));
    }
    ASSERT_LE(low, high) << k;
  }
}

TEST(JointCurve, SpansHoldTheExactCurve) {
  RobotRandom random(1);
  int checked = 0;
  for (int n = 0; n < 400; ++n) {
    Joints joints;
    joints.add(random_points(random));
    for (int j = random.below(4); j > 0; --j) {
      std::vector<double> more = random_points(random);
      more.resize(joints.points[0].size(), more[0]);
      joints.add(more);
    }
    const double length = std::ldexp(1.0, -static_cast<int>(random.below(random.below(4) ? 8 : 42)));
    const double begin = length * std::floor(random.uniform(0, 1 / length)), middle = begin + length / 2;
    joints.take_span(begin, begin + length);
    expect_bounds(joints, begin, begin + length);
    if (HasFatalFailure()) FAIL() << "curves " << n;
    for (std::size_t j = 0; j < joints.curves.size(); ++j) {
      const JointSpan& joint = joints.span.joints()[j];
      const std::vector<double>& p = joints.points[j];
      ASSERT_LE(abs(Real(joints.curves[j].at(middle)) - test::real_curve(p.data(), p.size(), 1, Real(middle))),
                Real(joints.curves[j].rounding()));
      ASSERT_LE(std::abs(joint.slope), joint.change);
      ++checked;
    }
  }
  EXPECT_GT(checked, 800);
}

TEST(JointCurve, ShortSpansAreTight) {
  RobotRandom random(2);
  for (int n = 0; n < 60; ++n) {
    Joints joints;
    const int count = 3 + random.below(6);
    for (int j = 0; j < 3; ++j) {
      std::vector<double> points(static_cast<std::size_t>(count));
      for (double& p : points) p = random.uniform(-2, 2);
      joints.add(points);
    }
    const double begin = random.below(64) / 64.0, end = begin + 1.0 / 64;
    joints.take_span(begin, end);
    const Real middle = (Real(begin) + Real(end)) / 2, h = Real(end - begin) / 2;
    const std::vector<Real> first = joints.at(middle, -h), last = joints.at(middle, h);
    Real squared = 0;
    for (int j = 0; j < 3; ++j) squared += (last[j] - first[j]) * (last[j] - first[j]);
    std::vector<Real> way(3, 0), rest(3, 0);
    for (int k = -50; k <= 50; ++k) {
      const std::vector<Real> q = joints.at(middle, h * k / 50);
      Real r = 0;
      for (int j = 0; j < 3; ++j) r += (last[j] - first[j]) * q[j] / squared;
      for (int j = 0; j < 3; ++j) {
        way[j] = std::max<Real>(way[j], abs(q[j]));
        rest[j] = std::max<Real>(rest[j], abs(q[j] - (last[j] - first[j]) * r));
      }
    }
    for (int j = 0; j < 3; ++j) {
      const JointSpan& joint = joints.span.joints()[static_cast<std::size_t>(j)];
      EXPECT_LE(Real(joint.change) * h, 1.1 * (way[j] + rest[j]) + 1e-4);
      EXPECT_LE(Real(joint.bend) * h * h / 2, 1.3 * rest[j] + 1e-4);
    }
  }
}

// Joints that move along one line are a straight motion, at any speed.
TEST(JointCurve, ALineHasNoRemainder) {
  Joints joints;
  for (const double to : {1.0, -0.25}) joints.add({0, 0, 0, to, to, to});
  joints.take_span(0, 1);
  for (const JointSpan& joint : joints.span.joints()) {
    EXPECT_LT(joint.bend, 1e-12);
    EXPECT_NEAR(std::abs(joint.slope), joint.change, 1e-8);
  }
  CurveSides sides;
  sides.take(joints.curves, 0, 0.5, 1);
  for (const CurveSides::Curve& curve : sides.curves()) EXPECT_LT(curve.rest, 1e-6);
  EXPECT_NEAR(sides.pace(1), 0.5 / 0.9375, 1e-5);
}

TEST(JointCurve, AJointThatStaysHasNoRates) {
  Joints joints;
  joints.add(std::vector<double>(5, 0.1));
  joints.take_span(0.25, 0.375);
  const JointSpan& span = joints.span.joints()[0];
  EXPECT_EQ(joints.curves[0].at(0.3125), 0.1);
  EXPECT_EQ(span.slope, 0);
  EXPECT_EQ(span.change, 0);
  EXPECT_EQ(span.bend, 0);
  EXPECT_EQ(curve_of(joints.points[0]).rounding(), 0);
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

// Such a joint has no positions; the others have the bounds that they have without it.
TEST(JointCurve, AJointBeyondAllPositionsDoesNotAffectOthers) {
  const std::vector<double> usual{0, 3, 0.5};
  for (const double far : {2e6, 1e155, 1e200, HUGE_VAL, std::nan("")}) {
    Joints alone, both;
    alone.add(usual);
    both.add({far, 0, 0});
    both.add(usual);
    alone.take_span(0.25, 0.75);
    both.take_span(0.25, 0.75);
    const JointSpan &expected = alone.span.joints()[0], &got = both.span.joints()[1];
    EXPECT_GE(got.change, 0.9 * expected.change) << far;
    EXPECT_GE(std::abs(got.slope) + got.bend, 0.9 * (std::abs(expected.slope) + expected.bend)) << far;
  }
}

// Both sides of a time, with the progress that belongs to its control points.
void expect_sides(const Joints& joints, const CurveSides& sides, double time, const double (&ends)[2]) {
  for (int side = 0; side < 2; ++side) {
    const std::span<const double> progress = sides.progress(side);
    for (const double r : progress) EXPECT_TRUE(0 <= r && r <= 1 && std::abs(r * 1e6 - std::round(r * 1e6)) < 1e-9);
    for (int k = 0; k <= 16; ++k) {
      const Real x = Real(k) / 16, t = Real(time) + (Real(ends[side]) - Real(time)) * x;
      const Real r = test::real_curve(progress.data(), progress.size(), 1, x);
      ASSERT_LE(r * sides.pace(side), x + kDigits);
      const std::vector<Real> q = joints.at(time, t - time);
      for (std::size_t j = 0; j < q.size(); ++j) {
        const CurveSides::Curve& curve = sides.curves()[j];
        ASSERT_LE(abs(q[j]), Real(curve.way) + kDigits);
        ASSERT_LE(abs(q[j] - r * curve.chord[side]), Real(curve.rest) + kDigits);
        ASSERT_LE(abs(curve.chord[side]) + curve.rest, curve.change);
      }
    }
  }
}

// Three curves of one degree; on a line in one of two cases.
Joints random_joints(RobotRandom& random, bool is_on_line) {
  Joints joints;
  const std::vector<double> first = random_points(random);
  joints.add(first);
  while (joints.points.size() < 3) {
    std::vector<double> points = random_points(random);
    const double by = random.uniform(-2, 2), size = std::pow(10.0, random.uniform(-6, 1));
    points.resize(first.size());
    for (std::size_t i = 0; i < first.size(); ++i)
      points[i] = is_on_line ? by * (first[i] - first[0]) : size * random.uniform(-1, 1);
    joints.add(points);
  }
  return joints;
}

TEST(JointCurve, SidesHoldTheExactCurve) {
  RobotRandom random(17);
  int lines = 0, bent = 0, rounded = 0;
  for (int i = 0; i < 2000; ++i) {
    const bool is_on_line = random.below(2);
    const Joints joints = random_joints(random, is_on_line);
    double begin = random.uniform(0, 1), end = random.uniform(0, 1);
    if (random.below(2)) end = begin + std::pow(10.0, random.uniform(-12, -1)) * (1 - begin);
    if (end < begin) std::swap(begin, end);
    const double time = random.below(4) ? begin + random.uniform(0, 1) * (end - begin) : random.below(2) ? begin : end;
    CurveSides sides;
    sides.take(joints.curves, begin, time, end);
    expect_sides(joints, sides, time, {begin, end});
    const CurveSides::Curve& first = sides.curves()[0];
    rounded += first.way > 0 && joints.curves[0].rounding() > 1e-3 * first.way;
    const double chord = std::max(std::abs(first.chord[0]), std::abs(first.chord[1]));
    if (first.way > 1e6 * joints.curves[0].rounding()) {
      lines += is_on_line && chord > 0 && first.rest < 1e-4 * chord;
      bent += !is_on_line && first.rest > 0.01 * chord;
    }
  }
  std::printf("%d lines, %d bent, %d rounded\n", lines, bent, rounded);
  EXPECT_GT(lines, 100);
  EXPECT_GT(bent, 100);
  EXPECT_GT(rounded, 100);
}

TEST(JointCurve, TheMiddleDividesItsLength) {
  Joints joints;
  joints.add({0, 0, 0, 1, 1, 1});
  joints.add({5, 5, 5, 3, 3, 3});
  for (double begin = 0, end = 1; end > 1e-4;) {
    const double middle = middle_of_length(joints.curves, begin, end), grid = std::exp2(5 - std::floor(std::log2(end)));
    ASSERT_EQ(middle * grid, std::floor(middle * grid));
    const double before = joints.curves[0].at(middle) - joints.curves[0].at(begin),
                 after = joints.curves[0].at(end) - joints.curves[0].at(middle);
    EXPECT_LT(std::abs(before - after), 0.25 * (before + after)) << end;
    end = middle;
  }
  Joints still;
  still.add({1, 1, 1});
  EXPECT_EQ(middle_of_length(still.curves, 0.25, 0.75), 0.5);
}

}  // namespace
}  // namespace clearance
