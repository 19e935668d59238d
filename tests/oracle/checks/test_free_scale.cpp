// Compares free regions of joint space with the exact distance within them. Linked once with the engine, and once with
// a faulty one that returns a tenth more (CMakeLists.txt).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "tests/oracle/cases/link_scene.h"

namespace clearance::exact {
namespace {

struct Findings {
  int sampled = 0;
  int misses = 0;  // positions within the region where a pair is within its margin
  int free = 0;    // regions that are not empty
};

// Corners of regions and positions in them.
void sample(test::RobotRandom& random, const LinkScene& scene, Findings& findings) {
  const std::size_t width = scene.joints().size();
  std::vector<double> weights(width);
  for (double& w : weights) w = random.below(4) == 0 ? 0 : random.uniform(0.1, 2);
  const std::vector<double> row = scene.row();
  const double margin = random.below(2) ? 0 : 0.02;
  QueryView query;
  query.joints = scene.joints();
  query.positions = row;
  query.configuration_count = 1;
  query.margin = margin;
  const double scale = scene.engine().free_scale(query, weights).at(0);
  if (scale == 0) return;
  ++findings.free;
  ASSERT_TRUE(std::isfinite(scale) && scale > 0);
  query.margin = 0;
  const std::vector<BodyPair> pairs = scene.engine().pairs(query);
  for (int i = 0; i < 12; ++i) {
    std::vector<double> moved = row;
    for (std::size_t j = 0; j < width; ++j) {
      const double most = scale * weights[j] * (1 - 1e-12);
      moved[j] += i % 2 ? (random.below(2) ? most : -most) : random.uniform(-most, most);
    }
    for (const Real& exact_value : scene.exact_values(pairs, moved)) findings.misses += exact_value <= margin;
    ++findings.sampled;
  }
}

Findings run() {
  test::RobotRandom random(21);
  Findings findings;
  for (int i = 0; i < 40; ++i) {
    const LinkScene scene(random, {.travel = i % 2 ? 1.0 : 0.0});
    sample(random, scene, findings);
  }
  std::printf("%d positions in %d regions: %d misses\n", findings.sampled, findings.free, findings.misses);
  return findings;
}

// An arm of 1 m whose tip rotates straight into a ball 1 mm away: nearly all of that is free.
struct TightCase {
  double scale, gap;
};
TightCase tight(double w = 2) {
  constexpr double kRadius = 0x1p-8, kGap = 0x1p-10;
  const TemporaryFolder folder;
  const std::string urdf =
      folder.write("arm.urdf",
                   "<robot name='a'><link name='base'/><link name='tip'><collision><origin xyz='1 0 0'/><geometry>"
                   "<sphere radius='0.00390625'/></geometry></collision></link><joint name='turn' type='continuous'>"
                   "<parent link='base'/><child link='tip'/><axis xyz='0 0 1'/></joint></robot>");
  engine::Scene scene;
  scene.add_sphere("ball", kRadius, {.pose = Pose{{1, 2 * kRadius + kGap, 0}}});
  scene.add_robot("r", {.urdf = urdf, .home = {{}}});
  const engine::Engine engine(std::move(scene), test::kWithoutCovers);
  const std::uint32_t joint = 0;
  const double row[] = {0}, weight[] = {w};
  QueryView query;
  query.joints = {&joint, 1};
  query.positions = row;
  query.configuration_count = 1;
  const double scale = engine.free_scale(query, weight).at(0);
  const double q = w * scale;
  return {scale, std::hypot(1 - std::cos(q), 2 * kRadius + kGap - std::sin(q)) - 2 * kRadius};
}

TEST(FreeScale, HoldsWhereverItIsSampled) {
  const Findings found = run();
  EXPECT_GT(found.free, 20);
  EXPECT_GT(found.sampled, 200);
  EXPECT_EQ(found.misses, 0);
}

TEST(FreeScale, IsNearlyAllThereIs) {
  const TightCase found = tight();
  EXPECT_GT(found.gap, 0);
  EXPECT_LT(found.gap, 0.01 * 0x1p-10);
}

// A power of two in the weight is one in the scale, within the range of float64; only a scale without motion is
// infinite.
TEST(FreeScale, WeightsMayHaveAnySize) {
  const double one = tight(1).scale;
  for (const int exponent : {1, -1000, 1000, 1023, -1022, -1030}) {
    const double scale = tight(std::ldexp(1.0, exponent)).scale;
    EXPECT_NEAR(std::ldexp(scale, exponent) / one, 1, exponent > 900 ? 1e-4 : 1e-12) << exponent;
    EXPECT_LE(std::ldexp(scale, exponent), one) << exponent;
  }
  EXPECT_EQ(tight(0x1p-1074).scale, std::numeric_limits<double>::max()) << "the largest number there is";
  EXPECT_EQ(tight(0).scale, std::numeric_limits<double>::infinity());
}

TEST(FreeScale, SaysWhatItDoesNotAnswer) {
  test::RobotRandom random(22);
  const LinkScene scene(random, {});
  const std::size_t width = scene.joints().size();
  const std::vector<double> row = scene.row();
  std::vector<double> weights(width, 1.0);
  QueryView query;
  query.configuration_count = 1;
  query.joints = scene.joints();
  query.positions = row;
  const auto text = [&] {
    try {
      scene.engine().free_scale(query, weights);
    } catch (const engine::QueryError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(text(), "");
  std::fill(weights.begin(), weights.end(), 0.0);
  EXPECT_EQ(scene.engine().free_scale(query, weights).at(0) == 0, false) << "nothing moves: all of it, or nothing";
  weights[1] = -1;
  EXPECT_EQ(text(), "free_scale: weights[1]: expected a finite number >= 0, got -1.000000");
  weights.pop_back();
  EXPECT_EQ(text(), "free_scale: weights: expected " + std::to_string(width) + " numbers, one for each joint, got " +
                        std::to_string(width - 1));
  query.joints = {};
  query.positions = {};
  query.configuration_count = 0;
  EXPECT_EQ(text(), "free_scale: expected joints, and their positions");
}

}  // namespace
}  // namespace clearance::exact
