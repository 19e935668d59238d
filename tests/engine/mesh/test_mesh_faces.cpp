// Faces of more than three corners: the triangles cover the face once, and nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "engine/mesh/mesh.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using namespace mesh_files;

using Face = std::vector<std::uint32_t>;
struct Faces {
  std::vector<Vec3d> vertices;
  std::vector<Face> faces;
};

// Each face is an object of its own.
std::string obj(const Faces& m) {
  std::string out;
  for (const Vec3d& v : m.vertices) out += print("v %.17g %.17g %.17g\n", v.x, v.y, v.z);
  for (const Face& f : m.faces) {
    out += print("o face%td\nf", &f - m.faces.data());
    for (const std::uint32_t i : f) out += print(" %u", i + 1);
    out += '\n';
  }
  return out;
}

std::string off(const Faces& m) {
  std::string out = print("OFF\n%zu %zu 0\n", m.vertices.size(), m.faces.size());
  for (const Vec3d& v : m.vertices) out += print("%.17g %.17g %.17g\n", v.x, v.y, v.z);
  for (const Face& f : m.faces) {
    out += print("%zu", f.size());
    for (const std::uint32_t i : f) out += print(" %u", i);
    out += '\n';
  }
  return out;
}

// Text with the faces first, or bytes with the vertices first.
std::string ply(const Faces& m, bool is_text) {
  const std::string vertex =
      print("element vertex %zu\nproperty double x\nproperty double y\nproperty double z\n", m.vertices.size());
  const std::string face = print("element face %zu\nproperty list uint uint vertex_indices\n", m.faces.size());
  std::string rows[2];
  for (const Face& f : m.faces) {
    const auto n = static_cast<std::uint32_t>(f.size());
    rows[0] += is_text ? print("%u", n) : bytes(n);
    for (const std::uint32_t i : f) rows[0] += is_text ? print(" %u", i) : bytes(i);
    if (is_text) rows[0] += '\n';
  }
  for (const Vec3d& v : m.vertices)
    rows[1] += is_text ? print("%.17g %.17g %.17g\n", v.x, v.y, v.z) : bytes(v.x) + bytes(v.y) + bytes(v.z);
  return is_text ? "ply\nformat ascii 1.0\n" + face + vertex + "end_header\n" + rows[0] + rows[1]
                 : "ply\nformat binary_little_endian 1.0\n" + vertex + face + "end_header\n" + rows[1] + rows[0];
}

std::string dae_faces(const Faces& m, bool as_polylist) {
  DaeOptions options;
  for (const Vec3d& v : m.vertices) options.positions += print("%.9g %.9g %.9g ", v.x, v.y, v.z);
  std::string counts, lists, text = dae({m.vertices, {}}, options);
  for (const Face& f : m.faces) {
    counts += print("%zu ", f.size());
    lists += as_polylist ? "" : "<p>";
    for (const std::uint32_t i : f) lists += print("%u ", i);
    lists += as_polylist ? "" : "</p>";
  }
  const std::string kind = as_polylist ? "polylist" : "polygons";
  const std::size_t begin = text.find("<triangles"), end = text.find("</triangles>") + 12;
  return text.replace(
      begin, end - begin,
      print("<%s count=\"%zu\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>", kind.c_str(), m.faces.size()) +
          (as_polylist ? "<vcount>" + counts + "</vcount><p>" + lists + "</p>" : lists) + "</" + kind + ">");
}

const std::vector<std::pair<const char*, std::function<std::string(const Faces&)>>>& formats() {
  static const std::vector<std::pair<const char*, std::function<std::string(const Faces&)>>> all = {
      {"a.obj", [](const Faces& m) { return obj(m); }},
      {"a.off", [](const Faces& m) { return off(m); }},
      {"text.ply", [](const Faces& m) { return ply(m, true); }},
      {"binary.ply", [](const Faces& m) { return ply(m, false); }},
      {"polylist.dae", [](const Faces& m) { return dae_faces(m, true); }},
      {"polygons.dae", [](const Faces& m) { return dae_faces(m, false); }},
  };
  return all;
}

// Twice the area of triangles seen along n, none of them reversed.
double area(const Submesh& part, const Vec3d& n) {
  double sum = 0;
  for (const Triangle& t : part.triangles) {
    const Vec3d &a = part.vertices[t[0]], &b = part.vertices[t[1]], &c = part.vertices[t[2]];
    const double twice = dot(n, cross(b - a, c - a));
    EXPECT_GE(twice, -1e-9 * squared_norm(b - a));
    sum += twice;
  }
  return sum;
}

// A face in the plane z = 0, moved. Seen along its normal the triangles have its area and none is reversed, so that
// they cover it once.
void expect_covered(const std::vector<std::array<double, 2>>& polygon, double twice_area, std::size_t start = 0) {
  const Mat3d turned = {{{0.48, -0.8, 0.36}, {0.6, 0, -0.8}, {0.64, 0.6, 0.48}}};
  const TemporaryFolder folder;
  for (const double scale : {1.0, 1e-7, 1e6})
    for (const bool is_tilted : {false, true}) {
      Faces m;
      Face face;
      for (std::size_t i = 0; i < polygon.size(); ++i) {
        const auto& [x, y] = polygon[(i + start) % polygon.size()];
        const Vec3d p = Vec3d{x, y, 0} * scale;
        m.vertices.push_back(is_tilted ? turned * p : p);
        face.push_back(static_cast<std::uint32_t>(i));
      }
      m.faces = {face, {face.rbegin(), face.rend()}};
      const Vec3d n = is_tilted ? turned * Vec3d{0, 0, 1} : Vec3d{0, 0, 1};
      const Mesh mesh = load_mesh(folder.write("a.obj", obj(m)));
      ASSERT_EQ(mesh.submeshes.size(), 2u);
      EXPECT_LE(mesh.submeshes[0].rounding, 1e-15 * scale);
      const double wanted = twice_area * scale * scale;
      EXPECT_NEAR(area(mesh.submeshes[0], n), wanted, 1e-12 * wanted) << scale << is_tilted;
      EXPECT_NEAR(area(mesh.submeshes[1], -n), wanted, 1e-12 * wanted) << scale << is_tilted;
    }
}

const std::vector<std::array<double, 2>> kChannel = {{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}};

TEST(MeshFaces, AConcaveFaceCoversNothingElseInAnyFormat) {
  const TemporaryFolder folder;
  for (std::size_t start = 0; start < kChannel.size(); ++start)
    for (const auto& [file, write] : formats()) {
      SCOPED_TRACE(std::string(file) + " from corner " + std::to_string(start));
      Faces m;
      m.faces.emplace_back();
      for (std::size_t i = 0; i < kChannel.size(); ++i) {
        const auto& [x, y] = kChannel[(start + i) % kChannel.size()];
        m.vertices.push_back({x, y, 1});
        m.faces[0].push_back(static_cast<std::uint32_t>(i));
      }
      const Mesh mesh = load_mesh(folder.write(file, write(m)));
      ASSERT_EQ(mesh.submeshes.size(), 1u);
      EXPECT_EQ(mesh.submeshes[0].rounding, 0);
      EXPECT_EQ(mesh.submeshes[0].triangles.size(), 6u);
      EXPECT_EQ(area(mesh.submeshes[0], {0, 0, 1}), 14);
    }
}

TEST(MeshFaces, AConvexFaceIsAFanAroundItsFirstCorner) {
  const TemporaryFolder folder;
  for (const auto& [file, write] : formats()) {
    Faces m;
    Face face;
    for (std::uint32_t i = 0; i < 12; ++i) {
      const double angle = 2 * std::numbers::pi * i / 12;
      m.vertices.push_back({std::cos(angle), 0.5, std::sin(angle)});
      face.push_back((i + 5) % 12);
    }
    m.faces = {face};
    const Submesh part = load_mesh(folder.write(file, write(m))).submeshes[0];
    ASSERT_EQ(part.triangles.size(), 10u) << file;
    for (const Triangle& t : part.triangles) EXPECT_EQ(t[0], part.triangles[0][0]) << file;
  }
}

TEST(MeshFaces, CornersThatAreInLineOrComeTwice) {
  std::vector<std::array<double, 2>> with_more;
  for (std::size_t i = 0; i < kChannel.size(); ++i) {
    const auto &a = kChannel[i], &b = kChannel[(i + 1) % kChannel.size()];
    with_more.push_back(a);
    with_more.push_back(a);
    with_more.push_back({(a[0] + b[0]) / 2, (a[1] + b[1]) / 2});
  }
  for (std::size_t start = 0; start < with_more.size(); start += 5) expect_covered(with_more, 14, start);
}

// A square with a hole reached by a bridge, where the polygon touches itself.
TEST(MeshFaces, BridgesToHolesAndSlits) {
  expect_covered({{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}}, 24);
  expect_covered({{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {2, 1}, {2, 0}, {4, 0}, {4, 4}, {0, 4}}, 24);
  expect_covered({{0, 0}, {2, 0}, {2, 2}, {2, 0}, {4, 0}, {4, 4}, {0, 4}}, 32);   // a slit
  expect_covered({{0, 0}, {2, 0}, {2, -2}, {2, 0}, {4, 0}, {4, 4}, {0, 4}}, 32);  // the protrusion is a line
  expect_covered({{0, 0}, {2, 0}, {2, 2}, {2, 1}, {2, 0}, {4, 0}, {4, 4}, {3, 3}, {0, 4}}, 28);
  // Two holes that share a corner with each other.
  expect_covered(
      {{0, 0}, {9, 0}, {9, 9}, {0, 9}, {0, 0}, {2, 2}, {2, 4}, {4, 4}, {4, 6}, {6, 6}, {6, 4}, {4, 4}, {4, 2}, {2, 2}},
      2 * (81 - 8));
}

// Combs and spirals of many corners: cutting takes about as long as reading. A test of all corners for each would take
// hours.
TEST(MeshFaces, ManyCorners) {
  constexpr int kTeeth = 5'000;
  std::vector<std::array<double, 2>> comb = {{0, -1}, {kTeeth, -1}};
  for (int i = kTeeth; i > 0; --i)
    for (const std::array<double, 2> p : {std::array{i + 0.0, 5.0}, {i - 0.5, 5.0}, {i - 0.5, 0.0}, {i - 1.0, 0.0}})
      comb.push_back(p);
  Faces m;
  const auto add = [&m](const std::vector<std::array<double, 2>>& polygon, std::size_t start) {
    Face& face = m.faces.emplace_back();
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      face.push_back(static_cast<std::uint32_t>(m.vertices.size()));
      const auto& p = polygon[(i + start) % polygon.size()];
      m.vertices.push_back({p[0], p[1], 0});
    }
  };
  add(comb, 7);
  std::vector<std::array<double, 2>> spiral;
  constexpr int kAround = 10'000;
  double twice_area = 2 * kTeeth * 1.0 + 2 * kTeeth * 0.5 * 5;
  for (int i = 0; i < 2 * kAround; ++i) {
    const int k = i < kAround ? i : 2 * kAround - 1 - i;
    const double angle = 0.01 * k, r = 1 + 0.001 * k + (i < kAround ? 0.5 : 0);
    spiral.push_back({r * std::cos(angle), r * std::sin(angle)});
  }
  for (std::size_t i = 0; i < spiral.size(); ++i) {
    const auto &a = spiral[i], &b = spiral[(i + 1) % spiral.size()];
    twice_area += a[0] * b[1] - a[1] * b[0];
  }
  add(spiral, 0);
  const TemporaryFolder folder;
  const Mesh mesh = load_mesh(folder.write("many.ply", ply(m, false)));
  EXPECT_EQ(mesh.submeshes[0].triangles.size(), 4 * kTeeth + 2u - 2 + 2 * kAround - 2);
  EXPECT_NEAR(area(mesh.submeshes[0], {0, 0, 1}), twice_area, 1e-9 * twice_area);
}

// Polygons that grow at random by new corners between two others, as long as they stay simple.
std::vector<std::array<double, 2>> random_polygon(std::mt19937_64& random, std::size_t corners) {
  using P = std::array<double, 2>;
  const auto side = [](const P& a, const P& b, const P& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  };
  const auto meet = [&](const P& a, const P& b, const P& c, const P& d) {
    return side(a, b, c) * side(a, b, d) <= 0 && side(c, d, a) * side(c, d, b) <= 0;
  };
  std::uniform_int_distribution<int> grid(0, 40);
  std::vector<P> out = {{0, 0}, {41, 0}, {20, 41}};
  for (int tries = 0; out.size() < corners && tries < 4'000; ++tries) {
    const P p = {double(grid(random)), double(grid(random))};
    const std::size_t at = random() % out.size(), n = out.size();
    const P a = out[at], b = out[(at + 1) % n];
    bool good = side(a, p, b) != 0;
    for (std::size_t i = 0; good && i < n; ++i) {
      const P c = out[i], d = out[(i + 1) % n];
      if (i == at) continue;
      if (!(c == a || d == a)) good = good && !meet(a, p, c, d);
      if (!(c == b || d == b)) good = good && !meet(p, b, c, d);
      if (d == a) good = good && !(side(c, a, p) == 0);
      if (c == b) good = good && !(side(b, d, p) == 0);
      if (d == a || c == b) good = good && !(d == a && meet(p, b, c, d)) && !(c == b && meet(a, p, c, d));
    }
    if (good) out.insert(out.begin() + static_cast<std::ptrdiff_t>(at) + 1, p);
  }
  return out;
}

TEST(MeshFaces, RandomPolygons) {
  std::mt19937_64 random(7);
  Faces m;
  std::vector<double> areas;
  int concave = 0;
  for (int k = 0; k < 300; ++k) {
    auto polygon = random_polygon(random, 4 + static_cast<std::size_t>(k) % 25);
    std::rotate(polygon.begin(), polygon.begin() + static_cast<std::ptrdiff_t>(random() % polygon.size()),
                polygon.end());
    Face& face = m.faces.emplace_back();
    double twice = 0;
    bool is_concave = false;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const auto &a = polygon[i], &b = polygon[(i + 1) % polygon.size()], &c = polygon[(i + 2) % polygon.size()];
      twice += a[0] * b[1] - a[1] * b[0];
      is_concave = is_concave || (b[0] - a[0]) * (c[1] - b[1]) < (b[1] - a[1]) * (c[0] - b[0]);
      face.push_back(static_cast<std::uint32_t>(m.vertices.size()));
      m.vertices.push_back({a[0], a[1], 0.5 * a[0] - a[1]});  // in a plane that float64 represents exactly
    }
    concave += is_concave;
    areas.push_back(twice);
  }
  EXPECT_GE(concave, 200);
  const TemporaryFolder folder;
  const Mesh mesh = load_mesh(folder.write("a.obj", obj(m)));
  ASSERT_EQ(mesh.submeshes.size(), m.faces.size());
  for (std::size_t i = 0; i < m.faces.size(); ++i) {
    EXPECT_EQ(area(mesh.submeshes[i], {0, 0, 1}), areas[i]) << i;
    EXPECT_EQ(mesh.submeshes[i].triangles.size(), m.faces[i].size() - 2) << i;
    EXPECT_EQ(mesh.submeshes[i].rounding, 0) << i;
  }
}

// Corners that are not in a plane: seen along the normal no triangle is reversed, and each edge is there.
TEST(MeshFaces, BentFaces) {
  const TemporaryFolder folder;
  Faces m;
  m.faces.emplace_back();
  for (std::size_t i = 0; i < kChannel.size(); ++i) {  // over the edge of a table
    const auto& [x, y] = kChannel[(i + 3) % kChannel.size()];
    m.vertices.push_back(y > 1 ? Vec3d{x, 1, 1 - y} : Vec3d{x, y, 0});
    m.faces[0].push_back(static_cast<std::uint32_t>(i));
  }
  const Submesh part = load_mesh(folder.write("bent.off", off(m))).submeshes[0];
  ASSERT_EQ(part.triangles.size(), 6u);
  area(part, {0, std::sqrt(0.5), std::sqrt(0.5)});
  for (const Triangle& t : part.triangles) {  // the slot stays open
    const Vec3d middle = (part.vertices[t[0]] + part.vertices[t[1]] + part.vertices[t[2]]) * (1 / 3.0);
    EXPECT_FALSE(middle.x > 1.01 && middle.x < 1.99 && middle.z < -0.01) << middle.x << " " << middle.z;
  }
}

TEST(MeshFaces, AFaceThatCrossesItselfIsNamed) {
  const TemporaryFolder folder;
  const Faces bow = {{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}, {2, 0, 0}, {3, 0, 0}, {3, 1, 0}},
                     {{4, 5, 6}, {0, 1, 2, 3}}};
  const std::string what = "a face of 4 corners crosses itself, or is too intricate; cut it into triangles";
  const std::string places[] = {
      "line 11: ", "line 11: ", "line 11: ", "face 1: ", "face 1 of mesh \"g\": ", "face 1 of mesh \"g\": "};
  for (std::size_t i = 0; i < formats().size(); ++i) {
    const auto& [file, write] = formats()[i];
    const std::string path = folder.write(file, write(bow));
    EXPECT_EQ(error_text<MeshError>([&] { load_mesh(path); }), places[i] + what) << file;
  }
  Faces uneven = bow;  // with a normal, but one lobe reversed
  uneven.vertices[1] = {2, 2, 0};
  EXPECT_EQ(error_text<MeshError>([&] { load_mesh(folder.write("b.obj", obj(uneven))); }), "line 11: " + what);
  // A crossing as small as float32 rounding counts as rounding.
  Faces sliver = bow;
  sliver.vertices[1] = {1, 1e-8, 0};
  sliver.vertices[3] = {0, 1e-8, 0};
  const Mesh mesh = load_mesh(folder.write("c.off", off(sliver)));
  EXPECT_GT(mesh.submeshes[0].rounding, 0);
  EXPECT_LE(mesh.submeshes[0].rounding, 1e-8);
}

TEST(MeshFaces, FansAndHolesOfADae) {
  const TemporaryFolder folder;
  // A steep cone's side, from its apex: no polygon, but a fan.
  Faces cone = {{{0, 0, 5}}, {{0}}};
  for (std::uint32_t i = 0; i <= 6; ++i) {
    cone.vertices.push_back({std::cos(0.9 * i), std::sin(0.9 * i), i % 2 ? 0.0 : 1.0});
    cone.faces[0].push_back(i + 1);
  }
  std::string text = dae_faces(cone, false);
  for (const char* tag : {"<polygons", "</polygons"})
    text = replaced(text, tag, tag[1] == '/' ? "</trifans" : "<trifans");
  const Submesh part = load_mesh(folder.write("fan.dae", text)).submeshes[0];
  ASSERT_EQ(part.triangles.size(), 6u);
  for (const Triangle& t : part.triangles) EXPECT_EQ(part.vertices[t[0]].z, 5);
  const std::string both = replaced(text, "</trifans>", "</trifans><polylist count=\"0\"/>");
  EXPECT_EQ(error_text<MeshError>([&] { load_mesh(folder.write("both.dae", both)); }),
            "line 8: <trifans> in a file that has polygons, too, are not read; cut them into triangles");
  const std::string holes = replaced(dae_faces(cone, false), "<p>", "<ph><p>0 1 2 3</p><h>4 5 6</h></ph>\n<p>");
  EXPECT_EQ(error_text<MeshError>([&] { load_mesh(folder.write("holes.dae", holes)); }),
            "line 8: a polygon with holes (<ph>) is not read; cut it into triangles");
}

}  // namespace
}  // namespace clearance
