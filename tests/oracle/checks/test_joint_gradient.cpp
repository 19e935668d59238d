// Compares the column gradient_joints with differences of the exact distance between positions on either side.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/engine/evaluate_query.h"
#include "tests/oracle/cases/link_scene.h"

namespace clearance::exact {
namespace {

using test::Answer;
using test::evaluate;

constexpr std::uint32_t kCount = 5;

struct GradientQuery {
  QueryView query;
  std::vector<double> rows;
};

GradientQuery query_of(const LinkScene& scene) {
  GradientQuery q;
  for (std::uint32_t k = 0; k < kCount; ++k) {
    const std::vector<double> row = scene.row();
    q.rows.insert(q.rows.end(), row.begin(), row.end());
  }
  q.query.joints = scene.joints();
  q.query.positions = q.rows;
  q.query.configuration_count = kCount;
  q.query.rel_tol = 1e-12;
  q.query.fields = kDefaultFields | kFieldFlags | kFieldPair | kFieldGradientJoints;
  return q;
}

// (P, J) d distance / d position.
std::vector<double> differences(const LinkScene& scene, std::span<const BodyPair> pairs, std::span<const double> row) {
  constexpr double kStep = 0x1p-24;  // positions are exact, and its square is below the comparison's tolerance
  std::vector<double> slopes(pairs.size() * row.size());
  for (std::size_t j = 0; j < row.size(); ++j) {
    std::vector<double> less(row.begin(), row.end()), more = less;
    less[j] -= kStep;
    more[j] += kStep;
    const std::vector<Real> below = scene.exact_values(pairs, less), above = scene.exact_values(pairs, more);
    for (std::size_t p = 0; p < pairs.size(); ++p)
      slopes[p * row.size() + j] = static_cast<double>((above[p] - below[p]) / (Real(more[j]) - Real(less[j])));
  }
  return slopes;
}

TEST(JointGradient, IsTheSlopeOfTheExactDistance) {
  test::RobotRandom random(11);
  int compared = 0, zero = 0, both_move = 0, held = 0;
  for (int i = 0; i < 25; ++i) {
    const LinkScene scene(random, {.travel = i % 2 ? 1.0 : 0.0, .far = i % 5 ? 0.0 : 2.0});
    const GradientQuery q = query_of(scene);
    const std::vector<BodyPair> pairs = scene.engine().pairs(q.query);
    const Answer answer = evaluate(scene.engine(), q.query);
    const std::size_t width = scene.joints().size();
    ASSERT_EQ(answer.size.joints, width);
    for (std::uint32_t k = 0; k < kCount; ++k) {
      const std::vector<double> slopes = differences(scene, pairs, std::span(q.rows).subspan(k * width, width));
      for (std::size_t p = 0; p < pairs.size(); ++p) {
        const std::size_t row = k * pairs.size() + p;
        if (!(answer.view.lower[row] > 0.01) || (answer.view.flags[row] & kFlagNonsmooth)) continue;
        both_move += pairs[p].b != scene.body("cup") && pairs[p].a > 1;
        held += pairs[p].b == scene.body("cup");
        for (std::size_t j = 0; j < width; ++j, ++compared) {
          const double slope = slopes[p * width + j];
          EXPECT_NEAR(answer.view.gradient_joints[row * width + j], slope, 1e-6)
              << "pair " << pairs[p].a << ", " << pairs[p].b << ", joint " << j << " of scene " << i;
          zero += answer.view.gradient_joints[row * width + j] == 0;
        }
      }
    }
  }
  EXPECT_GT(compared, 10000);
  EXPECT_GT(zero, 1000) << "joints that move neither body, or both alike";
  EXPECT_LT(zero, compared / 2 + compared / 4);
  EXPECT_GT(both_move, 300);
  EXPECT_GT(held, 300);
}

TEST(JointGradient, IsThatOfTheRowsPairInEveryReduction) {
  test::RobotRandom random(12);
  const LinkScene scene(random, {.travel = 0.5});
  GradientQuery q = query_of(scene);
  const std::vector<BodyPair> pairs = scene.engine().pairs(q.query);
  const Answer dense = evaluate(scene.engine(), q.query);
  const std::size_t width = scene.joints().size();
  for (const Reduce reduce : {Reduce::kWithin, Reduce::kNearest, Reduce::kMin}) {
    q.query.reduce = reduce;
    const Answer reduced = evaluate(scene.engine(), q.query);
    const std::uint64_t rows_each = reduced.info.rows / kCount;
    int compared = 0;
    for (std::uint64_t r = 0; r < reduced.info.rows; ++r) {
      const auto pair = std::find(pairs.begin(), pairs.end(), reduced.view.pair[r]);
      const double* const slopes = reduced.view.gradient_joints + r * width;
      if (pair == pairs.end()) {
        EXPECT_TRUE(std::isnan(slopes[0])) << "a body that has no pair";
        continue;
      }
      const std::uint64_t k = reduce == Reduce::kWithin ? reduced.view.configuration[r] : r / rows_each;
      const double* const expected = dense.view.gradient_joints + (k * pairs.size() + (pair - pairs.begin())) * width;
      for (std::size_t j = 0; j < width; ++j, ++compared) EXPECT_NEAR(slopes[j], expected[j], 1e-9);
    }
    EXPECT_GE(compared, static_cast<int>(kCount * width));
  }
  q.query.reduce = Reduce::kAny;
  q.query.margin = 100;
  const Answer any = evaluate(scene.engine(), q.query);
  for (std::size_t i = 0; i < kCount * width; ++i) EXPECT_TRUE(std::isfinite(any.view.gradient_joints[i]));
  q.query.margin = 0;
  q.query.reduce = Reduce::kMin;
  q.query.max_distance = 1e-9;
  const Answer beyond = evaluate(scene.engine(), q.query);
  for (std::size_t k = 0; k < kCount; ++k)
    if (beyond.view.status[k] == static_cast<std::uint8_t>(Status::kBeyond)) {
      EXPECT_TRUE(std::isnan(beyond.view.gradient_joints[k * width])) << "there are no witness points";
    }
}

TEST(JointGradient, SomeJointsOfAnArmOnAnother) {
  const TemporaryFolder folder;
  const std::string urdf = folder.write(
      "arm.urdf",
      "<robot name='a'><link name='base'/><link name='tip'><collision><origin xyz='1 0 0'/><geometry>"
      "<sphere radius='0.125'/></geometry></collision></link><joint name='turn' type='continuous'><parent link='base'/>"
      "<child link='tip'/><axis xyz='0 0 1'/></joint></robot>");
  engine::Scene scene;
  scene.add_sphere("ball", 0.125, {.pose = Pose{{1, 3, 0}}});
  scene.add_robot("lower", {.urdf = urdf, .home = {{}}});
  scene.add_robot("upper", {.urdf = urdf, .parent = "lower/tip", .base = Pose{{1, 0, 0}}, .home = {{}}});
  const BodyPair pairs[] = {{0, scene.find_body("upper/tip")},
                            {scene.find_body("lower/tip"), scene.find_body("upper/tip")}};
  const std::uint32_t joints[] = {scene.find_joint("upper/turn"), scene.find_joint("lower/turn")};
  const engine::Engine engine(std::move(scene), test::kWithoutCovers);
  const double row[] = {M_PI / 2, 0};  // the upper tip is at (1, 1, 0), 2 m under the ball
  QueryView query;
  query.pairs = pairs;
  query.all_pairs = false;
  query.joints = joints;
  query.positions = row;
  query.configuration_count = 1;
  query.fields = kDefaultFields | kFieldGradientJoints;
  const Answer answer = evaluate(engine, query);
  EXPECT_NEAR(answer.view.gradient_joints[0], 0, 1e-9) << "the upper joint moves it across";
  EXPECT_NEAR(answer.view.gradient_joints[1], -1, 1e-9) << "the lower joint lifts it";
  EXPECT_EQ(answer.view.gradient_joints[3], 0) << "the lower joint carries both";
  EXPECT_NEAR(answer.view.gradient_joints[2], 0, 1e-9);
  query.joints = std::span(joints).subspan(1, 1);
  query.positions = std::span(row).subspan(1, 1);
  EXPECT_EQ(evaluate(engine, query).size.joints, 1u);
}

TEST(JointGradient, WithoutJointsItIsRejectedByName) {
  engine::Scene scene;
  scene.add_sphere("a", 1, {.pose = Pose{}});
  const engine::Engine engine(std::move(scene), test::kWithoutCovers);
  QueryView query;
  query.fields = kDefaultFields | kFieldGradientJoints;
  try {
    engine.size(query);
    FAIL();
  } catch (const engine::QueryError& error) {
    EXPECT_STREQ(error.what(), "fields: gradient_joints is for a query with joints");
  }
}

}  // namespace
}  // namespace clearance::exact
