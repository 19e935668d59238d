// Compares covers of meshes with exact geometry: points of a solid or surface lie in balls on every level, those a hair
// within a solid included, and inner radii hold.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "engine/cover/cover.h"
#include "engine/cover/mesh/mesh_cells.h"
#include "engine/geometry/make_geometry.h"
#include "tests/oracle/cases/mesh_shapes.h"
#include "tests/oracle/decision/cover_points.h"
#include "wire/types.h"

namespace clearance {
namespace {

using exact::Mesh;
using exact::Random;
using exact::SolidPtr;

constexpr double kEffort = 0.1;  // wider balls, made with the same proofs

struct MeshBody {
  std::string kind;
  SolidPtr solid;

  ConvexPartPtr part() const {
    return make_surface_part(solid->vertices, solid->triangles, solid->is_solid, solid->radius, solid->vertices.size());
  }
};

Mesh with_cavity() {
  Mesh mesh = exact::box_mesh({0.5, 0.4, 0.3});
  exact::append(mesh, exact::flipped(exact::box_mesh({0.4, 0.3, 0.2})));
  exact::append(mesh, exact::moved(exact::box_mesh({0.1, 0.1, 0.1}), {0.05, 0, 0}));
  return mesh;
}

std::vector<MeshBody> bodies() {
  Random random(48);
  const auto solid = [](const std::string& kind, Mesh mesh, double radius = 0) {
    return MeshBody{kind, exact::solid(std::move(mesh), true, radius)};
  };
  const Mesh triangle{{{0.1, 0, 0}, {0.4, 0.1, 0}, {0.2, 0.5, 0.3}}, {{0, 1, 2}}};
  std::vector<MeshBody> all{solid("bent", exact::bent(random)),
                            solid("shelf", exact::shelf(random)),
                            solid("ring", exact::ring(random)),
                            solid("mug", exact::mug(random)),
                            solid("spiral", exact::spiral(random)),
                            solid("comb", exact::comb(random, 0.01)),
                            solid("ball", exact::ball(random)),
                            solid("lattice", exact::cells(random, 0.125)),
                            solid("plate", exact::plate(random, 1e-3)),
                            solid("cavity", with_cavity()),
                            solid("inside out", exact::flipped(exact::bent(random))),
                            solid("grown", exact::comb(random, 0.05), 0.03125),
                            solid("tiny", exact::scaled(exact::mug(random), {1e-6, 1e-6, 1e-6})),
                            solid("far", exact::moved(exact::mug(random), {300, -200, 100})),
                            {"cracked", exact::solid(exact::cracked(random, exact::mug(random), 1e-3), false)},
                            {"grown surface", exact::solid(exact::ring(random), false, 0.0625)},
                            {"hollow", exact::solid(exact::bent(random), false)},
                            {"triangle", exact::solid(triangle, false)}};
  return all;
}

/// A point of a random triangle.
Vec3q on_triangle(const exact::Solid& body, Random& random, std::size_t* triangle = nullptr) {
  const auto t = static_cast<std::size_t>(random.integer(0, static_cast<int>(body.triangles.size()) - 1));
  if (triangle) *triangle = t;
  Vec3q p{0, 0, 0};
  int sum = 0;
  for (const std::uint32_t corner : body.triangles[t]) {
    const int weight = random.integer(0, 9);
    p = p + times(rational(body.vertices[corner]), weight);
    sum += weight;
  }
  return sum == 0 ? rational(body.vertices[body.triangles[t][0]]) : times(p, mpq_class(1, sum));
}

/// Whether a point is in a solid, which includes its triangles.
bool is_within(const exact::Solid& body, const Vec3d& p) {
  try {
    return body.is_solid && exact::exact_winding_number(exact::body_view(body), Pose{}, p) != 0;
  } catch (const std::invalid_argument&) {  // on a triangle
    return true;
  }
}

/// A point next to a triangle, as near as rounding allows or farther, or anywhere in the bounding box.
Vec3d near_surface(const exact::Solid& body, Random& random) {
  std::size_t t = 0;
  const Vec3q q = on_triangle(body, random, &t);
  const Vec3d p{q.x.get_d(), q.y.get_d(), q.z.get_d()};
  const double size = norm(body.vertices[0] - body.vertices[body.vertices.size() / 2]);
  if (random.chance(0.3)) return p + random.direction() * random.uniform(0, size);
  const auto& [a, b, c] = body.triangles[t];
  const Vec3d n = cross(body.vertices[b] - body.vertices[a], body.vertices[c] - body.vertices[a]);
  return p + n * (random.sign() * size * random.log_uniform(1e-12, 0.1) / norm(n));
}

/// Whether the hull of some points, grown, holds a point.
bool holds(const std::vector<Vec3d>& points, double growth, const Vec3d& p) {
  if (points.empty()) return false;
  for (int k = 0; k < 3; ++k) {
    const auto along = [k](const Vec3d& a, const Vec3d& b) { return a[k] < b[k]; };
    const auto [low, high] = std::minmax_element(points.begin(), points.end(), along);
    if (p[k] < (*low)[k] - growth || p[k] > (*high)[k] + growth) return false;
  }
  return exact::exact_distance({points, 0}, Pose{}, {std::span(&p, 1), 0}, Pose{}).distance.compare(growth) <= 0;
}

TEST(MeshCover, CellsHoldTheBody) {
  Random random(51);
  for (const MeshBody& body : bodies()) {
    SCOPED_TRACE(body.kind);
    const ConvexPartPtr part = body.part();
    const MeshCells cells = mesh_cells(*part->surface, 100);
    EXPECT_LE(cells.points.size(), 101u);
    EXPECT_LT(cells.growth, 1e-11 * part->rho);
    const auto check = [&](const Vec3d& p) {
      EXPECT_TRUE(std::any_of(cells.points.begin(), cells.points.end(),
                              [&](const auto& points) { return holds(points, cells.growth, p); }))
          << p.x << " " << p.y << " " << p.z;
    };
    for (std::size_t i = 0; i < body.solid->vertices.size(); i += 1 + body.solid->vertices.size() / 50)
      check(body.solid->vertices[i]);
    for (int i = 0; i < 300 && body.solid->is_solid; ++i)
      if (const Vec3d p = near_surface(*body.solid, random); is_within(*body.solid, p)) check(p);
  }
}

// Corners in a solid hold what no triangle is near.
TEST(MeshCover, CellsHoldTheInteriorOfADentedBox) {
  Mesh mesh = exact::box_mesh({0.5, 0.5, 0.5});
  const auto faces = mesh.triangles;
  mesh.triangles.clear();
  for (const auto& [a, b, c] : faces) {
    const auto m = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) * (0.8 / 3));
    for (const Triangle& t : {Triangle{a, b, m}, {b, c, m}, {c, a, m}}) mesh.triangles.push_back(t);
  }
  const MeshBody body{"dented", exact::solid(std::move(mesh), true)};
  const ConvexPartPtr part = body.part();
  const MeshCells cells = mesh_cells(*part->surface, 300);
  EXPECT_GT(cells.points.size(), 100u);
  for (int x = -3; x <= 3; ++x)
    for (int y = -3; y <= 3; ++y)
      for (int z = -3; z <= 3; ++z) {
        const Vec3d p{0.03 * x, 0.03 * y, 0.03 * z};
        EXPECT_TRUE(is_within(*body.solid, p));
        EXPECT_TRUE(std::any_of(cells.points.begin(), cells.points.end(),
                                [&](const auto& points) { return holds(points, cells.growth, p); }))
            << x << " " << y << " " << z;
      }
}

TEST(MeshCover, HoldsPointsOnEveryLevel) {
  Random random(49);
  for (const MeshBody& body : bodies()) {
    SCOPED_TRACE(body.kind);
    const ConvexPartPtr part = body.part();
    const std::optional<Cover> cover = make_cover(std::span(&part, 1), nullptr, kEffort);
    ASSERT_TRUE(cover);
    const mpq_class radius(body.solid->radius);
    const auto check = [&](const Vec3q& p) {
      ASSERT_TRUE(has_path(*cover, p)) << p.x.get_d() << " " << p.y.get_d() << " " << p.z.get_d();
      EXPECT_LE(squared(p), mpq_class(cover->reach) * mpq_class(cover->reach));
    };
    for (std::size_t i = 0; i < body.solid->vertices.size(); i += 1 + body.solid->vertices.size() / 200)
      check(rational(body.solid->vertices[i]));
    for (int i = 0; i < 300; ++i) check(on_triangle(*body.solid, random) + times(unit(random), radius));
    int within = 0;
    for (int i = 0; i < 400 && body.solid->is_solid; ++i) {
      const Vec3d p = near_surface(*body.solid, random);
      if (!is_within(*body.solid, p)) continue;
      ++within;
      check(rational(p) + times(unit(random), radius));
    }
    EXPECT_TRUE(within > 50 || !body.solid->is_solid) << within;
  }
}

TEST(MeshCover, InnerRadiiHold) {
  Random random(50);
  int in_body = 0, near_body = 0;
  for (const MeshBody& body : bodies()) {
    SCOPED_TRACE(body.kind);
    const ConvexPartPtr part = body.part();
    const std::vector<CoverBall> balls = all_balls(*make_cover(std::span(&part, 1), nullptr, kEffort));
    exact::BodyView solid = exact::body_view(*body.solid), surface = solid;
    solid.radius = surface.radius = 0;
    surface.is_solid = false;
    for (std::size_t i = 0; i < balls.size(); i += 1 + balls.size() / 40) {
      const Vec3d c{balls[i].centre[0], balls[i].centre[1], balls[i].centre[2]};
      const exact::BodyView point{std::span(&c, 1), {}, false, 0};
      const double core = std::nextafter(double{balls[i].inner} - body.solid->radius, -1e9);
      if (core > 0) {
        ASSERT_TRUE(is_within(*body.solid, c)) << i;
        ASSERT_GE(exact::exact_distance(surface, Pose{}, point, Pose{}).distance.compare(core), 0) << i;
      } else {
        ASSERT_LE(exact::exact_distance(solid, Pose{}, point, Pose{}).distance.compare(-core), 0) << i;
      }
      ++(core > 0 ? in_body : near_body);
    }
  }
  EXPECT_GT(in_body, 100);
  EXPECT_GT(near_body, 100);
}

TEST(MeshCover, LevelsGetNarrower) {
  const Mesh wall = exact::box_mesh({0.5, 0.4, 0.01});
  Mesh corner = wall;
  exact::append(corner, exact::moved(exact::scaled(wall, {1, 0.025, 40}), {0, 0.41, 0.39}));
  const SolidPtr solid = exact::solid(corner, true);
  const ConvexPartPtr part = MeshBody{"corner", solid}.part();
  const MeshCells cells = mesh_cells(*part->surface, 600);
  EXPECT_GE(cells.points.size(), 2u);
  const Cover cover = *make_cover(std::span(&part, 1), nullptr, 0.3);
  for (int level = 1; level < Cover::kLevels; ++level)
    EXPECT_LT(stand_out(cover, level).mean, 0.75 * stand_out(cover, level - 1).mean) << level;
}

}  // namespace
}  // namespace clearance
