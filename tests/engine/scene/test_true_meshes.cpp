// Bodies that are their triangles, or the space these enclose: loading, sharing, moving, caching and saving a mesh, and
// meshes that are rejected.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "engine/base/digest.h"
#include "engine/bvh/surface.h"
#include "engine/cache/cache.h"
#include "engine/device/hull_arrays.h"
#include "engine/geometry/link_geometry.h"
#include "engine/geometry/mesh_geometry.h"
#include "engine/hull/hull.h"
#include "engine/hull/shapes.h"
#include "engine/scene/mesh_warning.h"
#include "tests/error_text.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

struct Source {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;
};

/// A box of edge 2 about the origin that is hollow above: a cup with walls, its floor at -1. Closed, and not convex.
Source cup() {
  Source mesh;
  for (const double r : {1.0, 0.5})
    for (const double z : {-1.0, 1.0})
      for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}})
        mesh.vertices.push_back({r * x, r * y, r == 1 || z > 0 ? z : -0.5});
  const auto quad = [&mesh](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  quad(3, 2, 1, 0);    // the bottom
  quad(8, 9, 10, 11);  // the floor inside
  for (std::uint32_t i = 0; i < 4; ++i) {
    const std::uint32_t j = (i + 1) % 4;
    quad(i, j, 4 + j, 4 + i);            // walls outside
    quad(8 + j, 8 + i, 12 + i, 12 + j);  // and inside
    quad(4 + i, 4 + j, 12 + j, 12 + i);  // the rim
  }
  return mesh;
}

std::uint32_t add(engine::Scene& scene, const std::string& name, const Source& mesh, MeshAs mesh_as,
                  const engine::Scene::BodyOptions& options = {}) {
  return scene.add_mesh(name, mesh.vertices, mesh.triangles, mesh_as, options);
}

std::string off(const Source& mesh) {
  std::string text =
      "OFF\n" + std::to_string(mesh.vertices.size()) + " " + std::to_string(mesh.triangles.size()) + " 0\n";
  for (const Vec3d& v : mesh.vertices)
    text += std::to_string(v.x) + " " + std::to_string(v.y) + " " + std::to_string(v.z) + "\n";
  for (const Triangle& t : mesh.triangles)
    text += "3 " + std::to_string(t[0]) + " " + std::to_string(t[1]) + " " + std::to_string(t[2]) + "\n";
  return text;
}

void expect_same_surfaces(const Surface& a, const Surface& b) {
  EXPECT_EQ(a.digest(), b.digest());
  EXPECT_EQ(a.is_solid(), b.is_solid());
  EXPECT_TRUE(std::ranges::equal(a.triangles(), b.triangles()));
  EXPECT_TRUE(std::ranges::equal(a.places(), b.places()));
  EXPECT_EQ(a.vertices().size(), b.vertices().size());
}

TEST(TrueMesh, IsOneProxyOfItsTriangles) {
  engine::Scene scene;
  for (const MeshAs how : {MeshAs::kHull, MeshAs::kSurface, MeshAs::kSolid})
    add(scene, std::string(word_of(how)), cup(), how);
  const auto& bodies = scene.bodies();
  for (const Body& body : bodies) {
    ASSERT_EQ(body.parts.size(), 1u);
    EXPECT_EQ(body.parts[0]->vertices.size(), 8u) << "what lies within the hull is not one of its vertices";
    EXPECT_EQ(body.source, "mesh (" + body.name + ")");
    ASSERT_TRUE(body.display);
    EXPECT_EQ(body.display->triangles.size(), 28u);
  }
  EXPECT_EQ(surface_of(bodies[0]), nullptr);
  EXPECT_NEAR(bodies[0].empty_share, 1.5 / 8, 1e-12);
  EXPECT_NE(mesh_warning(bodies[0]), "");
  EXPECT_EQ(triangle_count(bodies[0]), 0u);
  for (const std::size_t i : {1u, 2u}) {
    ASSERT_NE(surface_of(bodies[i]), nullptr);
    EXPECT_EQ(surface_of(bodies[i])->is_solid(), i == 2);
    EXPECT_EQ(triangle_count(bodies[i]), 28u);
    EXPECT_EQ(bodies[i].hull_excess, 0) << "nothing stands out of the truth";
    EXPECT_EQ(bodies[i].empty_share, 0);
    EXPECT_EQ(mesh_warning(bodies[i]), "");
  }
  EXPECT_TRUE(scene.has_surfaces());
  engine::Scene convex;
  add(convex, "hull", cup(), MeshAs::kHull);
  EXPECT_FALSE(convex.has_surfaces());
}

// ---- defaults

Source box_at(const Vec3d& at) {
  const Shape box = make_box({1, 1, 1});
  Source mesh{{}, {box.triangles.begin(), box.triangles.end()}};
  for (const Vec3d& v : box.vertices) mesh.vertices.push_back(v + at);
  return mesh;
}
Source beside(Source a, const Source& b) {
  const auto base = static_cast<std::uint32_t>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (const Triangle& t : b.triangles) a.triangles.push_back({base + t[0], base + t[1], base + t[2]});
  return a;
}

TEST(TrueMesh, TheDefaultIsExact) {
  Source open = cup(), turned = cup();
  open.triangles.pop_back();
  std::swap(turned.triangles[3][0], turned.triangles[3][1]);
  Source inside_out = box_at({0, 0, 0});
  for (Triangle& t : inside_out.triangles) std::swap(t[0], t[1]);
  engine::Scene scene;
  add(scene, "box", box_at({0, 0, 0}), MeshAs::kAuto);
  add(scene, "inside out", inside_out, MeshAs::kAuto);
  add(scene, "cup", cup(), MeshAs::kAuto);
  add(scene, "two", beside(box_at({0, 0, 0}), box_at({3, 0, 0})), MeshAs::kAuto);
  add(scene, "open", open, MeshAs::kAuto);
  add(scene, "turned", turned, MeshAs::kAuto);
  const auto& b = scene.bodies();
  for (const std::size_t i : {0u, 1u, 4u, 5u}) {
    EXPECT_EQ(surface_of(b[i]), nullptr) << b[i].name;
    EXPECT_EQ(b[i].source, "mesh (hull)");
  }
  for (const std::size_t i : {0u, 1u, 2u, 3u}) {
    EXPECT_EQ(b[i].hull_excess, 0) << b[i].name;
    EXPECT_EQ(b[i].model_error, 0) << b[i].name;
    EXPECT_EQ(mesh_warning(b[i]), "") << b[i].name;
  }
  for (const std::size_t i : {2u, 3u}) {
    ASSERT_NE(surface_of(b[i]), nullptr) << b[i].name;
    EXPECT_TRUE(surface_of(b[i])->is_solid());
    EXPECT_EQ(b[i].source, "mesh (solid)");
  }
  EXPECT_EQ(b[2].parts[0], [&] {
    add(scene, "said", cup(), MeshAs::kSolid);
    return scene.bodies().back().parts[0];
  }()) << "what was found out is what may be said";
}

TEST(TrueMesh, AnOpenMeshIsItsHullAndAnEdgeSaysWhy) {
  Source open = cup(), turned = cup();
  open.triangles.pop_back();
  std::swap(turned.triangles[3][0], turned.triangles[3][1]);
  const TemporaryFolder folder;
  const std::string file = folder.write("open.off", off(open));
  engine::Scene scene;
  scene.add_mesh("a", file, {1, 1, 1}, MeshAs::kAuto, {});
  scene.add_mesh("b", folder.write("turned.off", off(turned)), {2, 2, 2}, MeshAs::kAuto, {});
  add(scene, "closed", cup(), MeshAs::kHull);
  scene.add_mesh("c", file, {1, 1, 1}, MeshAs::kAuto, {});
  const std::vector<MeshWarning> warnings = mesh_warnings(scene);
  ASSERT_EQ(warnings.size(), 4u);
  const auto says = [&](std::size_t i, const std::string& what) {
    EXPECT_NE(warnings[i].text.find(what), std::string::npos) << warnings[i].text;
  };
  says(0, ": distances are to the hull; " + file + " (hull) encloses nothing: the edge from (");
  says(0, " belongs to no other triangle: the mesh is open there; mesh_as: surface uses its triangles as they are");
  says(1, "turned.off (hull) encloses nothing: the edge from (");
  says(1, "inconsistent orientations");
  EXPECT_EQ(warnings[2].text.find("edge"), std::string::npos) << "its hull was asked for: " << warnings[2].text;
  EXPECT_EQ(warnings[3].text, warnings[0].text);
  EXPECT_EQ(mesh_warnings(scene, 3).size(), 1u);
}

// A ball as a file of float32 has it: no face is where it was, and the hull stands out by a rounding.
TEST(TrueMesh, AConvexMeshOfRoundedVerticesIsItsHullWithSlack) {
  const Shape ball = make_uv_sphere(1, 12);
  Source rounded{ball.vertices, {ball.triangles.begin(), ball.triangles.end()}}, dented = rounded;
  for (Vec3d& v : rounded.vertices)
    for (int k = 0; k < 3; ++k) v[k] = static_cast<float>(v[k]);
  dented.vertices[40] = dented.vertices[40] * (1 - 1e-3);
  engine::Scene scene;
  add(scene, "rounded", rounded, MeshAs::kAuto);
  add(scene, "hull", rounded, MeshAs::kHull);
  add(scene, "dented", dented, MeshAs::kAuto);
  const auto& b = scene.bodies();
  EXPECT_EQ(b[0].parts[0], b[1].parts[0]) << "the same hull";
  EXPECT_EQ(b[0].hull_excess, 0);
  EXPECT_GT(b[0].model_error, 1e-9);
  EXPECT_LT(b[0].model_error, 1e-6);
  EXPECT_EQ(b[0].model_inner, 0) << "no point of the mesh is beside its hull";
  EXPECT_NEAR(b[0].model_error, b[1].hull_excess, 1e-10);
  EXPECT_EQ(b[1].model_error, 0) << "the hull was asked for";
  ASSERT_NE(surface_of(b[2]), nullptr);
  EXPECT_TRUE(surface_of(b[2])->is_solid());
}

TEST(TrueMesh, TheDefaultIsKeptInTheCache) {
  const TemporaryFolder folder;
  const std::string file = folder.write("cup.off", off(cup()));
  MeshGeometries geometries;
  for (int round = 0; round < 2; ++round) {
    MeshFile mesh(file);
    const Geometry made = geometries.make(mesh, {.mesh_as = MeshAs::kAuto}, "cup.off");
    const std::optional<Geometry> kept = geometry_of_record(geometry_record(made));
    ASSERT_TRUE(kept);
    EXPECT_EQ(mesh_source("cup.off", MeshAs::kAuto, *kept), "cup.off (solid)");
    EXPECT_EQ(made.source, "cup.off (solid)");
  }
}

TEST(TrueMesh, PartsOfEqualVerticesAreSharedWhereTheirTrianglesAreEqual) {
  engine::Scene scene;
  add(scene, "one", cup(), MeshAs::kSolid);
  add(scene, "same", cup(), MeshAs::kSolid);
  add(scene, "surface", cup(), MeshAs::kSurface);
  add(scene, "hull", cup(), MeshAs::kHull);
  Source box = cup();  // the same vertices, and only the outer box's faces
  box.triangles.clear();
  const Shape plain = make_box({2, 2, 2});
  for (const Triangle& t : plain.triangles) {
    Triangle corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3d& v = plain.vertices[t[k]];
      const auto at = std::ranges::find_if(box.vertices, [&](const Vec3d& w) { return squared_norm(v - w) == 0; });
      corners[k] = static_cast<std::uint32_t>(at - box.vertices.begin());
    }
    box.triangles.push_back(corners);
  }
  add(scene, "box", box, MeshAs::kSolid);
  const auto part = [&](std::size_t i) { return scene.bodies()[i].parts[0]; };
  EXPECT_EQ(part(0), part(1));
  for (std::size_t i = 0; i < 5; ++i)
    for (std::size_t j = 2; j < 5; ++j) EXPECT_EQ(part(i) == part(j), i == j) << i << " and " << j;
}

TEST(TrueMesh, TheRevisionKnowsWhatABodyIs) {
  const auto revision = [](const Source& mesh, MeshAs how) {
    engine::Scene scene;
    add(scene, "it", mesh, how);
    return scene.revision();
  };
  Source turned = cup();
  std::rotate(turned.triangles.begin(), turned.triangles.begin() + 1, turned.triangles.end());
  const std::vector<std::uint64_t> all = {revision(cup(), MeshAs::kHull), revision(cup(), MeshAs::kSurface),
                                          revision(cup(), MeshAs::kSolid), revision(turned, MeshAs::kSolid)};
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(all[i], all[j]);
  EXPECT_EQ(revision(cup(), MeshAs::kSolid), all[2]);
}

TEST(TrueMesh, PaddingGrowsItAndKeepsItsTriangles) {
  engine::Scene scene;
  engine::Scene::BodyOptions options;
  options.radius = 0.25;
  options.padding = 0.5;
  add(scene, "cup", cup(), MeshAs::kSolid, options);
  add(scene, "plain", cup(), MeshAs::kSolid);
  EXPECT_NEAR(scene.bodies()[0].parts[0]->radius, 0.75, 1e-15);
  ASSERT_NE(surface_of(scene.bodies()[0]), nullptr);
  expect_same_surfaces(*surface_of(scene.bodies()[0]), *surface_of(scene.bodies()[1]));
  EXPECT_NE(scene.bodies()[0].parts[0]->digest, scene.bodies()[1].parts[0]->digest);
}

TEST(TrueMesh, MovesWithItsHullAroundIt) {
  std::mt19937_64 random(21);
  std::uniform_real_distribution<double> number(-3, 3);
  Source mesh = cup();
  for (int i = 0; i < 40; ++i) {  // slivers whose corners lie in the faces of the hull, but for rounding
    const auto n = static_cast<std::uint32_t>(mesh.vertices.size());
    for (int k = 0; k < 3; ++k) mesh.vertices.push_back({number(random) / 3, number(random) / 3, -1});
    mesh.triangles.push_back({n, n + 1, n + 2});
  }
  const Geometry still = geometry_of_triangles(mesh.vertices, mesh.triangles, MeshAs::kSurface, 0.125);
  int outside = 0;
  for (int i = 0; i < 20; ++i) {
    const Origin X{{number(random), number(random), number(random)}, {number(random), number(random), number(random)}};
    const Geometry there = moved(still, X);
    const ConvexPart& part = *there.parts[0];
    ASSERT_TRUE(part.surface);
    EXPECT_EQ(part.radius, 0.125);
    EXPECT_FALSE(part.surface->is_solid());
    EXPECT_EQ(triangles_as_loaded(*part.surface), mesh.triangles);
    EXPECT_GT(there.model_error, 0);
    EXPECT_LT(there.model_error, 1e-14);
    EXPECT_EQ(there.model_error, there.model_inner);
    EXPECT_EQ(reduce_to_hull(part.surface->vertices()).vertices.size(), part.vertices.size());
    outside += part.vertices.size() > still.parts[0]->vertices.size();
    EXPECT_TRUE(std::ranges::equal(there.display->vertices, part.surface->vertices(),
                                   [](const Vec3d& a, const Vec3d& b) { return squared_norm(a - b) == 0; }));
  }
  EXPECT_GT(outside, 0) << "no rounding moved a vertex out of the hull of the others: the case is not met";
}

TEST(TrueMesh, JoinsOtherShapesAsOnePartOfThem) {
  std::vector<Geometry> parts;
  const Source mesh = cup();
  parts.push_back(geometry_of_triangles(mesh.vertices, mesh.triangles, MeshAs::kSolid, 0));
  parts.push_back(geometry_of_shape(make_box({1, 1, 1}), 0, "box"));
  const Geometry both = joined(std::move(parts));
  ASSERT_EQ(both.parts.size(), 2u);
  EXPECT_TRUE(both.parts[0]->surface);
  EXPECT_FALSE(both.parts[1]->surface);
}

TEST(TrueMesh, IsTheSameFromARecord) {
  const Source mesh = cup();
  for (const Tables tables : {Tables::kKept, Tables::kMadeAnew})
    for (const MeshAs how : {MeshAs::kSurface, MeshAs::kSolid})
      for (const double radius : {0.0, 0.25}) {
        const Geometry made = geometry_of_triangles(mesh.vertices, mesh.triangles, how, radius);
        Geometry without = made;
        without.display = nullptr;
        for (const Geometry& geometry : {made, moved(made, {{1, 2, 3}, {0.1, 0.2, 0.3}}), without}) {
          const std::vector<std::byte> record = geometry_record(geometry, tables);
          const std::optional<Geometry> again = geometry_of_record(record, tables);
          ASSERT_TRUE(again);
          ASSERT_EQ(again->parts.size(), 1u);
          const ConvexPart &was = *geometry.parts[0], &is = *again->parts[0];
          ASSERT_TRUE(is.surface);
          expect_same_surfaces(*was.surface, *is.surface);
          EXPECT_EQ(was.digest, is.digest);
          EXPECT_EQ(was.radius, is.radius);
          EXPECT_EQ(was.loaded_vertices, is.loaded_vertices);
          EXPECT_EQ(was.vertices.size(), is.vertices.size());
          EXPECT_EQ(geometry_record(*again, tables), record);
        }
      }
}

TEST(TrueMesh, ADamagedRecordIsNone) {
  const Source mesh = cup();
  const Geometry whole = geometry_of_triangles(mesh.vertices, mesh.triangles, MeshAs::kSolid, 0);
  Geometry bare = whole;
  bare.display = nullptr;  // so that vertices and triangles are in the record
  const std::vector<std::byte> record = geometry_record(bare);
  for (std::size_t size = 0; size < record.size(); ++size)
    EXPECT_FALSE(geometry_of_record(std::span(record).first(size))) << size;
  int rejected = 0;
  for (std::size_t at = 0; at < record.size(); at += 3) {
    std::vector<std::byte> damaged = record;
    damaged[at] ^= std::byte{0xFF};
    const auto geometry = geometry_of_record(damaged);  // if accepted, it must be usable
    rejected += !geometry;
    const Surface* const surface = geometry ? geometry->parts[0]->surface.get() : nullptr;
    if (!surface) continue;
    for (const Triangle& t : surface->triangles()) EXPECT_LT(std::max({t[0], t[1], t[2]}), surface->vertices().size());
  }
  EXPECT_GT(rejected, 100);
}

struct BadMesh {
  const char* text;
  MeshAs mesh_as;
  void (*spoil)(Source&);
};

TEST(TrueMesh, WhatIsWrongWithAMeshIsReported) {
  const BadMesh cases[] = {
      {"mesh_as: solid: the mesh encloses no volume: the edge from (1, 1, 1) to (1, -1, 1) of triangle 11 "
       "belongs to no other triangle: the mesh is open there",
       MeshAs::kSolid, [](Source& m) { m.triangles.erase(m.triangles.begin() + 14); }},
      {"inconsistent orientations", MeshAs::kSolid, [](Source& m) { std::swap(m.triangles[3][0], m.triangles[3][1]); }},
      {"inconsistent orientations", MeshAs::kSolid, [](Source& m) { m.triangles.push_back(m.triangles[5]); }},
      {"mesh_as: surface: the mesh has no triangles", MeshAs::kSurface, [](Source& m) { m.triangles.clear(); }},
      {"mesh_as: solid: the mesh has no triangles", MeshAs::kSolid, [](Source& m) { m.triangles.clear(); }},
      {"triangle 2 names the vertex 16, and there are 16", MeshAs::kSolid, [](Source& m) { m.triangles[2][1] = 16; }},
      {"triangle 2 names the vertex 4294967295, and there are 16", MeshAs::kHull,
       [](Source& m) { m.triangles[2][1] = ~0u; }},
      {"vertex 3 has the coordinate", MeshAs::kSurface, [](Source& m) { m.vertices[3].y = NAN; }},
      {"vertex 3 has the coordinate", MeshAs::kSurface, [](Source& m) { m.vertices[3].y = 1e61; }},
      {"at least one vertex", MeshAs::kSolid, [](Source& m) { m.vertices.clear(); }},
  };
  for (const BadMesh& bad : cases) {
    Source mesh = cup();
    bad.spoil(mesh);
    engine::Scene scene;
    const std::string text = error_text<engine::SceneError>([&] { add(scene, "cup", mesh, bad.mesh_as); });
    EXPECT_NE(text.find("body \"cup\": "), std::string::npos) << text;
    EXPECT_NE(text.find(bad.text), std::string::npos) << text;
    EXPECT_TRUE(scene.bodies().empty());
    if (bad.mesh_as == MeshAs::kSolid && !mesh.triangles.empty() && text.find("encloses") != std::string::npos) {
      EXPECT_EQ(add(scene, "cup", mesh, MeshAs::kSurface), 0u) << "an open mesh is a surface all the same";
    }
  }
}

TEST(TrueMesh, VerticesOfEqualPlacesCloseIt) {
  Source soup;  // every triangle has corners of its own, as in STL
  const Source mesh = cup();
  for (const Triangle& t : mesh.triangles) {
    const auto n = static_cast<std::uint32_t>(soup.vertices.size());
    for (const std::uint32_t corner : t) soup.vertices.push_back(mesh.vertices[corner]);
    soup.triangles.push_back({n, n + 1, n + 2});
  }
  engine::Scene scene;
  add(scene, "soup", soup, MeshAs::kSolid);
  const ConvexPart& part = *scene.bodies()[0].parts[0];
  EXPECT_EQ(part.surface->vertices().size(), 16u);
  EXPECT_EQ(part.surface->parts().size(), 1u);
  EXPECT_EQ(part.loaded_vertices, 84u);
}

TEST(TrueMesh, OfAFileIsScaledMirroredAndNamed) {
  const TemporaryFolder folder;
  const std::string file = folder.write("cup.off", off(cup()));
  engine::Scene scene;
  scene.add_mesh("a", file, {1, 1, 1}, MeshAs::kSolid, {});
  scene.add_mesh("b", file, {0.5, -2, 1}, MeshAs::kSolid, {});
  EXPECT_EQ(scene.bodies()[0].source, file + " (solid)");
  for (const Body& body : scene.bodies()) {
    const Surface& solid = *surface_of(body);
    double volume = 0;
    for (std::uint32_t t = 0; t < solid.triangles().size(); ++t) {
      const auto [p, q, r] = solid.corners(t);
      volume += dot(p, cross(q, r)) / 6;
    }
    EXPECT_NEAR(volume, 6.5, 1e-12) << "mirrored, its faces turn with it";
  }
  const std::string open =
      folder.write("open.off", "OFF\n4 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n");
  EXPECT_EQ(error_text<engine::SceneError>([&] { scene.add_mesh("c", open, {1, 1, 1}, MeshAs::kSolid, {}); }),
            "body \"c\": " + open +
                ": mesh_as: solid: the mesh encloses no volume: the edge from (0, 0, 0) to (0, 1, 0) of triangle 0 "
                "belongs to no other triangle: the mesh is open there");
}

TEST(TrueMesh, ADeviceLeavesItToTheProcessor) {
  engine::Scene scene;
  add(scene, "solid", cup(), MeshAs::kSolid);
  add(scene, "surface", cup(), MeshAs::kSurface);
  add(scene, "hull", cup(), MeshAs::kHull);
  const cuda::HullArrays arrays(scene, 1 << 16);
  EXPECT_EQ(arrays.of_body[0], kNone);
  EXPECT_EQ(arrays.of_body[1], kNone);
  EXPECT_NE(arrays.of_body[2], kNone);
}

}  // namespace
}  // namespace clearance
