// The bits of an answer for non-convex bodies do not depend on the rest of the query: searches are reused for one pair
// after another, and each pair gets the same result as alone. Linked once with the engine, and once with a faulty one
// whose searches keep state (CMakeLists.txt).
#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "tests/engine/same_rows.h"
#include "tests/oracle/cases/mesh_shapes.h"

namespace clearance {
namespace {

using exact::Mesh;
using exact::Point2;

/// A ring around z, of a tube with a square section.
Mesh ring(int sides, double radius, double thick) {
  const double in = radius - thick, out = radius + thick;
  return exact::revolved(std::vector<Point2>{{in, -thick}, {out, -thick}, {out, thick}, {in, thick}}, sides);
}

/// Solids, surfaces and clouds, small and large, hollow and of several components, and convex bodies to pair them with.
engine::Scene zoo() {
  engine::Scene scene;
  exact::Random shapes(5);
  test::Random random(7);
  const auto add = [&](const char* name, const Mesh& mesh, MeshAs mesh_as, double radius = 0) {
    scene.add_mesh(name, mesh.vertices, mesh.triangles, mesh_as, {.radius = radius});
  };
  const auto points = [&](int count) {
    std::vector<CloudPoint> cloud;
    for (const Vec3d& p : random.cloud(count, {0.6, 0.6, 0.6}))
      cloud.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
    return cloud;
  };
  add("ring", ring(12, 1, 0.3), MeshAs::kSolid);
  add("surface", ring(24, 0.8, 0.1), MeshAs::kSurface);
  Mesh rings = ring(8, 0.3, 0.1);
  exact::append(rings, exact::moved(ring(8, 0.3, 0.1), {0, 0, 0.5}));
  add("two rings", rings, MeshAs::kSolid, 0.01);
  add("shelf", exact::shelf(shapes), MeshAs::kSolid);
  add("bar", exact::bent(shapes), MeshAs::kSolid);
  scene.add_points("cloud", points(60), 0, {});
  scene.add_points("voxels", points(20), 0.05, {.radius = 0.01});
  scene.add_sphere("ball", 0.1, {});
  scene.add_box("box", {0.2, 0.3, 0.4}, {});
  scene.add_cylinder("can", 0.1, 0.3, {});
  scene.add_hull("hull", random.cloud(30, {0.2, 0.2, 0.2}), {});
  scene.add_hull("many corners", random.cloud(400, {0.2, 0.2, 0.2}), {});
  return scene;
}

TEST(SurfaceBatches, GiveEachPairTheBitsThatItHasAlone) {
  std::vector<std::uint32_t> moved;
  for (std::uint32_t b = 0; b < zoo().bodies().size(); ++b) moved.push_back(b);
  test::Random random(3);
  std::vector<Pose> poses;
  for (int k = 0; k < 30; ++k)
    for (std::size_t i = 0; i < moved.size(); ++i) poses.push_back(random.pose(0.3 + 0.4 * (k % 3)));
  std::array<std::uint64_t, 8> seen{};
  for (const std::string& set : engine::Engine::instruction_sets()) {
    engine::Engine::Options options;
    options.backend = "cpu";
    options.instruction_set = set;
    const engine::Engine engine(zoo(), options);
    for (const double abs_tol : {1e-9, 1e-2})
      for (const double max_distance : {0.3, std::numeric_limits<double>::infinity()}) {
        QueryView query;
        query.abs_tol = abs_tol;
        query.max_distance = max_distance;
        query.fields = test::kAllFields;
        query.bodies = moved;
        query.configuration_count = poses.size() / moved.size();
        query.configurations = poses;
        test::expect_rows_as_alone(engine, query, seen);
        if (testing::Test::HasFatalFailure()) FAIL() << set << ", to " << abs_tol << ", within " << max_distance;
      }
  }
  for (const Status status : {Status::kOk, Status::kOverlap, Status::kBeyond})
    EXPECT_GT(seen[static_cast<std::size_t>(status)], 20u) << "status " << int(status) << " was not met";
}

}  // namespace
}  // namespace clearance
