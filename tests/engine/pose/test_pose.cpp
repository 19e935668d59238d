// Poses: accepted values, and a rotation that is the exact one rounded once.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <span>

#include "engine/pose/pose.h"
#include "tests/engine/engine_test_util.h"

namespace clearance {
namespace {

TEST(Pose, NonFiniteAndAbsurdPosesAreBad) {
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  EXPECT_EQ(check({{0, 0, 0}, 1, 0, 0, 0}), PoseQuality::kGood);
  EXPECT_EQ(check({{0, 0, 0}, 2, 0, 0, 0}), PoseQuality::kRenormalised);
  EXPECT_EQ(check({{0, 0, 0}, 1e-7, 0, 0, 0}), PoseQuality::kBad);
  EXPECT_EQ(check({{0, 0, 0}, 1e7, 0, 0, 0}), PoseQuality::kBad);
  EXPECT_EQ(check({{0, 0, 0}, 0, 0, 0, 0}), PoseQuality::kBad);
  EXPECT_EQ(check({{nan, 0, 0}, 1, 0, 0, 0}), PoseQuality::kBad);
  EXPECT_EQ(check({{0, inf, 0}, 1, 0, 0, 0}), PoseQuality::kBad);
  EXPECT_EQ(check({{0, 0, 0}, 1, nan, 0, 0}), PoseQuality::kBad);
  EXPECT_EQ(check({{0, 0, 1e61}, 1, 0, 0, 0}), PoseQuality::kBad);
}

// In long double (64 bits) the entries of M(q) / |q|^2 have errors of about 2^-62; each entry under test is rounded
// once to 2^-53.
TEST(Pose, RotationEntriesAreRoundedOnce) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20000; ++i) {
    const double scale = std::pow(10.0, std::uniform_real_distribution<double>(-5.5, 5.5)(random));
    const Pose X{
        {0, 0, 0}, scale * normal(random), scale * normal(random), scale * normal(random), scale * normal(random)};
    if (check(X) == PoseQuality::kBad) continue;
    const Mat3d R = rotation_of(X);
    const long double w = X.qw, x = X.qx, y = X.qy, z = X.qz, n = w * w + x * x + y * y + z * z;
    const long double exact[3][3] = {
        {(w * w + x * x - y * y - z * z) / n, 2 * (x * y - w * z) / n, 2 * (x * z + w * y) / n},
        {2 * (x * y + w * z) / n, (w * w + y * y - x * x - z * z) / n, 2 * (y * z - w * x) / n},
        {2 * (x * z - w * y) / n, 2 * (y * z + w * x) / n, (w * w + z * z - x * x - y * y) / n}};
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        ASSERT_LE(std::abs(static_cast<double>(R.row[r][c] - exact[r][c])), 0x1p-53 * std::abs(R.row[r][c]) + 0x1p-60);
  }
}

TEST(Pose, RotationsSideBySideHaveTheSameBits) {
  test::Random random(4);
  for (const std::size_t count : {1, 2, 7, 8, 9, 40}) {
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < count; ++i) {
      const double s = std::pow(10.0, static_cast<double>(i % 13) - 6);
      poses.push_back({{1, 2, 3}, s * random.normal(), s * random.normal(), s * random.normal(), s * random.normal()});
    }
    std::vector<Mat3d> rotations(count);
    rotations_of(poses, rotations);
    for (std::size_t i = 0; i < count; ++i) {
      const Mat3d R = rotation_of(poses[i]);
      EXPECT_EQ(std::memcmp(&R, &rotations[i], sizeof R), 0) << i << " of " << count;
    }
  }
}

TEST(Pose, ComposeAndInverseCancel) {
  const Pose X{{1, -2, 3}, 0.3, -0.4, 0.5, 0.7};
  const Pose I = compose(X, inverse(X));
  EXPECT_NEAR(norm(I.translation), 0, 1e-14);
  EXPECT_NEAR(std::abs(I.qw), 1, 1e-15);
}

// A pose that does not move the origin needs no rotation, and gives the bits that it would give with one: zeros of either
// sign included.
TEST(Pose, ComposesWithoutARotationWhatNeedsNone) {
  const double zeros[] = {0.0, -0.0}, places[] = {0.0, -0.0, 1.5, -2};
  test::Random random(3);
  int without = 0, with = 0;
  for (int i = 0; i < 2000; ++i) {
    const auto any_of = [&](std::span<const double> x) {
      return x[static_cast<std::size_t>(random.uniform(0, 0.999) * static_cast<double>(x.size()))];
    };
    Pose a = random.pose(1), b = random.pose(1);
    a.translation = {any_of(places), any_of(places), any_of(places)};
    if (i % 4 != 0) b.translation = {any_of(zeros), any_of(zeros), any_of(zeros)};
    const Mat3d R = rotation_of(a);
    const Vec3d expected = a.translation + R * b.translation;
    int calls = 0;
    const Pose got = compose_with(a, [&] { return ++calls, R; }, b);
    EXPECT_EQ(std::memcmp(&got.translation, &expected, sizeof expected), 0) << i;
    (calls == 0 ? without : with) += 1;
  }
  EXPECT_GT(without, 200);
  EXPECT_GT(with, 200);
}

}  // namespace
}  // namespace clearance
