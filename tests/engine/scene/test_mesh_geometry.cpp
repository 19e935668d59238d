// Meshes of scenes through the cache: the same with it and without it, and from nowhere else.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "engine/base/digest.h"
#include "engine/engine.h"
#include "engine/geometry/mesh_geometry.h"
#include "engine/hull/direction_table.h"
#include "tests/engine/engine_test_util.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

namespace fs = std::filesystem;
using mesh_files::print;

std::string contents(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// A scene's meshes with a cache of their own, and a count of the loader's processes.
class MeshGeometryTest : public testing::Test {
 protected:
  MeshGeometryTest() {
    ::unsetenv("CLEARANCE_MESH_LOADER");
    loader("");
    ::setenv("CLEARANCE_CACHE", cache_.c_str(), 1);
  }
  ~MeshGeometryTest() override {
    ::unsetenv("CLEARANCE_MESH_LOADER");
    ::setenv("CLEARANCE_CACHE", "off", 1);
  }

  /// The real loader, after a line of shell.
  void loader(const std::string& first) {
    ::unsetenv("CLEARANCE_MESH_LOADER");
    const std::string real = mesh_loader_program();
    const std::string script =
        folder_.write("loader", "#!/bin/sh\necho x >>'" + starts_ + "'\n" + first + "\nexec '" + real + "' \"$@\"\n");
    ::chmod(script.c_str(), 0700);
    ::setenv("CLEARANCE_MESH_LOADER", script.c_str(), 1);
  }
  std::size_t starts() const { return contents(starts_).size() / 2; }
  std::vector<fs::path> entries() const {
    std::vector<fs::path> all;
    for (const auto& entry : fs::directory_iterator(cache_)) all.push_back(entry.path());
    return all;
  }
  std::string write(const std::string& name, const Shape& shape) const {
    std::string text = print("OFF\n%zu %zu 0\n", shape.vertices.size(), shape.triangles.size());
    for (const Vec3d& v : shape.vertices) text += print("%.17g %.17g %.17g\n", v.x, v.y, v.z);
    for (const Triangle& t : shape.triangles) text += print("3 %u %u %u\n", t[0], t[1], t[2]);
    return folder_.write(name, text);
  }
  static Body body(const std::string& path, Vec3d scale = {1, 1, 1}, MeshAs mesh_as = MeshAs::kHull,
                   double radius = 0) {
    engine::Scene scene;
    scene.add_mesh("it", path, scale, mesh_as, {.radius = radius});
    return scene.bodies()[0];
  }

  TemporaryFolder folder_;
  const std::string cache_ = folder_ / "cache", starts_ = folder_ / "starts";
};

bool same(const Vec3d& a, const Vec3d& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

void expect_same(const Body& a, const Body& b) {
  const auto equal = [](const std::vector<Vec3d>& x, const std::vector<Vec3d>& y) {
    return std::equal(x.begin(), x.end(), y.begin(), y.end(), same);
  };
  EXPECT_EQ(a.source, b.source);
  EXPECT_EQ(a.model_error, b.model_error);
  EXPECT_TRUE(equal(a.display->vertices, b.display->vertices));
  EXPECT_EQ(a.display->triangles, b.display->triangles);
  ASSERT_EQ(a.parts.size(), b.parts.size());
  for (std::size_t i = 0; i < a.parts.size(); ++i) {
    const ConvexPart &p = *a.parts[i], &q = *b.parts[i];
    EXPECT_TRUE(equal(p.vertices, q.vertices));
    EXPECT_EQ(p.radius, q.radius);
    EXPECT_EQ(p.loaded_vertices, q.loaded_vertices);
    EXPECT_EQ(p.digest, q.digest);
    EXPECT_EQ(p.rho, q.rho);
    EXPECT_EQ(p.spread, q.spread);
    EXPECT_TRUE(same(p.centre, q.centre) && same(p.half, q.half));
    EXPECT_EQ(p.x_f32, q.x_f32);
    ASSERT_EQ(p.table == nullptr, q.table == nullptr);
    if (!p.table) continue;
    EXPECT_EQ(p.table->grid_bits, q.table->grid_bits);
    EXPECT_EQ(p.table->cells, q.table->cells);
    EXPECT_EQ(p.table->lists, q.table->lists);
  }
}

TEST_F(MeshGeometryTest, IsTheSameFromTheCacheAndNoLoaderStartsForIt) {
  const std::string ball = write("ball.off", make_uv_sphere(2, 20));  // 762 vertices: with a table
  const std::string box = write("box.off", make_box({1, 2, 3}));
  const std::string parts =
      folder_.write("parts.obj",
                    "o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
                    "o b\nv 5 0 0\nv 6 0 0\nv 5 1 0\nv 5 0 1\nf 5 7 6\nf 5 6 8\nf 6 7 8\nf 5 8 7\n");
  const auto all = [&] {
    return std::vector<Body>{body(ball, {1, -2, 1}), body(ball, {1, 1, 1}, MeshAs::kHull, 0.25), body(box),
                             body(parts, {1, 1, 1}, MeshAs::kParts)};
  };
  const std::vector<Body> cold = all();
  EXPECT_EQ(starts(), 4u);
  EXPECT_EQ(entries().size(), 4u);
  ASSERT_TRUE(cold[0].parts[0]->table);
  ASSERT_EQ(cold[3].parts.size(), 2u);
  const std::vector<Body> warm = all();
  EXPECT_EQ(starts(), 4u) << "all came from the cache";
  ::setenv("CLEARANCE_CACHE", "off", 1);
  const std::vector<Body> off = all();
  EXPECT_EQ(starts(), 8u) << "none came from the cache";
  for (std::size_t i = 0; i < cold.size(); ++i) {
    SCOPED_TRACE(i);
    expect_same(cold[i], warm[i]);
    expect_same(cold[i], off[i]);
  }
}

TEST_F(MeshGeometryTest, WhateverItDependsOnMakesAnotherEntry) {
  const std::string ball = write("ball.off", make_uv_sphere(2, 5));
  std::size_t expected = 0;
  const auto expect_fresh = [&](const char* what, auto&&... recipe) {
    body(ball, recipe...);
    EXPECT_EQ(starts(), ++expected) << what;
    EXPECT_EQ(entries().size(), expected) << what;
    body(ball, recipe...);
    EXPECT_EQ(starts(), expected) << what << ", again";
  };
  expect_fresh("a mesh", Vec3d{1, 1, 1});
  expect_fresh("its scale", Vec3d{1, 1, 2});
  expect_fresh("how it becomes convex", Vec3d{1, 1, 1}, MeshAs::kParts);
  expect_fresh("its radius", Vec3d{1, 1, 1}, MeshAs::kHull, 0.5);
  std::ofstream(ball, std::ios::app) << "\n";
  expect_fresh("a byte of the file", Vec3d{1, 1, 1});
  loader("true");
  expect_fresh("the program that reads it", Vec3d{1, 1, 1});
  fs::copy(ball, folder_ / "same.off");
  EXPECT_EQ(body(folder_ / "same.off").source, folder_ / "same.off (hull)");
  EXPECT_EQ(starts(), expected) << "where it lies is nothing to it";
}

// A forged table next to a mesh: its name, checksum and a few supports are right, one vertex is missing from its lists.
TEST_F(MeshGeometryTest, NothingNextToAMeshIsBelieved) {
  const Shape sphere = make_uv_sphere(2, 75);
  const std::string mesh = write("ball.off", sphere);
  engine::Scene first;
  first.add_mesh("ball", mesh, {1, 1, 1}, MeshAs::kHull, {.is_static = true});
  const ConvexPart& part = *first.bodies()[0].parts[0];
  ASSERT_GE(part.vertices.size(), 10'000u);
  std::uint32_t pole = 0, opposite = 0;
  for (std::uint32_t i = 0; i < part.vertices.size(); ++i) {
    if (part.vertices[i].z > part.vertices[pole].z) pole = i;
    if (part.vertices[i].z < part.vertices[opposite].z) opposite = i;
  }

  DirectionTable table = *part.table;
  std::size_t changed = 0;
  for (std::size_t i = 0; i < table.lists.size(); i += table.lists[i] + 1)
    for (std::size_t k = 1; k <= table.lists[i]; ++k)
      if (table.lists[i + k] == pole) table.lists[i + k] = opposite, ++changed;
  ASSERT_GT(changed, 10u);
  Digest key, checksum;
  key.add(std::uint64_t{1});
  key.add(std::span<const Vec3d>(part.vertices));
  key.add(part.rho);
  key.add(std::uint64_t{6});
  checksum.add(std::uint64_t{table.grid_bits});
  for (const auto* words : {&table.cells, &table.lists})
    for (std::size_t i = 0; i < words->size(); i += 2)
      checksum.add(std::uint64_t{(*words)[i]} << 32 | (i + 1 < words->size() ? (*words)[i + 1] : 0));
  const std::uint64_t header[] = {
      0x315458444e494c43, 1, key.value(), part.vertices.size(), table.grid_bits, table.cells.size(), table.lists.size(),
      checksum.value()};
  const std::string beside = mesh + print(".%016llx.table", static_cast<unsigned long long>(key.value()));
  std::ofstream file(beside, std::ios::binary);
  file.write(reinterpret_cast<const char*>(header), sizeof header);
  for (const auto* words : {&table.cells, &table.lists})
    file.write(reinterpret_cast<const char*>(words->data()), static_cast<std::streamsize>(words->size() * 4));
  ASSERT_TRUE(file.flush());
  ASSERT_EQ(::chmod(beside.c_str(), 0644), 0);

  for (const char* cache : {"off", cache_.c_str()}) {
    ::setenv("CLEARANCE_CACHE", cache, 1);
    engine::Scene scene;
    scene.add_mesh("ball", mesh, {1, 1, 1}, MeshAs::kHull, {.is_static = true});
    EXPECT_EQ(scene.bodies()[0].parts[0]->table->lists, part.table->lists);
    scene.add_sphere("probe", 0.25, {.pose = Pose{{0, 0, 2.39}, 1, 0, 0, 0}});
    const engine::Engine engine(scene);
    const test::Answer answer = test::evaluate(engine, {});
    ASSERT_EQ(answer.info.rows, 1u);
    const double lower = answer.view.lower[0], upper = answer.view.upper[0];
    const std::uint8_t status = answer.view.status[0];
    EXPECT_EQ(static_cast<Status>(status), Status::kOk);
    EXPECT_LE(lower, 0.1401) << "0.14 m apart, at the vertex that the file leaves out";
    EXPECT_GE(upper, 0.1399);
    EXPECT_NEAR(lower, 0.14, 1e-5);
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), {}), 5)
      << "mesh, table, loader, its starts, the cache: nothing else was left there";
}

TEST_F(MeshGeometryTest, AnEntryThatWillNotDoIsMadeAgain) {
  const std::string ball = write("ball.off", make_uv_sphere(2, 20));
  const Body right = body(ball);
  ASSERT_EQ(entries().size(), 1u);
  const fs::path entry = entries()[0];
  const std::string whole = contents(entry);
  std::size_t expected = 1;
  const auto expect_anew = [&](const char* what) {
    expect_same(body(ball), right);
    EXPECT_EQ(starts(), ++expected) << what;
    EXPECT_EQ(contents(entry), whole) << what;
  };
  std::string spoilt = whole;
  spoilt[spoilt.size() / 2] = static_cast<char>(spoilt[spoilt.size() / 2] ^ 1);
  std::ofstream(entry, std::ios::binary) << spoilt;
  expect_anew("damaged");
  fs::resize_file(entry, whole.size() / 2);
  expect_anew("cut short");
  ASSERT_EQ(::chmod(entry.c_str(), 0620), 0);
  expect_anew("a group may write it");
  // Whole entries that hold no geometry, or none that can be computed with: as a fault in what wrote them would leave.
  const auto payload = std::as_bytes(std::span(whole)).subspan(48);
  const Cache cache(cache_);
  std::vector<std::byte> record(payload.begin(), payload.end());
  ASSERT_TRUE(geometry_of_record(record));
  cache.write(entry.filename().string(), std::span(record).first(record.size() - 1));
  expect_anew("a record cut short");
  record.back() = record[record.size() - 2] = std::byte{0xff};  // in the last list
  cache.write(entry.filename().string(), record);
  expect_anew("a table with a vertex that is not there");
  cache.write(entry.filename().string(), {});
  expect_anew("nothing");
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give files away";
  ASSERT_EQ(::chown(entry.c_str(), 12345, 12345), 0);
  expect_anew("somebody else's");
}

TEST_F(MeshGeometryTest, WhatIsReadIsWhatWasHashed) {
  const Shape small = make_uv_sphere(1, 5), large = make_uv_sphere(3, 6);
  const std::string mesh = write("mesh.off", small);
  write("large.off", large);
  loader("cp '" + (folder_ / "large.off") + "' '" + mesh + "'");  // changes after it was hashed, before it is read
  EXPECT_EQ(body(mesh).display->vertices.size(), small.vertices.size());
  EXPECT_EQ(starts(), 1u);
  write("mesh.off", small);
  EXPECT_EQ(body(mesh).display->vertices.size(), small.vertices.size()) << "from the cache";
  EXPECT_EQ(starts(), 1u);
  write("mesh.off", large);
  EXPECT_EQ(body(mesh).display->vertices.size(), large.vertices.size());
}

// A glTF file whose vertices lie in another file: the bytes of the first do not determine its geometry.
TEST_F(MeshGeometryTest, OfFilesThatNameOthersNothingIsKept) {
  const auto buffer = [](float size) {
    std::string out;
    for (const float x : {0.f, 0.f, 0.f, size, 0.f, 0.f, 0.f, size, 0.f, 0.f, 0.f, size}) out += mesh_files::bytes(x);
    for (const std::uint16_t i : {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2}) out += mesh_files::bytes(i);
    return out;
  };
  const std::string text =
      R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "buffers": [{"byteLength": 72, "uri": "vertices.bin"}],
    "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [9, 9, 9]},
                  {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"}]})";
  const std::string mesh = folder_.write("a.gltf", text), other = folder_.write("elsewhere/a.gltf", text);
  folder_.write("vertices.bin", buffer(1));
  folder_.write("elsewhere/vertices.bin", buffer(5));
  EXPECT_EQ(body(mesh).parts[0]->half.x, body(mesh).parts[0]->half.x);
  EXPECT_EQ(starts(), 2u);
  EXPECT_TRUE(entries().empty());
  EXPECT_NEAR(body(mesh).parts[0]->half.x, 0.5, 1e-9);
  folder_.write("vertices.bin", buffer(3));
  EXPECT_NEAR(body(mesh).parts[0]->half.x, 1.5, 1e-9);
  const engine::Scene scene = engine::Scene::load(
      folder_.write("scene.yaml", "bodies:\n  - {name: a, mesh: a.gltf}\n  - {name: b, mesh: elsewhere/a.gltf}\n"));
  EXPECT_NEAR(scene.bodies()[0].parts[0]->half.x, 1.5, 1e-9);
  EXPECT_NEAR(scene.bodies()[1].parts[0]->half.x, 2.5, 1e-9) << "the same bytes, and another shape";
}

TEST_F(MeshGeometryTest, EqualFilesOfASceneAreMadeOnceAndShared) {
  std::string text = "bodies:\n";
  for (int i = 0; i < 8; ++i) {
    write(print("m%d.off", i), make_uv_sphere(1 + i / 4, 5));
    text += print("  - {name: b%d, mesh: m%d.off}\n", i, i);
  }
  const std::string file = folder_.write("scene.yaml", text);
  const engine::Scene scene = engine::Scene::load(file);
  EXPECT_EQ(starts(), 2u);
  EXPECT_EQ(scene.bodies()[0].parts[0], scene.bodies()[3].parts[0]);
  EXPECT_NE(scene.bodies()[0].parts[0], scene.bodies()[4].parts[0]);
  EXPECT_EQ(scene.bodies()[3].source, "m3.off (hull)");
  EXPECT_EQ(engine::Scene::load(file).revision(), scene.revision());
  EXPECT_EQ(starts(), 2u);
}

TEST_F(MeshGeometryTest, TheFirstErrorOfASceneIsTheOneReported) {
  std::string text = "bodies:\n";
  for (int i = 0; i < 12; ++i) {
    if (i % 5 == 3)
      folder_.write(print("m%d.off", i), "no mesh");
    else
      write(print("m%d.off", i), make_uv_sphere(1 + 0.1 * i, 5));
    text += print("  - {name: b%d, mesh: m%d.off}\n", i, i);
  }
  const std::string file = folder_.write("scene.yaml", text);
  const std::string error = error_text<engine::SceneError>([&] { engine::Scene::load(file); });
  EXPECT_NE(error.find("scene.yaml:5: "), std::string::npos) << error;
  EXPECT_NE(error.find("m3.off"), std::string::npos) << error;
  EXPECT_EQ(error_text<engine::SceneError>([&] { engine::Scene::load(file); }), error)
      << "with the others in the cache";
}

}  // namespace
}  // namespace clearance
