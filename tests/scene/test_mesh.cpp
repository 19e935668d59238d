// Mesh files of every format, what comes out of them, and what is said of those that are damaged.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <set>

#include "engine/base/sanitizers.h"
#include "engine/mesh/mesh.h"
#include "error_text.h"
#include "mesh_files.h"
#include "temporary_folder.h"

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

std::string without_end(std::string text, std::size_t n) {
  return text.substr(0, text.size() - n);
}

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return at == std::string::npos ? text : text.replace(at, what.size(), with);
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

// Each decimal of a text file is the float64 nearest to it: hard ones for readers that round more than once.
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

// What DAE loses to float32 is said, and no less than what was lost; transforms in float64 cost next to nothing.
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

// What exporters write and other readers take.
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
  // A strip of triangles, as scans have them.
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
  // The mesh at the root, moved by 10 in x; under it once more, turned by 90 degrees about z and doubled; and mirrored.
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
  EXPECT_EQ(load_mesh(folder.write("two.stl", stl_text(source) + stl_text(ball()))).submeshes.size(), 2u);
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
  // A material does not matter to the shape: refused, and the mesh is read without it.
  EXPECT_EQ(load_mesh(folder.write("inner/a.obj", "mtllib ../../../../etc/passwd\nusemtl x\n" + obj(source)))
                .submeshes.size(),
            1u);
  // A file that is a link may name what lies beside its target.
  folder.write("elsewhere/data2.bin", gltf_buffer(source));
  folder.write("elsewhere/b.gltf", gltf_json(source, "data2.bin"));
  std::filesystem::create_symlink(folder / "elsewhere/b.gltf", folder / "inner/c.gltf");
  std::filesystem::create_symlink(folder / "elsewhere/data2.bin", folder / "inner/data2.bin");
  EXPECT_EQ(load_mesh(folder / "inner/c.gltf").submeshes.size(), 1u);
}

struct BadMesh {
  const char* file;
  std::string content;
  const char* error;
};

std::vector<BadMesh> bad_meshes() {
  const Source good = tetrahedron();
  Source nan = good, past = good, inf = good;
  nan.vertices[1].x = NAN;
  inf.vertices[2].y = INFINITY;
  past.triangles[3] = {0, 99, 2};
  const DaeOptions none;
  const auto dae_with = [&](auto change) {
    DaeOptions options;
    change(options);
    return dae(good, options);
  };
  const char* too_much_memory = "reading it takes more than 4096 MiB of memory; is the file damaged?";
  return {
      // What concerns every format.
      {"a.xyz", "1 2 3", "unknown format \".xyz\"; expected .obj, .stl, .ply, .off, .dae, .gltf or .glb"},
      {"a", "1 2 3", "unknown format \"\"; expected .obj, .stl, .ply, .off, .dae, .gltf or .glb"},
      {"empty.obj", "", "the file is empty"},
      {"empty.stl", "", "the file is empty"},
      {"empty.ply", "", "the file is empty"},
      {"empty.off", "", "the file is empty"},
      {"empty.dae", "", "the file is empty"},
      {"empty.gltf", "", "the file is empty"},
      {"empty.glb", "", "the file is empty"},
      // OBJ
      {"nan.obj", obj(nan), "line 4: expected a finite coordinate, got \"nan\""},
      {"inf.obj", obj(inf), "line 5: expected a finite coordinate, got \"inf\""},
      {"too_big.obj", replaced(obj(good), "v 1 0", "v 1e309 0"), "line 4: expected a finite coordinate, got \"1e309\""},
      {"short.obj", replaced(obj(good), "v 1 0 0", "v 1 0"),
       "line 4: expected a coordinate where the line or the file ends"},
      {"comma.obj", replaced(obj(good), "v 1 0 0", "v 1,5 0 0"), "line 4: expected a coordinate, got \"1,5\""},
      {"weight.obj", replaced(obj(good), "v 1 0 0", "v 1 0 0 0"), "line 4: a vertex has the weight 0"},
      {"past.obj", obj(past), "line 10: a face names vertex 100, and there are 4"},
      {"zero.obj", replaced(obj(good), "f 1 3 2", "f 0 3 2"), "line 7: a face names vertex 0, and there are 4"},
      {"before.obj", replaced(obj(good), "f 1 3 2", "f -9 3 2"), "line 7: a face names vertex -9, and there are 4"},
      {"words.obj", replaced(obj(good), "f 1 3 2", "f a b c"), "line 7: expected the number of a vertex, got \"a\""},
      {"lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n", "it holds points or lines only, no face with an area"},
      {"points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "it holds no mesh"},
      {"garbled.obj",
       "\x7f"
       "ELF\x02\x01\x01 nothing of ours at all, only words and \xff\xfe\xfd bytes",
       "it holds no mesh"},
      {"flat_faces.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 2\nf 2 2 2\n",
       "it holds points or lines only, no face with an area"},
      // STL
      {"cut.stl", without_end(stl_binary(good), 30),
       "its header promises 4 facets (284 bytes), the file has 254 bytes"},
      {"long.stl", stl_binary(good) + "more", "its header promises 4 facets (284 bytes), the file has 288 bytes"},
      {"huge.stl", stl_binary(good, 4000000000u),
       "its header promises 4000000000 facets (200000000084 bytes), the file has 284 bytes"},
      {"short.stl", std::string(50, '\0'), "the file has 50 bytes, less than the header of a binary STL file"},
      {"none.stl", std::string(84, '\0'), "it holds no facet"},
      {"nan.stl", stl_binary(nan), "facet 0 has a corner that is not finite"},
      {"inf_text.stl", stl_text(inf), "line 5: expected a finite coordinate, got \"inf\""},
      {"cut_text.stl", without_end(stl_text(good), 60),
       "line 26: expected a coordinate where the line or the file ends"},
      {"half_text.stl", without_end(stl_text(good), 300), "the file ends early: no \"endsolid\" at its end"},
      {"none_text.stl", "solid x\nendsolid x\n", "it holds no mesh"},
      {"words.stl", replaced(stl_text(good), "vertex 0 1 0", "vertex a b c"),
       "line 5: expected a coordinate, got \"a\""},
      // PLY
      {"header.ply", ply(good, Ply::kText).substr(0, 60), "the file ends within its header: no \"end_header\""},
      {"cut.ply", without_end(ply(good, Ply::kText), 20),
       "the file ends within face 1 of the 4 that its header promises"},
      {"cut_vertices.ply", without_end(ply(good, Ply::kText), 40),
       "the file ends within vertex 2 of the 4 that its header promises"},
      {"cut_binary.ply", without_end(ply(good, Ply::kLittle), 20),
       "the file ends within face 2 of the 4 that its header promises"},
      {"cut_big.ply", without_end(ply(good, Ply::kBig), 60),
       "the file ends within vertex 3 of the 4 that its header promises"},
      {"huge.ply", replaced(ply(good, Ply::kLittle), "vertex 4", "vertex 4000000000"),
       "the file ends within vertex 8 of the 4000000000 that its header promises"},
      {"overflow.ply", replaced(ply(good, Ply::kLittle), "vertex 4", "vertex 99999999999999999999"),
       "its header: element vertex: expected a count, got \"99999999999999999999\""},
      {"negative.ply", replaced(ply(good, Ply::kText), "face 4", "face -4"),
       "its header: element face: expected a count, got \"-4\""},
      {"type.ply", replaced(ply(good, Ply::kText), "property float x", "property flaot x"),
       "its header: a property of element vertex has no known type"},
      {"format.ply", replaced(ply(good, Ply::kText), "ascii", "utf8"),
       "its header: unknown format \"utf8\"; expected ascii, binary_little_endian or binary_big_endian"},
      {"key.ply", replaced(ply(good, Ply::kText), "property float z", "propetry float z"),
       "its header: unexpected \"propetry\""},
      {"flat.ply", replaced(ply(good, Ply::kText), "property float z", "comment no z"),
       "its header: element vertex has no property \"z\""},
      {"flat_list.ply", replaced(ply(good, Ply::kText), "property float z", "property list uchar float z"),
       "its header: element vertex has no property \"z\""},
      {"no_vertex.ply", replaced(ply(good, Ply::kText), "element vertex", "element point"),
       "line 15: face 0: it names vertex 0, and there are 0, from 0"},
      {"no_list.ply", replaced(ply(good, Ply::kText), "vertex_indices", "corners"),
       "its header: element face has no list \"vertex_indices\" or \"vertex_index\""},
      {"float_list.ply", replaced(ply(good, Ply::kLittle), "list uchar", "list float"),
       "its header: the length of a list of element face is not an integer"},
      {"twice.ply", replaced(ply(good, Ply::kText), "element face", "element vertex"),
       "its header: element vertex comes twice"},
      {"minus.ply", replaced(ply(good, Ply::kText), "3 0 2 1", "3 0 -2 1"),
       "line 15: face 0: it names vertex -2, and there are 4, from 0"},
      {"magic.ply", replaced(ply(good, Ply::kText), "ply", "PLX"), "not a PLY file: it does not begin with \"ply\""},
      {"garbled.ply", replaced(ply(good, Ply::kText), "3 0 2 1", "x y z w"),
       "line 15: expected the length of a list, got \"x\""},
      {"nan.ply", ply(nan, Ply::kLittle), "vertex 1: a coordinate is not finite"},
      {"inf.ply", ply(inf, Ply::kText), "line 13: expected a finite number, got \"inf\""},
      {"past.ply", ply(past, Ply::kLittle), "face 3: it names vertex 99, and there are 4, from 0"},
      {"past_text.ply", ply(past, Ply::kText), "line 18: face 3: it names vertex 99, and there are 4, from 0"},
      {"points.ply", ply({good.vertices, {}}, Ply::kText), "it holds points or lines only, no face with an area"},
      // OFF
      {"cut.off", off(good).substr(0, 20), "line 4: expected a coordinate where the line or the file ends"},
      {"cut_faces.off", without_end(off(good), 8),
       "line 10: the file ends before face 3 of the 4 that its header promises"},
      {"past.off", off(past), "line 10: a face names vertex 99, and there are 4, from 0"},
      {"nan.off", off(nan), "line 4: expected a finite coordinate, got \"nan\""},
      {"words.off", replaced(off(good), "1 0 0", "x 0 0"), "line 4: expected a coordinate, got \"x\""},
      {"none.off", "OFF\n4 0 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n", "it holds points or lines only, no face with an area"},
      {"magic.off", replaced(off(good), "OFF", "FOO"), "line 1: not an OFF file: it begins with \"FOO\""},
      {"huge.off", replaced(off(good), "4 4 0", "4000000000 4 0"),
       "line 11: the file ends before vertex 8 of the 4000000000 that its header promises"},
      // DAE
      {"cut.dae", dae(good).substr(0, 700), "line 9: no XML: Start-end tags mismatch"},
      {"text.dae", "no xml at all", "line 1: no XML: No document element found"},
      {"nan.dae", dae_with([](auto& o) { o.positions = "nan 0 0 1 0 0 0 1 0 0 0 1"; }),
       "vertex 0 of mesh \"g\" is not finite: (nan, 0, 0)"},
      {"few.dae", dae_with([](auto& o) { o.positions = "0 0 0 1 0 0"; }),
       "Expected more values while reading float_array contents."},
      {"words.dae", dae_with([](auto& o) { o.positions = "a b c 1 0 0 0 1 0 0 0 1"; }), "expected a number, got \"a\""},
      {"entity.dae",
       replaced(dae_with([](auto& o) { o.positions = "&e; 0 0 1 0 0 0 1 0 0 0 1"; }), "<COLLADA",
                "<!DOCTYPE x [<!ENTITY e SYSTEM \"file:///etc/passwd\">]><COLLADA"),
       "expected a number, got \"&e;\""},
      {"past.dae", dae(past), "Invalid data index (99/4) in primitive specification"},
      {"negative.dae", dae_with([](auto& o) { o.indices = "0 2 1 0 1 3 1 2 3 0 -1 2"; }),
       "a face has a negative index"},
      {"few_indices.dae", dae_with([](auto& o) { o.indices = "0 2 1 0 1"; }),
       "Expected different index count in <p> element."},
      {"huge.dae",
       replaced(dae(good), "<float_array id=\"pa\" count=\"12\"", "<float_array id=\"pa\" count=\"3000000000\""),
       too_much_memory},
      {"nothing.dae", dae_with([](auto& o) { o.scene = "<node id=\"n\"/>"; }), "it holds no mesh"},
      {"who.dae", dae_with([](auto& o) { o.scene = "<node id=\"n\"><instance_geometry url=\"#who\"/></node>"; }),
       "Collada: Unable to find geometry for ID \"who\". Skipping."},
      {"nan_node.dae", dae_with([](auto& o) {
         o.scene = "<node id=\"n\"><translate>nan 0 0</translate><instance_geometry url=\"#g\"/></node>";
       }),
       "the transform of a node is not finite"},
      {"itself.dae", dae_with([](auto& o) { o.scene = "<node id=\"n\"><instance_node url=\"#n\"/></node>"; }),
       "its nodes repeat each other to more than 100000, or a node holds itself"},
      // glTF and GLB
      {"cut.gltf", gltf(good).substr(0, 300), "glTF: no JSON: "},
      {"nan.gltf", gltf(nan), "glTF: position 1 of accessors[0] is not finite"},
      {"no_mesh.gltf",
       replaced(gltf(good, "[{}]"),
                "\"meshes\": [{\"primitives\": [{\"attributes\": {\"POSITION\": 0}, \"indices\": 1}]}], ", ""),
       "it holds no mesh"},
      {"which.gltf", gltf(good, "[{\"mesh\": 7}]"), "glTF: meshes[7] is named, and there are 1"},
      {"circle.gltf", gltf(good, "[{\"mesh\": 0, \"children\": [0]}]"),
       "glTF: nodes[0] has two parents, or is its own ancestor"},
      {"large_node.gltf",
       gltf(good, "[{\"scale\": [1e308, 1, 1], \"children\": [1]}, {\"mesh\": 0, \"scale\": [1e308, 1, 1]}]"),
       "the transform of a node is not finite"},
      {"count.gltf",
       gltf_json(good, "data:application/octet-stream;base64," + base64(gltf_buffer(good)), "[{\"mesh\": 0}]",
                 4000000000u),
       "glTF: accessors[0].count: expected a count or index, got 4000000000"},
      {"lines.gltf", replaced(gltf(good), "\"indices\": 1", "\"indices\": 1, \"mode\": 1"),
       "it holds points or lines only, no face with an area"},
      {"base64.gltf", replaced(gltf(good), "base64,AAAA", "base64,AA*A"),
       "glTF: buffers[0].uri: character 2 of its base64 is none"},
      {"short_base64.gltf", replaced(gltf(good), "base64,AAAA", "base64,"),
       "glTF: buffers[0].byteLength is 96, and there are 93 bytes"},
      {"short_view.gltf", replaced(gltf(good), "\"byteLength\": 48", "\"byteLength\": 44"),
       "glTF: accessors[0] has 4 rows, more than its bufferViews[0] holds"},
      {"long_view.gltf",
       replaced(gltf(good), "\"byteOffset\": 48, \"byteLength\": 48", "\"byteOffset\": 49, \"byteLength\": 48"),
       "glTF: bufferViews[1] ends at byte 97 of a buffer of 96"},
      {"past.gltf", gltf(past), "glTF: index 10 of accessors[1] names vertex 99, and there are 4, from 0"},
      {"quaternion.gltf", gltf(good, "[{\"mesh\": 0, \"rotation\": [0, 0, 0, 0]}]"),
       "glTF: nodes[0].rotation is no unit quaternion"},
      {"draco.gltf",
       replaced(gltf(good), "\"scene\"", "\"extensionsRequired\": [\"KHR_draco_mesh_compression\"], \"scene\""),
       "glTF: it needs the extension KHR_draco_mesh_compression, which is not read"},
      {"negative.gltf", replaced(gltf(good), "\"count\": 4", "\"count\": -4"),
       "glTF: accessors[0].count: expected a count or index, got -4"},
      {"cut.glb", without_end(glb(good), 30), "its header promises "},
      {"stub.glb", glb(good).substr(0, 10), "the file ends within its header"},
      {"magic.glb", replaced(glb(good), "glTF", "XXXX"), "not a GLB file: it does not begin with \"glTF\""},
      {"version.glb", glb(good).substr(0, 4) + bytes(std::uint32_t{9}) + glb(good).substr(8),
       "version 9 of GLB; expected 2"},
      {"chunk.glb", glb(good).substr(0, 12) + bytes(std::uint32_t{0xfffffff0}) + glb(good).substr(16),
       "a chunk of 4294967280 bytes goes past the end of the file"},
  };
}

TEST(Mesh, EveryDamagedFileIsRefusedWithItsCause) {
  const TemporaryFolder folder;
  int cases = 0;
  for (const BadMesh& bad : bad_meshes()) {
#if defined(CLEARANCE_ASAN)
    // The sanitizer ends the loader by itself where memory runs out or an allocation is absurd.
    if (std::string(bad.error).find("MiB of memory") != std::string::npos) continue;
#endif
    const std::string got = error_text<MeshError>([&] { load_mesh(folder.write(bad.file, bad.content)); });
    EXPECT_EQ(got.substr(0, std::string(bad.error).size()), bad.error) << bad.file << ": " << got;
    ++cases;
  }
  EXPECT_GE(cases, 60);
  EXPECT_EQ(load_mesh(folder.write("good.obj", obj(tetrahedron()))).submeshes.size(), 1u);  // and a good one after them
}

// Small files whose nodes stand for very many: counted before anything is made of them, so that little memory is
// enough.
TEST(Mesh, NodesThatMultiplyAreRefusedBeforeTheyAreMade) {
  const TemporaryFolder folder;
  const Source source = tetrahedron();
  MeshLimits limits;
  limits.memory_bytes = std::uint64_t{768} << 20;
  const auto error = [&](const char* file, const std::string& text) {
    return error_text<MeshError>([&] { load_mesh(folder.write(file, text), limits); });
  };
  constexpr int kDepth = 40;  // 2^40 nodes
  std::string nodes = "[", library, many = "[{\"children\": [1";
  for (int i = 0; i < kDepth; ++i) {
    nodes += print("{\"children\": [%d, %d]}, ", i + 1, i + 1);
    library +=
        print("<node id=\"n%d\"><instance_node url=\"#n%d\"/><instance_node url=\"#n%d\"/></node>", i, i + 1, i + 1);
  }
  EXPECT_EQ(error("a.gltf", gltf(source, nodes + "{\"mesh\": 0}]")),
            "glTF: nodes[1] has two parents, or is its own ancestor");
  DaeOptions options;
  options.scene =
      "<node id=\"r\">" + library + print("<node id=\"n%d\"><instance_geometry url=\"#g\"/></node></node>", kDepth);
  EXPECT_EQ(error("a.dae", dae(source, options)),
            "its nodes repeat each other to more than 100000, or a node holds itself");

  // Many nodes that show one large mesh: 300 x 19,802 vertices, and more corners of faces.
  const Shape ball = make_uv_sphere(1, 100);
  const Source large{ball.vertices, ball.triangles};
  std::string list;
  options.scene.clear();
  for (int i = 1; i <= 300; ++i) {
    many += i == 1 ? "" : print(", %d", i);
    list += ", {\"mesh\": 0}";
    options.scene +=
        print("<node id=\"n%d\"><translate>%d 0 0</translate><instance_geometry url=\"#g\"/></node>", i, i);
  }
  EXPECT_EQ(error("b.gltf", gltf(large, many + "]}" + list + "]")),
            "glTF: its nodes repeat meshes to more than 20000000 vertices");
  EXPECT_EQ(error("b.dae", dae(large, options)), "its nodes repeat meshes to more than 20000000 vertices");
  // Many accessors on the same bytes.
  std::string accessors, primitives;
  for (int i = 0; i < 400; ++i) {
    accessors += print("{\"bufferView\": 0, \"componentType\": 5126, \"count\": %zu, \"type\": \"VEC3\"}, ",
                       large.vertices.size());
    primitives += print("{\"attributes\": {\"POSITION\": %d}, \"indices\": 401}, ", i);
  }
  std::string text = replaced(gltf(large), "\"primitives\": [", "\"primitives\": [" + primitives);
  text = replaced(text, "\"accessors\": [", "\"accessors\": [" + accessors);
  text = replaced(text, "{\"attributes\": {\"POSITION\": 0}, \"indices\": 1}",
                  "{\"attributes\": {\"POSITION\": 400}, \"indices\": 401}");
  EXPECT_EQ(error("d.gltf", text), "glTF: its accessors read the same bytes again and again");
  // A few are as they were.
  EXPECT_EQ(load_mesh(folder.write("c.gltf", gltf(source, "[{\"children\": [1, 2]}, {\"mesh\": 0}, {\"mesh\": 0}]")))
                .submeshes.size(),
            2u);
}

TEST(Mesh, ThingsThatAreNoMeshFile) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& path, const MeshLimits& limits = {}) {
    return error_text<MeshError>([&] { load_mesh(path, limits); });
  };
  EXPECT_EQ(error(folder / "none.obj"), "No such file or directory");
  std::filesystem::create_directory(folder / "folder.obj");
  EXPECT_EQ(error(folder / "folder.obj"), "expected a mesh file, got a folder");
  ASSERT_EQ(::mkfifo((folder / "pipe.obj").c_str(), 0600), 0);
  EXPECT_EQ(error(folder / "pipe.obj"), "expected a mesh file, got a device, pipe or socket");
  const std::string good = folder.write("good.obj", obj(tetrahedron()));
  MeshLimits limits;
  limits.file_bytes = 10;
  EXPECT_EQ(error(good, limits), std::to_string(obj(tetrahedron()).size()) + " bytes; a mesh file may have at most 10");
  if (::geteuid() != 0) {  // root may read everything
    ::chmod(good.c_str(), 0);
    EXPECT_EQ(error(good), "Permission denied");
  }
}

// A loader that does what some damaged file might make it do, in place of the real one.
class FakeLoader {
 public:
  FakeLoader(const TemporaryFolder& folder, const std::string& script) {
    const std::string path = folder.write("loader", "#!/bin/sh\n" + script + "\n");
    ::chmod(path.c_str(), 0700);
    ::setenv("CLEARANCE_MESH_LOADER", path.c_str(), 1);
  }
  ~FakeLoader() { ::unsetenv("CLEARANCE_MESH_LOADER"); }
};

TEST(Mesh, ALoaderThatHangsCrashesOrTalksNonsenseDoesNoHarm) {
  const TemporaryFolder folder;
  const std::string good = folder.write("good.obj", obj(tetrahedron()));
  MeshLimits limits;
  const auto error_with = [&](const std::string& script) {
    const FakeLoader fake(folder, script);
    return error_text<MeshError>([&] { load_mesh(good, limits); });
  };
  EXPECT_EQ(error_with("kill -SEGV $$"), "the mesh library crashed on it (Segmentation fault); is the file damaged?");
  EXPECT_EQ(error_with("kill -ABRT $$"), "the mesh library crashed on it (Aborted); is the file damaged?");
  EXPECT_EQ(error_with("kill -KILL $$"), "the mesh loader was killed while reading it (out of memory?)");
  EXPECT_EQ(error_with("kill -XCPU $$"), "reading it took too much processor time; is the file damaged?");
  EXPECT_EQ(error_with("exit 3"), "the mesh loader ended with code 3 and no result; is the file damaged?");
  EXPECT_EQ(error_with("exit 0"), "the mesh loader ended with code 0 and no result; is the file damaged?");
  EXPECT_EQ(error_with("echo nonsense that is longer than a header of 40 bytes >&3"),
            "the mesh loader ended with code 0 and no result; is the file damaged?");
  const std::string garbled = "the mesh loader's result is garbled; is the file damaged?";
  // Magic, state, submeshes, bytes of the error text, bytes in all, limits; then a submesh's vertices, triangles,
  // loaded vertices, rounding.
  const std::string good_state = R"(printf 'cmesh003\001\0\0\0\001\0\0\0\0\0\0\0\0\0\0\0)";
  const std::string limits_held = R"(\0\0\0\0\0\0\0\0)";
  EXPECT_EQ(error_with(good_state + R"(\051\0\0\0\0\0\0\0)" + limits_held + "' >&3"), garbled)
      << "one byte promised too many";
  EXPECT_EQ(error_with(good_state + R"(\050\0\0\0\0\0\0\0)" + limits_held + "' >&3"), garbled)
      << "the submesh is not there";
  EXPECT_EQ(error_with(good_state + R"(\110\0\0\0\0\0\0\0)" + limits_held +
                       R"(\377\377\377\377\377\377\377\377\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0' >&3)"),
            garbled)
      << "2^64 - 1 vertices";
  const auto zeros = [](int n) {
    std::string out;
    while (n-- > 0) out += R"(\0)";
    return out;
  };
  const std::string one_of_each =
      R"(\160\0\0\0\0\0\0\0)" + limits_held + R"(\001\0\0\0\0\0\0\0\001\0\0\0\0\0\0\0\001\0\0\0\0\0\0\0)" + zeros(32);
  EXPECT_EQ(error_with(good_state + one_of_each + zeros(16) + "' >&3"), "")
      << "one vertex and one triangle: a good answer";
  EXPECT_EQ(error_with(good_state + one_of_each + R"(\007)" + zeros(15) + "' >&3"), garbled)
      << "a triangle past the end";
  EXPECT_EQ(
      error_with(R"(printf 'cmesh003\002\0\0\0\0\0\0\0\377\377\0\0\0\0\0\0\050\0\0\0\0\0\0\0)" + limits_held + "' >&3"),
      garbled)
      << "a long error text";
  EXPECT_EQ(error_with("exec 4>&-; exec sleep 1000"), "the mesh loader was killed while reading it (out of memory?)")
      << "it says that it has ended, and goes on";
  limits.time = std::chrono::milliseconds(200);
  EXPECT_EQ(error_with("echo done >&4; exec sleep 1000"), "reading it took longer than 0.200 s; is the file damaged?");
  EXPECT_EQ(error_with("exec sleep 1000"), "reading it took longer than 0.200 s; is the file damaged?");
  limits = {};
  ::setenv("CLEARANCE_MESH_LOADER", "/no/such/program", 1);
  EXPECT_EQ(error_text<MeshError>([&] { load_mesh(good); }), "CLEARANCE_MESH_LOADER=/no/such/program is not a program");
  ::unsetenv("CLEARANCE_MESH_LOADER");
  EXPECT_EQ(load_mesh(good).submeshes.size(), 1u);
}

#if !defined(CLEARANCE_ASAN) && !defined(CLEARANCE_TSAN)
TEST(Mesh, AFileThatNeedsMoreMemoryThanAllowedIsRefused) {
  const TemporaryFolder folder;
  const Shape shape = make_uv_sphere(1, 400);
  const std::string file = folder.write("a.ply", ply({shape.vertices, shape.triangles}, Ply::kLittle));
  MeshLimits limits;
  limits.memory_bytes = 64 << 20;
  EXPECT_EQ(error_text<MeshError>([&] { load_mesh(file, limits); }),
            "reading it takes more than 64 MiB of memory; is the file damaged?");
  EXPECT_EQ(load_mesh(file).submeshes[0].vertices.size(), shape.vertices.size());
}
#endif

}  // namespace
}  // namespace clearance
