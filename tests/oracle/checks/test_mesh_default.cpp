// Compares the default for a convex mesh of rounded vertices with the oracle of triangles: it is the hull, whose bounds
// contain the distance of the enclosed volume.
#include <gtest/gtest.h>

#include <cstdio>
#include <vector>

#include "engine/engine.h"
#include "engine/hull/shapes.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/exact/exact_surface.h"

namespace clearance::exact {
namespace {

constexpr int kPoses = 60;

struct Bounds {
  double lower, upper;
};

Bounds evaluate(const Shape& mesh, MeshAs how, const std::vector<Vec3d>& other, const Pose& X) {
  engine::Scene scene;
  scene.add_mesh("mesh", mesh.vertices, mesh.triangles, how, {.pose = Pose{}});
  EXPECT_FALSE(scene.has_surfaces());
  scene.add_hull("other", other, {.pose = X});
  const engine::Engine engine(std::move(scene), {.threads = 1, .covers = engine::Covers::kOff});
  Bounds bounds{};
  std::uint8_t status;
  QueryView q;
  q.fields = kFieldLower | kFieldUpper | kFieldStatus;
  ReplyView reply;
  reply.rows = 1;
  reply.lower = &bounds.lower;
  reply.upper = &bounds.upper;
  reply.status = &status;
  engine.start(q, reply).advance();
  return bounds;
}

TEST(MeshDefault, TheHullOfAConvexMeshHoldsWhatItEncloses) {
  Random random(3);
  Shape ball = make_uv_sphere(1, 7);
  for (Vec3d& v : ball.vertices)
    for (int k = 0; k < 3; ++k) v[k] = static_cast<float>(v[k]);
  const std::vector<Vec3d> point{{0, 0, 0}};
  int missed_by_hull = 0;
  for (int i = 0; i < kPoses; ++i) {
    // A point just before a face or edge of the ball.
    const Pose X = random.rotation(random.direction() * (1 + 0.01 * random.uniform()));
    const BodyView solid{ball.vertices, ball.triangles, true, 0}, other{point, {}, false, 0};
    const Result exact_value = exact_distance(solid, Pose{}, other, X);
    const Bounds bounds = evaluate(ball, MeshAs::kAuto, point, X), hull = evaluate(ball, MeshAs::kHull, point, X);
    EXPECT_GE(exact_value.distance.compare(bounds.lower), 0) << i;
    EXPECT_LE(exact_value.distance.compare(bounds.upper), 0) << i;
    EXPECT_LT(bounds.upper - bounds.lower, 1e-6) << i;
    missed_by_hull += exact_value.distance.compare(hull.upper) > 0;
  }
  std::printf("%d of %d are not within the bounds of the hull alone\n", missed_by_hull, kPoses);
  EXPECT_GT(missed_by_hull, 0);
}

}  // namespace
}  // namespace clearance::exact
