// Motions of joints along curves, through the engine.
#include <gtest/gtest.h>

#include <cstdio>
#include <functional>

#include "engine/selection/joint_curve.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/motion/motion_test.h"
#include "tests/engine/robot/exact_curve.h"
#include "tests/temporary_folder.h"

namespace clearance::test {
namespace {

constexpr double kThin = 1e-4, kTip = 1e-5;  // a plate's thickness, the radius of an arm's tip

// An arm of 1 m that turns about z, and a plate across its way at an angle.
engine::Scene arm_and_plate(double angle) {
  engine::Scene scene;
  const TemporaryFolder folder;
  engine::RobotOptions options;
  options.urdf = folder.write(
      "r.urdf",
      "<robot name='r'><link name='base'/><link name='tip'><collision><origin xyz='1 0 0'/><geometry><sphere "
      "radius='0.00001'/></geometry></collision></link><joint name='turn' type='revolute'><parent link='base'/><child "
      "link='tip'/><axis xyz='0 0 1'/><limit lower='-3' upper='3'/></joint></robot>");
  options.home.emplace();
  scene.add_robot("r", options);
  Pose X{{std::cos(angle), std::sin(angle), 0}};
  X.qw = std::cos(angle / 2);
  X.qz = std::sin(angle / 2);
  scene.add_box("plate", {0.02, kThin, 0.02}, {.is_static = true, .pose = X});
  return scene;
}

Motions curve_of(const std::vector<double>& points) {
  Motions motion;
  motion.joints = {0};
  motion.points = static_cast<std::uint32_t>(points.size());
  motion.positions = points;
  return motion;
}

// A spline overshoots its knots by a third: to 0.9, while both ends are at 0.
TEST(Curves, APlateThatSamplesMissIsFound) {
  const Motions motion = curve_of({0, 1.2, 1.2, 0});
  int hits = 0, free = 0;
  Random random(3);
  for (int i = 0; i < 60; ++i) {
    const double beyond = 0.9 + 0.5 * kThin + kTip;  // angle at which a plate is touched, but for a few 1e-10
    const double graze = std::pow(10, random.uniform(-7, -4)) * (i % 2 ? 1 : -1);
    const engine::Engine engine = engine_of(arm_and_plate(i % 3 ? beyond + graze : random.uniform(0.05, 0.85)));
    const Answer any = evaluate(engine, motion.view(Reduce::kAny)), min = evaluate(engine, motion.view(Reduce::kMin));
    const bool is_free = i % 3 && graze > 0;
    EXPECT_EQ(static_cast<Status>(any.view.status[0]) == Status::kBeyond, is_free) << i << ' ' << graze;
    hits += !is_free;
    free += is_free;
    if (is_free) {
      EXPECT_LE(min.view.lower[0], graze + 1e-9);
      EXPECT_GE(min.view.upper[0], graze - 1e-9);
      continue;
    }
    EXPECT_LE(min.view.lower[0], 1e-9);
    const double t = any.view.first_contact[1], q = 3.6 * t * (1 - t);
    EXPECT_LE(any.view.first_contact[0], t);
    const Motions at = curve_of({q, q});
    const Answer there = evaluate(engine, at.view(Reduce::kMin));
    EXPECT_LE(there.view.lower[0], 1e-9);
  }
  EXPECT_GT(hits, 30);
  EXPECT_GT(free, 15);
}

// Motions of the arm, random within limits.
struct ArmCurves {
  engine::Scene scene = arm_scene(at_home());
  std::vector<std::uint32_t> joints = joints_of(scene, "arm");
  Random random{7};

  /// \param make fills the control points of one joint, given two positions
  Motions curves(std::uint32_t points, int count, double size,
                 const std::function<void(double, double, std::vector<double>&)>& make) {
    Motions motions;
    for (const char* link : {"arm/palm", "arm/fore", "arm/flange"})
      for (const char* other : {"table", "ball"})
        motions.pairs.push_back({scene.find_body(link), scene.find_body(other)});
    motions.joints = joints;
    motions.points = points;
    for (int m = 0; m < count; ++m) {
      const std::size_t first = motions.positions.size();
      motions.positions.resize(first + points * joints.size());
      std::vector<double> curve(points);
      for (std::size_t j = 0; j < joints.size(); ++j) {
        const SceneJoint& joint = scene.joints()[joints[j]];
        const double start = random.uniform(joint.lower, joint.upper);
        make(start, start + size * (random.uniform(joint.lower, joint.upper) - start), curve);
        for (std::size_t p = 0; p < points; ++p) motions.positions[first + p * joints.size() + j] = curve[p];
      }
    }
    return motions;
  }
};

// Both ends at rest, with no acceleration: the path is that of the straight motion.
TEST(Curves, AtRestAtBothEndsTakesAtMostTwiceTheSpansOfAStraightMotion) {
  std::uint64_t steps[2] = {0, 0};
  int free[2] = {0, 0};
  for (const int i : {0, 1}) {
    ArmCurves c;
    const Motions motions = c.curves(i == 0 ? 2 : 6, 300, 0.3, [](double start, double end, std::vector<double>& q) {
      for (std::size_t p = 0; p < q.size(); ++p) q[p] = 2 * p < q.size() ? start : end;
    });
    const engine::Engine engine = engine_of(std::move(c.scene));
    const Answer any = evaluate(engine, motions.view(Reduce::kAny));
    for (std::size_t m = 0; m < 300; ++m) {
      steps[i] += any.view.steps[m];
      free[i] += static_cast<Status>(any.view.status[m]) == Status::kBeyond;
    }
  }
  std::printf("300 motions, %d free: %llu spans straight, %llu at rest at both ends\n", free[0],
              static_cast<unsigned long long>(steps[0]), static_cast<unsigned long long>(steps[1]));
  EXPECT_EQ(free[0], free[1]);
  EXPECT_GT(free[0], 20);
  EXPECT_LE(steps[1], 2 * steps[0]);
}

// Straight motions along the chords of cubic curves, as long as they are.
Motions chords_of(const Motions& curves) {
  Motions straight = curves;
  const std::size_t joints = curves.joints.size(), each = curves.points * joints;
  straight.points = 2;
  straight.positions.clear();
  for (std::size_t first = 0; first < curves.positions.size(); first += each) {
    std::vector<double> middle, along;
    double length = 0, chord = 0;
    for (std::size_t j = 0; j < joints; ++j) {
      const double *const q = &curves.positions[first + j], begin = q[0], end = q[each - joints];
      middle.push_back(0.5 * (begin + end));
      along.push_back(0.5 * (end - begin));
      chord += (end - begin) * (end - begin);
    }
    constexpr int kSteps = 100;
    for (int k = 0; k < kSteps; ++k) {
      double squared = 0;
      for (std::size_t j = 0; j < joints; ++j) {
        const JointCurve curve(&curves.positions[first + j], curves.points, joints);
        const double step = curve.at((k + 1.0) / kSteps) - curve.at(double(k) / kSteps);
        squared += step * step;
      }
      length += std::sqrt(squared);
    }
    for (const double way : {-length, length})
      for (std::size_t j = 0; j < joints; ++j)
        straight.positions.push_back(middle[j] + way / std::sqrt(chord) * along[j]);
  }
  return straight;
}

TEST(Curves, BentOnesTakeAtMostTwiceTheSpansOfStraightMotionsOfTheirLength) {
  ArmCurves c;
  const Motions curves = c.curves(4, 300, 0.3, [&](double start, double end, std::vector<double>& q) {
    const auto bend = [&] { return c.random.uniform(-0.3, 0.3) * (end - start); };
    q = {start, start + (end - start) / 3 + bend(), end - (end - start) / 3 + bend(), end};
  });
  const Motions chords = chords_of(curves);
  const engine::Engine engine = engine_of(std::move(c.scene));
  const Answer bent = evaluate(engine, curves.view(Reduce::kAny)),
               straight = evaluate(engine, chords.view(Reduce::kAny));
  std::uint64_t steps[2] = {0, 0}, free = 0;
  for (std::size_t m = 0; m < 300; ++m) {
    if (static_cast<Status>(bent.view.status[m]) != Status::kBeyond ||
        static_cast<Status>(straight.view.status[m]) != Status::kBeyond)
      continue;
    ++free;
    steps[0] += straight.view.steps[m];
    steps[1] += bent.view.steps[m];
  }
  std::printf("%llu free motions: %llu spans straight, %llu along bent curves\n", static_cast<unsigned long long>(free),
              static_cast<unsigned long long>(steps[0]), static_cast<unsigned long long>(steps[1]));
  EXPECT_GT(free, 150u);
  EXPECT_LE(steps[1], 2 * steps[0]);
}

// A straight motion with control points between its ends.
TEST(Curves, MoreControlPointsOfAStraightMotionGiveItsAnswers) {
  for (const std::uint32_t points : {3u, 5u, 8u}) {
    Answer answers[2];
    for (const bool is_straight : {true, false}) {
      ArmCurves c;
      const Motions motions =
          c.curves(is_straight ? 2 : points, 60, 0.3, [](double start, double end, std::vector<double>& q) {
            const double last = static_cast<double>(q.size() - 1);
            for (std::size_t p = 0; p < q.size(); ++p) q[p] = start + static_cast<double>(p) / last * (end - start);
          });
      const engine::Engine engine = engine_of(std::move(c.scene));
      answers[is_straight] = evaluate(engine, motions.view(Reduce::kMin));
    }
    for (std::size_t m = 0; m < 60; ++m) {
      EXPECT_LE(answers[0].view.lower[m], answers[1].view.upper[m]);
      EXPECT_LE(answers[1].view.lower[m], answers[0].view.upper[m]);
      EXPECT_EQ(answers[0].view.status[m], answers[1].view.status[m]);
      EXPECT_LE(answers[0].view.steps[m], 2 * answers[1].view.steps[m] + 2);
    }
  }
}

// Each pair's row holds its distance at all times.
TEST(Curves, RowsHoldSamples) {
  ArmCurves c;
  const Motions motions = c.curves(4, 12, 1, [&](double start, double end, std::vector<double>& q) {
    q = {start, end, start + c.random.uniform(-1, 1), c.random.uniform(-1, 1)};
  });
  const engine::Engine engine = engine_of(std::move(c.scene));
  const Answer none = evaluate(engine, motions.view(Reduce::kNone));
  const std::size_t pairs = none.info.rows / motions.count(), joints = motions.joints.size();
  for (std::uint32_t m = 0; m < motions.count(); ++m) {
    std::vector<double> positions;
    for (int i = 0; i <= 50; ++i)
      for (std::size_t j = 0; j < joints; ++j)
        positions.push_back(
            static_cast<double>(real_curve(motions.positions.data() + 4 * m * joints + j, 4, joints, Real(i) / 50)));
    QueryView query;
    query.pairs = motions.pairs;
    query.all_pairs = false;
    query.joints = motions.joints;
    query.positions = positions;
    query.configuration_count = 51;
    const Answer sampled = evaluate(engine, query);
    for (std::size_t p = 0; p < pairs; ++p) {
      double least = kInf;
      for (std::size_t i = 0; i <= 50; ++i) least = std::min(least, sampled.view.upper[i * pairs + p]);
      EXPECT_LE(none.view.lower[m * pairs + p], least + 1e-9);
      EXPECT_LE(none.view.lower[m * pairs + p], none.view.upper[m * pairs + p]);
    }
  }
}

// The flag is of the curve, not of its control points.
TEST(Curves, LimitsHoldForTheCurve) {
  const engine::Engine engine = engine_of(arm_and_plate(-2.5));
  for (const double top : {3.9, 4.1, -3.9, -4.1}) {
    const Answer any = evaluate(engine, curve_of({0, top, top, 0}).view(Reduce::kMin));  // up to 3/4 of it
    EXPECT_EQ((any.view.flags[0] & kFlagBeyondLimits) != 0, std::abs(top) > 4) << top;
  }
}

TEST(Curves, BadOnesAreRejectedByName) {
  const engine::Engine engine = engine_of(arm_and_plate(1));
  const auto error_of = [&](const std::function<void(QueryView&)>& change) -> std::string {
    const std::vector<double> points(9, 0.0);
    const std::uint32_t joint = 0;
    QueryView query = curve_of({points[0], 0, 0}).view(Reduce::kAny);
    query.joints = std::span(&joint, 1);
    query.positions = points;
    query.configuration_count = 9;
    change(query);
    try {
      evaluate(engine, query);
    } catch (const engine::QueryError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(error_of([](QueryView&) {}), "");
  EXPECT_EQ(error_of([](QueryView& q) { q.control_points = 9; }), "control_points: expected 2 to 8, got 9");
  EXPECT_EQ(error_of([](QueryView& q) { q.control_points = 1; }), "control_points: expected 2 to 8, got 1");
  EXPECT_EQ(error_of([](QueryView& q) { q.control_points = 4; }), "configurations: motions have 4 each, got 9");
  EXPECT_EQ(error_of([](QueryView& q) { q.max_evaluations = 0, q.fields = kDefaultFields; }),
            "control_points: only for motions (max_evaluations)");
  const std::vector<double> growths(2, 0.1);
  EXPECT_EQ(error_of([&](QueryView& q) { q.growths = growths; }), "growths: expected bodies, which grow");
}

}  // namespace
}  // namespace clearance::test
