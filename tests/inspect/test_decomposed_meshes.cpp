// Meshes with a file of convex parts next to them, as scenes read and keep them.
#include <gtest/gtest.h>

#include <filesystem>

#include "engine/bvh/surface.h"
#include "engine/geometry/geometry_file.h"
#include "engine/geometry/link_geometry.h"
#include "engine/geometry/mesh_geometry.h"
#include "engine/hull/decomposition.h"
#include "engine/scene/mesh_warning.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

namespace fs = std::filesystem;

// An L of two boxes, 1 by 1 by 0.25 m.
constexpr const char* kBracket =
    "v 0 0 0\nv 1 0 0\nv 1 0.25 0\nv 0.25 0.25 0\nv 0.25 1 0\nv 0 1 0\n"
    "v 0 0 0.25\nv 1 0 0.25\nv 1 0.25 0.25\nv 0.25 0.25 0.25\nv 0.25 1 0.25\nv 0 1 0.25\n"
    "f 1 3 2\nf 1 4 3\nf 1 5 4\nf 1 6 5\nf 7 8 9\nf 7 9 10\nf 7 10 11\nf 7 11 12\n"
    "f 1 2 8\nf 1 8 7\nf 2 3 9\nf 2 9 8\nf 3 4 10\nf 3 10 9\nf 4 5 11\nf 4 11 10\nf 5 6 12\nf 5 12 11\nf 6 1 7\nf 6 7 "
    "12\n";

std::string box(const char* name, double x, double y, int before) {
  std::string text = std::string("o ") + name + "\n";
  for (int corner = 0; corner < 8; ++corner)
    text += "v " + std::to_string(corner & 1 ? x : 0) + " " + std::to_string(corner & 2 ? y : 0) + " " +
            (corner & 4 ? "0.25" : "0") + "\n";
  for (int corner = 1; corner < 8; ++corner)
    text += "f " + std::to_string(before + 1) + " " + std::to_string(before + corner + 1) + " " +
            std::to_string(before + (corner == 7 ? 2 : corner + 2)) + "\n";
  return text;
}
std::string both_boxes() {
  return box("lying", 1, 0.25, 0) + box("standing", 0.25, 1, 8);
}

class DecomposedMeshes : public testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) { return folder_.write(name, text); }
  static const Decomposition* convex_parts_of(const engine::Scene& scene, std::uint32_t body = 0) {
    const Surface* surface = surface_of(scene.bodies()[body]);
    return surface ? surface->decomposition() : nullptr;
  }
  TemporaryFolder folder_;
};

TEST_F(DecomposedMeshes, AreProvedWhenTheyAreRead) {
  const std::string mesh = write("l.obj", kBracket);
  write("l.obj.pieces.obj", both_boxes());
  engine::Scene scene;
  scene.add_mesh("l", mesh, {1, 1, 1}, MeshAs::kDecompose, {});
  const Decomposition* parts = convex_parts_of(scene);
  ASSERT_TRUE(parts);
  ASSERT_EQ(parts->parts.size(), 2u);
  EXPECT_LE(parts->inner, 1e-12);
  EXPECT_LE(parts->most_outer(), 1e-3);
  EXPECT_TRUE(scene.bodies()[0].source.ends_with("(decompose)")) << scene.bodies()[0].source;
  EXPECT_TRUE(mesh_warnings(scene).empty());
  // Scaled, mirrored and grown, which does not change the parts.
  scene.add_mesh("grown", mesh, {-2, 1, 3}, MeshAs::kDecompose, {.radius = 0.5});
  ASSERT_TRUE(convex_parts_of(scene, 1));
  EXPECT_LE(convex_parts_of(scene, 1)->inner, 1e-12);
  EXPECT_EQ(convex_parts_of(scene, 1)->parts[0]->radius, 0);
  EXPECT_EQ(scene.bodies()[1].parts[0]->radius, 0.5);
}

TEST_F(DecomposedMeshes, WithoutPartsAreSolidsAndSayWhatToRun) {
  engine::Scene scene;
  scene.add_mesh("l", write("l.obj", kBracket), {1, 1, 1}, MeshAs::kDecompose, {});
  EXPECT_FALSE(convex_parts_of(scene));
  EXPECT_TRUE(surface_of(scene.bodies()[0])->is_solid());
  const std::vector<MeshWarning> warnings = mesh_warnings(scene);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].text.find("clearance decompose FILE"), std::string::npos);
  // A link to another folder is not followed.
  const std::string mesh = write("m.obj", kBracket);
  fs::create_symlink(write("elsewhere.obj", both_boxes()), mesh + ".pieces.obj");
  scene.add_mesh("m", mesh, {1, 1, 1}, MeshAs::kDecompose, {});
  EXPECT_FALSE(convex_parts_of(scene, 1));
}

TEST_F(DecomposedMeshes, ThatLeaveAPartOutSaySo) {
  const std::string mesh = write("l.obj", kBracket);
  write("l.obj.pieces.obj", box("lying", 1, 0.25, 0));
  engine::Scene scene;
  scene.add_mesh("l", mesh, {1, 1, 1}, MeshAs::kDecompose, {});
  ASSERT_TRUE(convex_parts_of(scene));
  EXPECT_GE(convex_parts_of(scene)->inner, 0.75);
  EXPECT_LE(convex_parts_of(scene)->inner, 0.83);
}

TEST_F(DecomposedMeshes, RejectWhatEnclosesNothingOrIsNoConvexPart) {
  engine::Scene scene;
  const auto rejection = [&](const std::string& mesh) {
    return error_text<engine::SceneError>([&] { scene.add_mesh("l", mesh, {1, 1, 1}, MeshAs::kDecompose, {}); });
  };
  const std::string open = write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_NE(rejection(open).find("mesh_as: decompose: the mesh encloses no volume: the edge from"), std::string::npos);
  const std::string mesh = write("l.obj", kBracket);
  for (const char* bad : {"", "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "v 0 0 0\nv 1 0 0\nf 1 2 9\n", "rubbish"}) {
    write("l.obj.pieces.obj", bad);
    EXPECT_NE(rejection(mesh).find("l.obj.pieces.obj"), std::string::npos) << bad << ": " << rejection(mesh);
  }
  EXPECT_TRUE(scene.bodies().empty());
}

TEST_F(DecomposedMeshes, AreKeptByTheCacheAndProvedAgainFromAFile) {
  const std::string mesh = write("l.obj", kBracket);
  write("l.obj.pieces.obj", both_boxes());
  MeshFile file(mesh);
  const Geometry made = MeshGeometries().make(file, {{1, 1, 1}, MeshAs::kDecompose, 0.25}, "l.obj");
  const Decomposition& parts = *made.parts[0]->surface->decomposition();
  const auto is_same = [&](const Geometry& other) {
    const Decomposition* d = other.parts[0]->surface->decomposition();
    return d && d->inner == parts.inner && d->outer == parts.outer && d->parts.size() == parts.parts.size() &&
           other.parts[0]->digest == made.parts[0]->digest;
  };
  const std::optional<Geometry> kept = geometry_of_record(geometry_record(made));
  ASSERT_TRUE(kept);
  EXPECT_TRUE(is_same(*kept));
  // A file may come from anywhere: the lengths that it claims are ignored.
  Geometry claims = made;
  auto less = std::make_shared<Decomposition>(parts);
  less->inner = 0;
  less->outer = {0, 0};
  const Surface& exact_value = *made.parts[0]->surface;
  claims.parts[0] = make_surface_part({exact_value.vertices().begin(), exact_value.vertices().end()},
                                      triangles_as_loaded(exact_value), true, made.parts[0]->radius,
                                      made.parts[0]->loaded_vertices, less);
  const std::string saved = write_geometry_file(folder_.path().string(), claims);
  EXPECT_TRUE(is_same(read_geometry_file(folder_ / saved)));
  // In a link's frame the parts deviate from the mesh by the rounding of both.
  const Geometry turned = moved(made, {{1, 2, 3}, {0.1, 0.2, 0.3}});
  const Decomposition* there = turned.parts[0]->surface->decomposition();
  ASSERT_TRUE(there);
  EXPECT_GT(there->inner, parts.inner);
  EXPECT_LE(there->inner, parts.inner + 1e-14);
}

}  // namespace
}  // namespace clearance
