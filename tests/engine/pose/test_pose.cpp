// Poses: accepted values, and a rotation that is the exact one rounded once.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

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

}  // namespace
}  // namespace clearance
