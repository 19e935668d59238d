// Excess of hulls over their meshes: the bound is valid, 0 for convex meshes, and close to the excess.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "engine/hull/hull.h"
#include "engine/hull/hull_excess.h"
#include "engine/scene/mesh_warning.h"
#include "tests/engine/mesh/mesh_files.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

using mesh_files::Source;

void add(Source* mesh, const Shape& shape, const Vec3d& at) {
  const auto base = static_cast<std::uint32_t>(mesh->vertices.size());
  for (const Vec3d& v : shape.vertices) mesh->vertices.push_back(v + at);
  for (const Triangle& t : shape.triangles) mesh->triangles.push_back({base + t[0], base + t[1], base + t[2]});
}

// Panels that do not touch: back, sides, boards. Open to the front; 13 % of it is solid.
Source shelf() {
  Source mesh;
  const double w = 0.8, d = 0.3, h = 1.8, t = 0.016;
  add(&mesh, make_box({w, t, h}), {0, d / 2, 0});
  for (const double side : {-1, 1}) add(&mesh, make_box({t, d - 2 * t, h}), {side * (w - t) / 2, 0, 0});
  for (int i = 0; i < 5; ++i) add(&mesh, make_box({w - 3 * t, d - 2 * t, t}), {0, 0, -h / 2 + t / 2 + i * (h - t) / 4});
  return mesh;
}

struct Result {
  HullExcess excess;
  ConvexPartPtr part;
};

Result measure(const Source& mesh) {
  std::vector<Triangle> faces;
  Result out;
  out.part = make_hull_part(mesh.vertices, mesh.triangles, 0, 0, false, &faces);
  out.excess = hull_excess(mesh.vertices, mesh.triangles, *out.part, faces);
  return out;
}

// Distance of a point to a mesh without a tree; 0 where faces wind around it (A. Van Oosterom and J. Strackee, 1983).
double distance_to(const Source& mesh, const Vec3d& p, bool closed) {
  double angle = 0, least = HUGE_VAL;
  for (const Triangle& t : mesh.triangles) {
    const Vec3d a = mesh.vertices[t[0]] - p, b = mesh.vertices[t[1]] - p, c = mesh.vertices[t[2]] - p;
    const double la = norm(a), lb = norm(b), lc = norm(c);
    angle += 2 * std::atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
    const Vec3d n = cross(b - a, c - a);
    const Vec3d corner[3] = {a, b, c};
    bool above = true;
    for (int k = 0; k < 3; ++k) {
      const Vec3d &u = corner[k], v = corner[(k + 1) % 3], edge = v - u;
      const double s = std::clamp(-dot(u, edge) / squared_norm(edge), 0.0, 1.0);
      least = std::min(least, norm(u + edge * s));
      above = above && dot(cross(n, edge), u) <= 0;
    }
    if (above) least = std::min(least, std::abs(dot(n, a)) / norm(n));
  }
  return closed && std::abs(angle) > 6 ? 0 : least;
}

// Largest distance of many points of the hull: a lower bound on the excess.
double farthest_met(const Source& mesh, bool closed, int count) {
  std::mt19937_64 bits(11);
  std::exponential_distribution<double> weight;
  std::uniform_int_distribution<std::size_t> pick(0, mesh.vertices.size() - 1);
  double farthest = 0;
  for (int i = 0; i < count; ++i) {
    Vec3d p{0, 0, 0};
    double sum = 0;
    for (int k = 0; k < 4; ++k) {
      const double w = weight(bits);
      p += mesh.vertices[pick(bits)] * w;
      sum += w;
    }
    farthest = std::max(farthest, distance_to(mesh, p * (1 / sum), closed));
  }
  return farthest;
}

TEST(HullExcess, AConvexMeshHasNone) {
  const Shape box = make_box({0.3, 0.4, 0.5});
  for (const Shape& shape : {box, make_uv_sphere(2, 5), make_uv_sphere(0.5, 40)}) {
    for (const bool inside_out : {false, true}) {
      Source mesh{shape.vertices, shape.triangles};
      if (inside_out)
        for (Triangle& t : mesh.triangles) std::swap(t[0], t[1]);
      const HullExcess e = measure(mesh).excess;
      EXPECT_LE(e.distance, 1e-9) << mesh.vertices.size();
      EXPECT_NEAR(e.solid_volume / e.hull_volume, 1, 1e-8);
    }
  }
  EXPECT_EQ(measure({box.vertices, box.triangles}).excess.distance, 0);
  // In float32, far from its frame's origin, and as triangles that share nothing.
  Source rounded = mesh_files::ball(), far = rounded, soup;
  EXPECT_LE(measure(rounded).excess.distance, 1e-5);
  for (Vec3d& v : far.vertices) v = v + Vec3d{4.3e6, 5.7e6, 0};
  EXPECT_LE(measure(far).excess.distance, 1e-5);
  for (const Triangle& t : rounded.triangles) {
    const auto n = static_cast<std::uint32_t>(soup.vertices.size());
    for (const std::uint32_t i : t) soup.vertices.push_back(rounded.vertices[i]);
    soup.triangles.push_back({n, n + 1, n + 2});
  }
  EXPECT_LE(measure(soup).excess.distance, 1e-5);
}

TEST(HullExcess, TheBoundHoldsAndIsNotFar) {
  std::vector<std::pair<const char*, Source>> cases;
  cases.emplace_back("shelf", shelf());
  Source apart;
  add(&apart, make_uv_sphere(0.2, 8), {-1, 0, 0});
  add(&apart, make_box({0.3, 0.3, 0.3}), {1, 0.4, 0});
  cases.emplace_back("two things apart", apart);
  Source cavity;
  add(&cavity, make_box({1, 1, 1}), {0, 0, 0});
  Shape hole = make_uv_sphere(0.4, 10);
  for (Triangle& t : hole.triangles) std::swap(t[0], t[1]);
  add(&cavity, hole, {0, 0, 0});
  cases.emplace_back("a cavity", cavity);
  // A dented ball: every vertex moved in or out.
  Shape dented = make_uv_sphere(1, 12);
  std::mt19937 bits(3);
  std::uniform_real_distribution<double> size(0.4, 1.0);
  for (Vec3d& v : dented.vertices) v = v * size(bits);
  cases.emplace_back("dented", Source{dented.vertices, dented.triangles});
  for (const auto& [name, mesh] : cases) {
    SCOPED_TRACE(name);
    const Result r = measure(mesh);
    const double met = farthest_met(mesh, true, 1500);
    ASSERT_GT(met, 0.05 * r.part->spread) << "the mesh is not concave enough for the test";
    EXPECT_GE(r.excess.distance, met);
    // Samples miss the farthest point by a little, and the dents need more visits than a mesh gets.
    const double too_much = std::string(name) == "dented" ? 2 : 1.25;
    EXPECT_LE(r.excess.distance, too_much * 1.15 * met + 0.01 * r.part->spread);
    EXPECT_FALSE(std::isnan(r.excess.solid_volume) && std::string(name) != "a cavity");
  }
}

TEST(HullExcess, TheShareThatIsEmptyIsThatOfTheVolumes) {
  const HullExcess e = measure(shelf()).excess;
  const double w = 0.8, d = 0.3, h = 1.8, t = 0.016;
  const double solid = w * t * h + 2 * t * (d - 2 * t) * h + 5 * (w - 3 * t) * (d - 2 * t) * t;
  EXPECT_NEAR(e.solid_volume, solid, 1e-12);
  EXPECT_NEAR(e.solid_volume / e.hull_volume, 0.13, 0.01);
  Source open = mesh_files::ball();
  open.triangles.pop_back();
  EXPECT_TRUE(std::isnan(measure(open).excess.solid_volume)) << "a hole: nothing is enclosed";
  EXPECT_GE(measure(open).excess.distance, farthest_met(open, false, 2000));
}

// The great icosahedron: all its edges are convex and its topology is a sphere's, but it winds around its centre seven
// times.
TEST(HullExcess, ASurfaceThatWindsSeveralTimesIsNotTakenForConvex) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  Source great;
  for (const double s : {-1.0, 1.0})
    for (const double u : {-g, g}) {
      great.vertices.push_back({0, s, u});
      great.vertices.push_back({s, u, 0});
      great.vertices.push_back({u, 0, s});
    }
  const auto is_long = [&](std::uint32_t a, std::uint32_t b) {
    return std::abs(norm(great.vertices[a] - great.vertices[b]) - 2 * g) < 1e-9;
  };
  for (std::uint32_t a = 0; a < 12; ++a)
    for (std::uint32_t b = a + 1; b < 12; ++b)
      for (std::uint32_t c = b + 1; c < 12; ++c) {
        if (!is_long(a, b) || !is_long(b, c) || !is_long(c, a)) continue;
        const Vec3d &p = great.vertices[a], &q = great.vertices[b], &r = great.vertices[c];
        const bool outward = dot(cross(q - p, r - p), p) > 0;
        great.triangles.push_back(outward ? Triangle{a, b, c} : Triangle{a, c, b});
      }
  ASSERT_EQ(great.triangles.size(), 2 * great.vertices.size() - 4);
  EXPECT_GE(measure(great).excess.distance, 0.1);
}

TEST(HullExcess, BodiesPublishItAndWarn) {
  const TemporaryFolder folder;
  const Source mesh = shelf(), ball = mesh_files::ball();
  folder.write("shelf.obj", mesh_files::obj(mesh));
  folder.write("shelf.stl", mesh_files::stl_binary(mesh));
  folder.write("ball.ply", mesh_files::ply(ball, mesh_files::Ply::kLittle));
  folder.write("parts.stl", [&] {
    std::string text;
    for (std::size_t i = 0; i < mesh.triangles.size(); i += 12)
      text += mesh_files::stl_text({mesh.vertices,
                                    {mesh.triangles.begin() + static_cast<std::ptrdiff_t>(i),
                                     mesh.triangles.begin() + static_cast<std::ptrdiff_t>(i) + 12}});
    return text;
  }());
  const engine::Scene scene = engine::Scene::load(folder.write("scene.yaml", R"(
bodies:
  - {name: shelf, mesh: shelf.obj, mesh_as: hull}
  - {name: twice, mesh: shelf.stl, scale: [2, 2, -2], mesh_as: hull}
  - {name: parts, mesh: parts.stl, mesh_as: parts}
  - {name: ball, mesh: ball.ply}
  - {name: box, box: 1}
)"));
  const auto& b = scene.bodies();
  EXPECT_GT(b[0].hull_excess, 0.12);
  EXPECT_LT(b[0].hull_excess, 0.29);
  EXPECT_NEAR(b[0].empty_share, 0.87, 0.01);
  EXPECT_NE(mesh_warning(b[0]).find("m out of its mesh"), std::string::npos) << mesh_warning(b[0]);
  EXPECT_NE(mesh_warning(b[0]).find(" % of it is empty"), std::string::npos) << mesh_warning(b[0]);
  EXPECT_GT(b[1].hull_excess, 0.24);
  EXPECT_NEAR(b[1].empty_share, 0.87, 0.01);
  EXPECT_EQ(b[2].parts.size(), 8u);
  EXPECT_LT(b[2].hull_excess, 1e-9);
  EXPECT_NEAR(b[2].empty_share, 0, 1e-9);
  for (std::size_t i = 2; i < b.size(); ++i) EXPECT_EQ(mesh_warning(b[i]), "") << b[i].name;
  EXPECT_EQ(b[4].hull_excess, 0);
  EXPECT_EQ(b[4].empty_share, 0);
}

TEST(MeshWarnings, NameMeshesInMillimetres) {
  const TemporaryFolder folder;
  folder.write("part.obj", "v 0 0 0\nv 137 0 0\nv 0 40 0\nv 0 0 12\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n");
  const engine::Scene scene = engine::Scene::load(folder.write("scene.yaml", R"(
bodies:
  - {name: metres, mesh: part.obj}
  - {name: mm, mesh: part.obj, scale: 0.001}
  - {name: below, mesh: part.obj, scale: 0.36}
  - {name: surface, mesh: part.obj, mesh_as: surface}
  - {name: floor, box: [200, 200, 1]}
)"));
  const std::vector<MeshWarning> warnings = mesh_warnings(scene);
  ASSERT_EQ(warnings.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(warnings[i].body, 3 * i);
    EXPECT_EQ(warnings[i].text,
              "its mesh is 137 m wide: coordinates are metres, and a file in millimetres needs scale: 0.001");
  }
}

}  // namespace
}  // namespace clearance
