// A sphere of two million vertices, from a file to a convex part, in bounded memory.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <set>

#include "engine/hull/direction_table.h"
#include "engine/hull/shapes.h"
#include "engine/hull/support.h"
#include "engine/scene/scene.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

// Seconds are printed, not tested, since they depend on the machine.
void load_and_check(const std::string& path) {
  const auto begin = std::chrono::steady_clock::now();
  engine::Scene scene;
  scene.add_mesh("ball", path, {1, 1, 1}, MeshAs::kHull, {});
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  rusage own{}, loader{};
  getrusage(RUSAGE_SELF, &own);
  getrusage(RUSAGE_CHILDREN, &loader);
  const long mebibytes =
      (own.ru_maxrss + loader.ru_maxrss) / 1024;  // the sum of both peaks, although they come one after the other
  std::printf("%s: %.2f s, %ld MiB\n", path.c_str() + path.rfind('.'), seconds, mebibytes);
  ::testing::Test::RecordProperty("seconds", std::to_string(seconds));
  EXPECT_LT(mebibytes, 2048);
  const ConvexPart& part = *scene.bodies()[0].parts.at(0);
  EXPECT_EQ(part.vertices.size(), 1998002u);
  ASSERT_TRUE(part.table);
  // also at the poles, where 2000 faces meet
  for (const Vec3d& n : {Vec3d{0, 0, 1}, Vec3d{0, 0, -1}, Vec3d{1e-4, 1e-4, 1}, Vec3d{1, 2, 3}, Vec3d{0, 1, 0}}) {
    double most = 0;
    for (const Vec3d& v : part.vertices) most = std::max(most, dot(n, v));
    EXPECT_EQ(support(part, n).value, most);
    EXPECT_LE(part.table->candidates(n).size(), 64u);
  }
  double farthest = 0, nearest = 3;
  for (const Vec3d& v : part.vertices) {
    farthest = std::max(farthest, norm(v));
    nearest = std::min(nearest, norm(v));
  }
  EXPECT_NEAR(farthest, 2, 1e-6);
  EXPECT_NEAR(nearest, 2, 1e-6);
}

void write_large(const std::string& path, bool stl) {
  const Shape sphere = make_uv_sphere(2, 1000);
  std::ofstream out(path, std::ios::binary);
  const auto put = [&](const auto& value) { out.write(reinterpret_cast<const char*>(&value), sizeof value); };
  const auto put_point = [&](const Vec3d& v) {
    for (int k = 0; k < 3; ++k) put(static_cast<float>(v[k]));
  };
  if (stl) {
    out << std::string(80, '\0');
    put(static_cast<std::uint32_t>(sphere.triangles.size()));
    for (const Triangle& t : sphere.triangles) {
      put_point({0, 0, 0});
      for (const std::uint32_t i : t) put_point(sphere.vertices[i]);
      put(std::uint16_t{0});
    }
    return;
  }
  out << mesh_files::print("ply\nformat binary_little_endian 1.0\nelement vertex %zu\n", sphere.vertices.size())
      << "property float x\nproperty float y\nproperty float z\n"
      << mesh_files::print("element face %zu\nproperty list uchar int vertex_indices\nend_header\n",
                           sphere.triangles.size());
  for (const Vec3d& v : sphere.vertices) put_point(v);
  for (const Triangle& t : sphere.triangles) {
    put(std::uint8_t{3});
    for (const std::uint32_t i : t) put(i);
  }
}

TEST(LargeMesh, Ply) {
  const TemporaryFolder folder;
  write_large(folder / "large.ply", false);
  load_and_check(folder / "large.ply");
  std::printf("again, with its table beside it:\n");
  load_and_check(folder / "large.ply");
}

TEST(LargeMesh, BinaryStl) {
  const TemporaryFolder folder;
  write_large(folder / "large.stl", true);
  load_and_check(folder / "large.stl");
}

}  // namespace
}  // namespace clearance
