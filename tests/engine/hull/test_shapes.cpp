#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "engine/hull/shapes.h"

namespace clearance {
namespace {

// Closed, consistently oriented and outward: every directed edge once, and a positive volume.
void expect_closed_and_outward(const Shape& shape, const char* what) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  double volume = 0;
  for (const Triangle& t : shape.triangles) {
    for (int k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
    volume += dot(shape.vertices[t[0]], cross(shape.vertices[t[1]], shape.vertices[t[2]]));
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1) << what;
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u) << what;
  }
  EXPECT_GT(volume, 0) << what;
}

TEST(Shapes, SineAndCosineAreWithinABitOfTheLibraryAndExactAtRightAngles) {
  for (const std::uint32_t n : {1u, 2u, 3u, 5u, 64u, 1000u, 2000u})
    for (std::uint32_t k = 0; k <= 2 * n; ++k) {
      double s, c;
      sin_cos_pi(k, n, &s, &c);
      const long double angle = std::numbers::pi_v<long double> * k / n;
      EXPECT_NEAR(s, static_cast<double>(std::sin(angle)), 1.2e-16) << k << "/" << n;
      EXPECT_NEAR(c, static_cast<double>(std::cos(angle)), 1.2e-16) << k << "/" << n;
    }
  double s, c;
  sin_cos_pi(5, 10, &s, &c);
  EXPECT_EQ(s, 1);
  EXPECT_EQ(c, 0);
  sin_cos_pi(10, 10, &s, &c);
  EXPECT_EQ(s, 0);
  EXPECT_EQ(c, -1);
}

TEST(Shapes, UvSphereIsLaidOutAsOpen3dDoes) {
  const Shape s = make_uv_sphere(2, 5);
  ASSERT_EQ(s.vertices.size(), 42u);
  ASSERT_EQ(s.triangles.size(), 80u);
  // create_sphere(2, 5): the poles, then ring i, vertex j at (sin(i pi/5) cos(j pi/5), sin(i pi/5) sin(j pi/5), cos(i
  // pi/5)).
  EXPECT_EQ(s.vertices[0].z, 2);
  EXPECT_EQ(s.vertices[1].z, -2);
  for (int i = 1; i < 5; ++i)
    for (int j = 0; j < 10; ++j) {
      const Vec3d& v = s.vertices[2 + 10 * (i - 1) + j];
      const double alpha = std::numbers::pi / 5 * i, theta = std::numbers::pi / 5 * j;
      EXPECT_NEAR(v.x, 2 * std::sin(alpha) * std::cos(theta), 1e-15);
      EXPECT_NEAR(v.y, 2 * std::sin(alpha) * std::sin(theta), 1e-15);
      EXPECT_NEAR(v.z, 2 * std::cos(alpha), 1e-15);
    }
  EXPECT_EQ(s.triangles[0], (Triangle{0, 2, 3}));
  EXPECT_EQ(s.triangles[1], (Triangle{1, 33, 32}));
  EXPECT_NE(std::find(s.triangles.begin(), s.triangles.end(), Triangle{12, 13, 3}), s.triangles.end());
  expect_closed_and_outward(s, "resolution 5");
  expect_closed_and_outward(make_uv_sphere(1, 2), "resolution 2");
  EXPECT_EQ(make_uv_sphere(1, 1000).vertices.size(), 1998002u);
}

TEST(Shapes, FacesAreClosedAndOutward) {
  expect_closed_and_outward(make_box({1, 2, 3}), "box");
  expect_closed_and_outward(make_cylinder(1, 2), "cylinder");
  expect_closed_and_outward(picture_of(make_sphere(0.5)), "sphere");
  expect_closed_and_outward(picture_of(make_capsule(0.5, 3)), "capsule");
}

TEST(Shapes, CylinderHoldsTheRoundOneAndSaysByHowMuchItIsLarger) {
  const double r = 0.3;
  const Shape s = make_cylinder(r, 1);
  ASSERT_EQ(s.vertices.size(), 2u * kCylinderSides);
  double farthest = 0;
  for (int j = 0; j < kCylinderSides; ++j) {
    const Vec3d a = s.vertices[j], b = s.vertices[(j + 1) % kCylinderSides];
    const Vec3d middle = 0.5 * (a + b);
    EXPECT_GE(std::hypot(middle.x, middle.y), r);  // the side's nearest point to the axis
    farthest = std::max(farthest, std::hypot(a.x, a.y));
  }
  EXPECT_GE(s.model_error, farthest - r);
  EXPECT_LT(s.model_error, 0.00121 * r);
}

TEST(Shapes, CapsuleOfNoLengthIsOneVertex) {
  EXPECT_EQ(make_capsule(1, 0).vertices.size(), 1u);
  EXPECT_EQ(make_capsule(1, 2).vertices.size(), 2u);
}

TEST(Shapes, RandomPosesAreTheSameEverywhere) {
  PortableRandom random(1);
  const Pose X = random.pose({60, 60, 60});
  // std::mt19937_64 seeded with 1 begins 2469588189546311528, 2516265689700432462, 8323445853463659930 (the C++
  // standard fixes the sequence); each number's upper 53 bits over 2^53, times 60, minus 30.
  EXPECT_EQ(X.translation.x, -30 + 60 * (double(2469588189546311528ull >> 11) * 0x1p-53));
  EXPECT_EQ(X.translation.y, -30 + 60 * (double(2516265689700432462ull >> 11) * 0x1p-53));
  EXPECT_EQ(X.translation.z, -30 + 60 * (double(8323445853463659930ull >> 11) * 0x1p-53));
  int far = 0;
  for (int i = 0; i < 1000; ++i) {
    const Pose Y = random.pose({2, 4, 6});
    EXPECT_EQ(check(Y), PoseQuality::kGood);
    EXPECT_LE(std::abs(Y.translation.x), 1);
    EXPECT_LE(std::abs(Y.translation.y), 2);
    EXPECT_LE(std::abs(Y.translation.z), 3);
    far += std::abs(Y.translation.z) > 2;
  }
  EXPECT_NEAR(far, 333, 60);
}

}  // namespace
}  // namespace clearance
