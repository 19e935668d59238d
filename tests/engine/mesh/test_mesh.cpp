// Mesh files of every format, and the meshes read from them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <set>

#include "engine/mesh/mesh.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using namespace mesh_files;

struct Format {
  const char* file;
  std::function<std::string(const Source&)> write;
};

const std::vector<Format>& formats() {
  static const std::vector<Format> all = {
      {"a.obj", [](const Source& m) { return obj(m); }},
      {"a.off", [](const Source& m) { return off(m); }},
      {"text.stl", [](const Source& m) { return stl_text(m); }},
      {"binary.stl", [](const Source& m) { return stl_binary(m); }},
      {"text.ply", [](const Source& m) { return ply(m, Ply::kText); }},
      {"little.ply", [](const Source& m) { return ply(m, Ply::kLittle); }},
      {"big.PLY", [](const Source& m) { return ply(m, Ply::kBig); }},
      {"a.dae", [](const Source& m) { return dae(m); }},
      {"a.gltf", [](const Source& m) { return gltf(m); }},
      {"a.glb", [](const Source& m) { return glb(m); }},
  };
  return all;
}

using Point = std::array<double, 3>;
using Face = std::array<Point, 3>;  // its corners in cyclic order, the least first

Point point(const Vec3d& v) {
  return {v.x, v.y, v.z};
}

std::set<Point> points_of(const std::vector<Vec3d>& vertices) {
  std::set<Point> out;
  for (const Vec3d& v : vertices) out.insert(point(v));
  return out;
}

std::set<Face> faces_of(const std::vector<Vec3d>& vertices, const std::vector<Triangle>& triangles) {
  std::set<Face> out;
  for (const Triangle& t : triangles) {
    Face f = {point(vertices[t[0]]), point(vertices[t[1]]), point(vertices[t[2]])};
    std::rotate(f.begin(), std::min_element(f.begin(), f.end()), f.end());
    out.insert(f);
  }
  return out;
}

// Each point of one set has one within `tolerance` in the other.
void expect_near(const std::vector<Vec3d>& got, const std::vector<Vec3d>& wanted, double tolerance) {
  const auto covered = [&](const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
    for (const Vec3d& u : a) {
      double nearest = HUGE_VAL;
      for (const Vec3d& v : b) nearest = std::min(nearest, norm(u - v));
      EXPECT_LE(nearest, tolerance) << u.x << " " << u.y << " " << u.z;
    }
  };
  covered(got, wanted);
  covered(wanted, got);
}

TEST(Mesh, NoVertexAndNoFaceIsLostInAnyFormat) {
  const TemporaryFolder folder;
  const Source source = ball();
  ASSERT_EQ(source.vertices.size(), 42u);
  for (const Format& format : formats()) {
    SCOPED_TRACE(format.file);
    const Mesh mesh = load_mesh(folder.write(format.file, format.write(source)));
    ASSERT_EQ(mesh.submeshes.size(), 1u);
    EXPECT_TRUE(points_of(mesh.submeshes[0].vertices) == points_of(source.vertices));  // bit for bit
    EXPECT_EQ(mesh.submeshes[0].vertices.size(), source.vertices.size());
    EXPECT_TRUE(faces_of(mesh.submeshes[0].vertices, mesh.submeshes[0].triangles) ==
                faces_of(source.vertices, source.triangles));
    EXPECT_GE(mesh.submeshes[0].loaded_vertices, source.vertices.size());
  }
}

// Each decimal of a text file becomes the nearest float64: hard ones for readers that round more than once.
TEST(Mesh, DecimalsAreRoundedOnceToFloat64) {
  const TemporaryFolder folder;
  const std::vector<std::pair<std::string, double>> hard = {
      {"0.1", 0.1},
      {"4300000.1", 4300000.1},
      {"5700000.3000000001", 5700000.3000000001},
      {"+1.25e-3", 1.25e-3},
      {".5", 0.5},
      {"9007199254740993", 9007199254740992.0},                                    // a tie, to even
      {"9007199254740993.00000000000000000000001", 9007199254740994.0},            // just above it
      {"1.00000000000000011102230246251565404236316680908203124", 1.0},            // just below a tie
      {"1.00000000000000011102230246251565404236316680908203126", 1.0 + 0x1p-52},  // just above
      {"179769313486231.570e-320", 179769313486231.570e-320},
      {"1e-400", 0.0}};
  int texts = 0;
  for (const auto& [decimal, value] : hard) {
    const std::string x = decimal;
    const std::pair<const char*, std::string> files[] = {
        {"a.obj", "v 0 0 0\nv " + x + " 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"},
        {"a.off", "OFF 4 4 6\n0 0 0\n" + x + " 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n"},
        {"a.stl", "solid a\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex " + x +
                      " 0 0\nvertex 0 1 0\nendloop\nendfacet\nfacet normal 0 0 0 outer loop vertex 0 1 0 vertex 0 0 1 "
                      "vertex 0 0 0 "
                      "endloop endfacet\nendsolid a\n"},
        {"a.ply",
         "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\nelement "
         "face 1\n"
         "property list uchar int vertex_indices\nend_header\n0 0 0\n" +
             x + " 0 0\n0 1 0\n0 0 1\n3 0 2 3\n"}};
    for (const auto& [file, text] : files) {
      const Mesh mesh = load_mesh(folder.write(file, text));
      EXPECT_EQ(points_of(mesh.submeshes[0].vertices).count({value, 0, 0}), 1u) << file << " " << x;
      EXPECT_EQ(mesh.submeshes[0].rounding, 0) << file;
      ++texts;
    }
  }
  EXPECT_EQ(texts, 44);
}

// Materials, lights and metadata are no part of a shape, nor are the extensions of an unused node.
TEST(Mesh, ExtensionsThatKeepTheGeometryOfAGltf) {
  const TemporaryFolder folder;
  const Source source = tetrahedron();
  std::string text = gltf(source,
                          "[{\"mesh\": 0, \"extensions\": {\"KHR_lights_punctual\": {\"light\": 0}}, "
                          "\"weights\": [0, 0.0], \"extras\": {\"ACME_folds\": 1}}, "
                          "{\"mesh\": 0, \"extensions\": {\"ACME_folds\": {}}}]");
  text = replaced(text, "\"scene\"",
                  "\"extensionsRequired\": [\"KHR_materials_unlit\", \"KHR_texture_transform\", "
                  "\"EXT_texture_webp\", \"KHR_lights_punctual\"], \"extensionsUsed\": [\"ACME_folds\"], "
                  "\"extensions\": {\"KHR_lights_punctual\": {}, \"ACME_lists\": {}}, \"scene\"");
  text = replaced(text, "\"indices\": 1", "\"indices\": 1, \"extensions\": {\"KHR_materials_variants\": {}}");
  const Mesh mesh = load_mesh(folder.write("a.gltf", text));
  ASSERT_EQ(mesh.submeshes.size(), 1u);
  EXPECT_TRUE(faces_of(mesh.submeshes[0].vertices, mesh.submeshes[0].triangles) ==
              faces_of(source.vertices, source.triangles));
}

// A skin's joints place its mesh at its node, or else the file is rejected.
TEST(Mesh, ASkinOfAGltfKeepsItsMeshWhereItsNodeIs) {
  const TemporaryFolder folder;
  const Source source = tetrahedron();
  // The inverse of a translation by (2, 0, 0), by columns.
  std::string matrix;
  for (const float x : {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -2, 0, 0, 1}) matrix += bytes(x);
  const auto skinned = [&](const std::string& node, const std::string& joint, bool binds) {
    std::string text = gltf(source, "[{\"children\": [1, 2], \"translation\": [0, 7, 0]}, {\"mesh\": 0, \"skin\": 0" +
                                        node + "}, {\"translation\": [" + joint + "]}]");
    text = replaced(text, "\"bufferViews\": [",
                    "\"skins\": [{\"joints\": [2]" + std::string(binds ? ", \"inverseBindMatrices\": 0" : "") +
                        "}], \"bufferViews\": [{\"buffer\": 1, \"byteLength\": 64}, ");
    text = replaced(text, "\"bufferView\": 1", "\"bufferView\": 2");
    text = replaced(text, "\"bufferView\": 0", "\"bufferView\": 1");
    text = replaced(text, "\"POSITION\": 0", "\"POSITION\": 1");
    text = replaced(text, "\"indices\": 1", "\"indices\": 2");
    text = replaced(text, "\"accessors\": [",
                    "\"accessors\": [{\"bufferView\": 0, \"componentType\": 5126, \"count\": 1, \"type\": \"MAT4\"}, ");
    const std::size_t end = text.rfind("]}");
    return text.insert(end, ", {\"byteLength\": 64, \"uri\": \"data:;base64," + base64(matrix) + "\"}");
  };
  const auto first = [&](const std::string& text) { return load_mesh(folder.write("a.gltf", text)).submeshes[0]; };
  EXPECT_TRUE(points_of(first(skinned("", "2, 0, 0", true)).vertices).contains({1, 7, 0}));
  EXPECT_EQ(first(skinned("", "0, 0, 0", false)).rounding, first(gltf(source,
                                                                      "[{\"children\": [1], \"translation\": "
                                                                      "[0, 7, 0]}, {\"mesh\": 0}]"))
                                                               .rounding);
  EXPECT_TRUE(points_of(first(skinned(", \"translation\": [3, 0, 0]", "5, 0, 0", true)).vertices).contains({4, 7, 0}));
  const Submesh rounded = first(skinned("", "2.000001, 0, 0", true));
  EXPECT_TRUE(points_of(rounded.vertices).contains({1, 7, 0}));
  EXPECT_GE(rounded.rounding, 0.9e-6);
  EXPECT_LE(rounded.rounding, 1.1e-6);
  EXPECT_EQ(
      error_text<MeshError>([&] { first(skinned("", "2.1, 0, 0", true)); }),
      "glTF: nodes[1] has a skin, and its joint nodes[2] moves the mesh away from where the node has it, which is "
      "not read");
  EXPECT_EQ(error_text<MeshError>([&] { first(skinned(", \"scale\": [2, 2, 2]", "2, 0, 0", true)); }).substr(0, 30),
            "glTF: nodes[1] has a skin, and");
}

TEST(Mesh, BinaryPlyKeepsItsDoubles) {
  const TemporaryFolder folder;
  for (const bool big : {false, true}) {
    std::string text = print("ply\nformat binary_%s_endian 1.0\nelement vertex 3\n", big ? "big" : "little");
    text +=
        "property uchar red\nproperty double x\nproperty double y\nproperty short z\nelement face 1\nproperty list "
        "uint ushort "
        "vertex_index\nend_header\n";
    for (int i = 0; i < 3; ++i)
      text += "\7" + bytes(4.3e6 + 0.1 * i, big) + bytes(1.0 / 3 * i * i, big) + bytes<std::int16_t>(-7, big);
    text += bytes<std::uint32_t>(3, big) + bytes<std::uint16_t>(0, big) + bytes<std::uint16_t>(1, big) +
            bytes<std::uint16_t>(2, big);
    const Mesh mesh = load_mesh(folder.write("a.ply", text));
    EXPECT_EQ(points_of(mesh.submeshes[0].vertices),
              (std::set<Point>{{4.3e6, 0, -7}, {4.3e6 + 0.1, 1.0 / 3, -7}, {4.3e6 + 0.1 * 2, 1.0 / 3 * 2 * 2, -7}}));
    EXPECT_EQ(mesh.submeshes[0].triangles.size(), 1u);
  }
}

// The rounding of DAE to float32 is reported in full; transforms in float64 cost next to nothing.
TEST(Mesh, TheRoundingThatIsLeftIsBounded) {
  const TemporaryFolder folder;
  Source source = tetrahedron();
  DaeOptions options;
  options.positions = "4300000.1 0 0 4300001.2 0 0 4300000.1 1 0 4300000.1 0 1";
  const Submesh far = load_mesh(folder.write("far.dae", dae(source, options))).submeshes[0];
  double off = 0;
  for (const Vec3d& v : far.vertices)
    off = std::max(off, std::min(std::abs(v.x - 4300000.1), std::abs(v.x - 4300001.2)));
  ASSERT_GT(off, 0.01) << "float32 happened to hold them";
  EXPECT_GE(far.rounding, off);
  EXPECT_LE(far.rounding, 0.5);
  EXPECT_EQ(load_mesh(folder.write("near.dae", dae(source))).submeshes[0].rounding, 0);
  options = {};
  options.scene = "<node id=\"n\"><translate>4300000.1 0 0</translate><instance_geometry url=\"#g\"/></node>";
  const Submesh moved = load_mesh(folder.write("moved.dae", dae(source, options))).submeshes[0];
  off = 1;
  for (const Vec3d& v : moved.vertices) off = std::min(off, std::abs(v.x - 4300000.1));
  ASSERT_GT(off, 0.01);
  EXPECT_GE(moved.rounding, off);
  EXPECT_LE(moved.rounding, 100);

  EXPECT_EQ(load_mesh(folder.write("a.gltf", gltf(source))).submeshes[0].rounding, 0);
  EXPECT_EQ(load_mesh(folder.write("a.glb", glb(source))).submeshes[0].rounding, 0);
  const Submesh node =
      load_mesh(folder.write("b.gltf", gltf(source, "[{\"mesh\": 0, \"translation\": [4300000.1, 5700000.3, 0]}]")))
          .submeshes[0];
  expect_near(
      node.vertices,
      {{4300000.1, 5700000.3, 0}, {4300001.1, 5700000.3, 0}, {4300000.1, 5700001.3, 0}, {4300000.1, 5700000.3, 1}},
      2e-9);
  EXPECT_GT(node.rounding, 0);
  EXPECT_LT(node.rounding, 1e-7);
  EXPECT_GT(load_mesh(folder.write("w.obj", replaced(obj(source), "v 1 0 0", "v 1 0 0 3"))).submeshes[0].rounding, 0);
}

// Forms that exporters write and other readers accept.
TEST(Mesh, FilesWithTheHabitsOfRealExportersAreRead) {
  const TemporaryFolder folder;
  const Source source = tetrahedron();
  const auto expect_good = [&](const char* file, const std::string& text) {
    try {
      const Mesh mesh = load_mesh(folder.write(file, text));
      EXPECT_EQ(points_of(mesh.submeshes[0].vertices), points_of(source.vertices)) << text;
      EXPECT_EQ(mesh.submeshes[0].triangles.size(), 4u) << text;
    } catch (const MeshError& e) {
      ADD_FAILURE() << e.what() << " in " << text;
    }
  };
  for (const char* line : {"Created by Blender", "Created by Blender 2.79 (sub 0)", "VCGLIB generated", "remark one"})
    for (const Ply kind : {Ply::kText, Ply::kLittle})
      expect_good("note.ply", replaced(ply(source, kind), "comment for a test", line));
  const auto with_cr = [](std::string text) {
    for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2) text.insert(at, "\r");
    return text;
  };
  expect_good("cr.obj", with_cr(obj(source)));
  expect_good("cr.off", with_cr(off(source)));
  expect_good("cr.stl", with_cr(stl_text(source)));
  expect_good("cr.ply", with_cr(ply(source, Ply::kText)));
  expect_good("bom.obj", "\xEF\xBB\xBF" + obj(source));
  expect_good("colour.obj", replaced(obj(source), "v 1 0 0", "v 1 0 0 0.5 0.5 0.5"));
  expect_good("weight.obj", replaced(obj(source), "v 1 0 0", "v 1 0 0 1.0"));
  expect_good("slashes.obj", replaced(obj(source), "f 1 3 2", "f 1/4/7 -2//9 \\\n 2/3  # and so on"));
  expect_good("later.obj", replaced(replaced(obj(source), "f 1 3 2\n", ""), "o thing\n", "o thing\nf 1 3 2\n"));
  expect_good("colour.off", replaced(replaced(off(source), "OFF", "COFF"), "1 0 0", "1 0 0 255 0 0 255  # red"));
  expect_good("face_colour.off", replaced(off(source), "3 0 2 1", "3 0 2 1 255 0 0"));
  expect_good("normals.off", replaced(replaced(off(source), "OFF\n", "NOFF # normals\n\n"), "1 0 0", "1 0 0 0 0 1"));
  expect_good("upper.stl", replaced(replaced(stl_text(source), "facet normal", "FACET NORMAL"), "solid", "SOLID"));
  expect_good("solid.stl", "solid" + stl_binary(source).substr(5));
  const auto only_cr = [](std::string text) {
    std::replace(text.begin(), text.end(), '\n', '\r');
    return text;
  };
  const std::string text = stl_text(source);
  expect_good("only_cr.stl", only_cr(text));
  expect_good("mixed.stl", replaced(text, "solid thing\n", "solid thing\r"));
  for (const char* end : {"end solid thing", "END\tSOLID", "End  Solid thing\r", "endsolid", "endsolid a b c"})
    expect_good("end.stl", replaced(text, "endsolid thing", end));
  expect_good("apart.stl", replaced(replaced(text, "endfacet", "end facet"), "endloop", "end loop"));
  const std::string after[] = {
      std::string(1, '\0'),
      std::string(128, '\0'),
      "\n",
      "\x1a",
      "more",
      std::string(128, ' '),
      "written by a program, which says so at length and in letters alone: abcdefghijklmnopqrst"};
  for (const std::string& bytes : after) {
    expect_good("behind.stl", stl_binary(source) + bytes);
    expect_good("behind_text.stl", text + bytes);
  }
  expect_good("behind_the_word.stl", text.substr(0, text.rfind(" thing")) + std::string(3, '\0'));
  // A strip of triangles, as in scans.
  expect_good("strip.ply",
              "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement "
              "tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
              "12 0 2 1 3 -1 0 1 3 -1 0 3 2\n");
}

TEST(Mesh, PositionsThatNoFaceUsesAreKeptWhereTheLibraryHandsThemOut) {
  const TemporaryFolder folder;
  Source source = tetrahedron();
  source.vertices.push_back({7, 7, 7});
  for (const char* file : {"a.off", "text.ply", "little.ply"}) {
    const auto format =
        std::find_if(formats().begin(), formats().end(), [&](const Format& f) { return std::string(f.file) == file; });
    const Mesh mesh = load_mesh(folder.write(file, format->write(source)));
    EXPECT_EQ(points_of(mesh.submeshes[0].vertices), points_of(source.vertices)) << file;
  }
}

TEST(Mesh, PolygonsBecomeTriangles) {
  const TemporaryFolder folder;
  const Mesh mesh = load_mesh(folder.write("a.obj", "v 0 0 0\nv 2 0 0\nv 3 1 0\nv 1 3 0\nv 0 2 0\nf 1 2 3 4 5\n"));
  EXPECT_EQ(mesh.submeshes[0].vertices.size(), 5u);
  EXPECT_EQ(mesh.submeshes[0].triangles.size(), 3u);
}

TEST(Mesh, TransformsOfGltfNodesAreApplied) {
  const TemporaryFolder folder;
  const Source source = tetrahedron();
  // The mesh at the root, moved by 10 in x; under it once more, rotated by 90 degrees about z and doubled; and
  // mirrored.
  const Mesh mesh = load_mesh(folder.write("a.gltf", gltf(source, R"([
      {"mesh": 0, "translation": [10, 0, 0], "children": [1, 2]},
      {"mesh": 0, "rotation": [0, 0, 0.70710678118654752, 0.70710678118654752], "scale": [2, 2, 2]},
      {"mesh": 0, "matrix": [-1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 5, 1]}])")));
  ASSERT_EQ(mesh.submeshes.size(), 3u);
  expect_near(mesh.submeshes[0].vertices, {{10, 0, 0}, {11, 0, 0}, {10, 1, 0}, {10, 0, 1}}, 1e-6);
  expect_near(mesh.submeshes[1].vertices, {{10, 0, 0}, {10, 2, 0}, {8, 0, 0}, {10, 0, 2}}, 1e-6);
  expect_near(mesh.submeshes[2].vertices, {{10, 0, 5}, {9, 0, 5}, {10, 1, 5}, {10, 0, 6}}, 1e-6);
  for (const Submesh& submesh : mesh.submeshes) {  // outward after mirroring as well
    double volume = 0;
    const Vec3d origin = submesh.vertices[0];
    for (const Triangle& t : submesh.triangles)
      volume +=
          dot(submesh.vertices[t[0]] - origin, cross(submesh.vertices[t[1]] - origin, submesh.vertices[t[2]] - origin));
    EXPECT_GT(volume, 0);
  }
}

TEST(Mesh, TransformsAndUnitOfDaeAreAppliedAndItsUpAxisIsNot) {
  const TemporaryFolder folder;
  const Source source = tetrahedron();
  const std::vector<Vec3d> wanted = {{0.010, 0, 0.005}, {0.010, 0.003, 0.005}, {0.009, 0, 0.005}, {0.010, 0, 0.007}};
  for (const char* up : {"X_UP", "Y_UP", "Z_UP"}) {
    DaeOptions options;
    options.up = up;
    options.unit = "0.001";
    options.scene =
        "<node id=\"a\"><translate>10 0 5</translate><node id=\"b\"><rotate>0 0 1 90</rotate><scale>3 1 2</scale>"
        "<instance_geometry url=\"#g\"/></node></node>";
    const Mesh mesh = load_mesh(folder.write("a.dae", dae(source, options)));
    ASSERT_EQ(mesh.submeshes.size(), 1u);
    expect_near(mesh.submeshes[0].vertices, wanted, 1e-8);
  }
}

TEST(Mesh, SeveralObjectsAreSeveralSubmeshes) {
  const TemporaryFolder folder;
  const Source source = tetrahedron();
  const auto submeshes = [&](const std::string& stl) {
    return load_mesh(folder.write("two.stl", stl)).submeshes.size();
  };
  EXPECT_EQ(submeshes(stl_text(source) + stl_text(ball())), 2u);
  EXPECT_EQ(submeshes(stl_binary(source) + stl_binary(ball())), 2u);
  EXPECT_EQ(submeshes(stl_binary(source) + stl_text(ball())), 2u);
  EXPECT_EQ(load_mesh(folder.write("two.obj", obj(source) + "o other\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf 5 6 7\n"))
                .submeshes.size(),
            2u);
}

TEST(Mesh, OtherFilesAreOpenedOnlyInTheFolder) {
  const TemporaryFolder folder;
  const Source source = tetrahedron();
  folder.write("inner/data.bin", gltf_buffer(source));
  folder.write("inner/deeper/data.bin", gltf_buffer(source));
  folder.write("outside.bin", gltf_buffer(source));
  std::filesystem::create_symlink(folder / "outside.bin", folder / "inner/link.bin");
  const auto error = [&](const std::string& uri) {
    const std::string file = folder.write("inner/a.gltf", gltf_json(source, uri));
    return error_text<MeshError>([&] { load_mesh(file); });
  };
  EXPECT_EQ(error("data.bin"), "");
  EXPECT_EQ(error("deeper/data.bin"), "");
  EXPECT_EQ(error("../outside.bin"),
            "it names \"" + (folder / "inner/../outside.bin") + "\", which lies outside its folder");
  EXPECT_EQ(error("link.bin"), "it names \"" + (folder / "inner/link.bin") + "\", which lies outside its folder");
  EXPECT_EQ(error("none.bin"), "it names \"none.bin\": No such file or directory");
  // A material does not affect the shape: its file is rejected, and the mesh is read without it.
  EXPECT_EQ(load_mesh(folder.write("inner/a.obj", "mtllib ../../../../etc/passwd\nusemtl x\n" + obj(source)))
                .submeshes.size(),
            1u);
  // A file that is a link may refer to files next to its target.
  folder.write("elsewhere/data2.bin", gltf_buffer(source));
  folder.write("elsewhere/b.gltf", gltf_json(source, "data2.bin"));
  std::filesystem::create_symlink(folder / "elsewhere/b.gltf", folder / "inner/c.gltf");
  std::filesystem::create_symlink(folder / "elsewhere/data2.bin", folder / "inner/data2.bin");
  EXPECT_EQ(load_mesh(folder / "inner/c.gltf").submeshes.size(), 1u);
}

}  // namespace
}  // namespace clearance
