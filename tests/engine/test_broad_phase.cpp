// The tree finds what brute force finds; boxes hold what they are boxes of.
#include <gtest/gtest.h>

#include <limits>

#include "engine/broad_phase.h"
#include "engine/evaluate.h"
#include "engine_test_util.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

TEST(BroadPhase, TreeAndBruteForceFindTheSamePairs) {
  Random random(3);
  const auto brute = make_brute_force_broad_phase(), tree = make_tree_broad_phase();
  std::size_t found = 0, possible = 0;
  for (int round = 0; round < 40; ++round) {
    const std::size_t n = random.below(300);
    std::vector<Aabb> boxes;
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3d low{random.uniform(0, 20), random.uniform(0, 20), random.uniform(0, 20)};
      boxes.push_back({low, low + Vec3d{random.uniform(0, 2), random.uniform(0, 2), random.uniform(0, 2)}});
      if (random.below(20) == 0) boxes.back() = {{kInf, kInf, kInf}, {-kInf, -kInf, -kInf}};  // a body without a pose
      if (random.below(20) == 0 && i > 0) boxes.back() = boxes[i - 1];
    }
    for (const double margin : {0.0, 0.5, 5.0}) {
      std::vector<BodyPair> a, b;
      brute->candidates(boxes, margin, a);
      tree->candidates(boxes, margin, b);
      EXPECT_EQ(a, b);
      found += a.size();
      possible += n * (n - 1) / 2;
    }
  }
  EXPECT_GT(found, 1000u);
  EXPECT_LT(found, possible / 2);
}

TEST(BroadPhase, BoxesHoldEveryVertexAtAnyPose) {
  Random random(4);
  for (int round = 0; round < 500; ++round) {
    const double size = std::pow(10, random.uniform(-9, 9)), place = std::pow(10, random.uniform(-9, 9));
    const PiecePtr piece = make_piece(random.cloud(10, {size, size, size}), random.below(2) ? size : 0.0);
    const Pose X = random.pose(place);
    const Mat3<DoubleDouble> R = rotation_of_double_double(X);
    const Aabb box = certify_box(*piece, rotation_of(X), X.translation);
    for (const Vec3d& v : piece->vertices) {
      const Vec3<DoubleDouble> p = R * cast<DoubleDouble>(v) + cast<DoubleDouble>(X.translation);
      for (int k = 0; k < 3; ++k) {
        EXPECT_TRUE(DoubleDouble(box.low[k]) <= p[k] - DoubleDouble(piece->radius));
        EXPECT_TRUE(DoubleDouble(box.high[k]) >= p[k] + DoubleDouble(piece->radius));
      }
    }
  }
}

}  // namespace
}  // namespace clearance::test
