// Closed meshes whose winding numbers cancel: no solid, and by default their hull. Cavities and parts that are inside
// out as a whole are solids as before.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/bvh/enclosure.h"
#include "engine/bvh/surface.h"
#include "engine/geometry/make_geometry.h"
#include "engine/hull/shapes.h"
#include "engine/scene/mesh_warning.h"
#include "tests/error_text.h"

namespace clearance {
namespace {

struct Closed {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;

  Closed operator+(const Closed& other) const {
    Closed out = *this;
    const auto base = static_cast<std::uint32_t>(vertices.size());
    out.vertices.insert(out.vertices.end(), other.vertices.begin(), other.vertices.end());
    for (const Triangle& t : other.triangles) out.triangles.push_back({base + t[0], base + t[1], base + t[2]});
    return out;
  }
  Closed turned() const {
    Closed out = *this;
    for (Triangle& t : out.triangles) std::swap(t[1], t[2]);
    return out;
  }
  Closed moved(const Vec3d& by, const Vec3d& scale = {1, 1, 1}) const {
    Closed out = *this;
    for (Vec3d& v : out.vertices) v = Vec3d{v.x * scale.x, v.y * scale.y, v.z * scale.z} + by;
    return out;
  }
};

Closed of(const Shape& shape) {
  return {shape.vertices, {shape.triangles.begin(), shape.triangles.end()}};
}
Closed box(const Vec3d& low, const Vec3d& high) {
  return of(make_box({1, 1, 1})).moved((low + high) * 0.5, high - low);
}
Closed ball(double radius, const Vec3d& at = {0, 0, 0}) {
  return of(make_uv_sphere(radius, 8)).moved(at);
}
// Two boxes that cross.
Closed ell() {
  return box({0, 0, 0}, {2, 1, 1}) + box({0, 0.9, 0}, {1, 3, 1});
}

std::string hollow(const Closed& m) {
  return hollow_place(Surface(m.vertices, m.triangles, true));
}
bool is_solid(const Geometry& geometry) {
  return geometry.parts[0]->surface && geometry.parts[0]->surface->is_solid();
}

struct Named {
  const char* name;
  Closed mesh;
  const char* why;  // a part of the reason; of a solid empty
};

const char* const kBothWays = "has no volume on either side: faces are oriented both ways there";
const char* const kCrossing = " the other way: parts cross, and not all are turned alike";

std::vector<Named> meshes() {
  const Closed cube = box({0, 0, 0}, {1, 1, 1}), other = cube.moved({0.5, 0.5, 0.5}), sphere = ball(1);
  const Closed plate{{{0, 0, 2}, {1, 0, 2}, {1, 1, 2}, {0, 1, 2}}, {{0, 1, 2}, {0, 2, 3}, {0, 2, 1}, {0, 3, 2}}};
  Closed lidless = cube + cube.turned();
  std::erase_if(lidless.triangles, [&](const Triangle& t) {
    return lidless.vertices[t[0]].z + lidless.vertices[t[1]].z + lidless.vertices[t[2]].z == 3;
  });
  return {
      {"both sides", cube + cube.turned(), kBothWays},
      {"both sides of an L", ell() + ell().turned(), kBothWays},
      {"both sides of a ball", sphere + sphere.turned(), kBothWays},
      {"both sides, other diagonals", cube + Closed{cube.moved({1, 0, 0}, {-1, 1, 1})}, kBothWays},
      {"both sides, a little apart", cube + cube.turned().moved({1e-7, 2e-7, -1e-7}), ""},
      {"both sides, a little smaller", sphere + sphere.turned().moved({0, 0, 0}, {0.999999, 0.999999, 0.999999}),
       kBothWays},
      {"both sides of one part of many", sphere.moved({5, 0, 0}) + ball(2, {9, 9, 9}) + cube + cube.turned(),
       kBothWays},
      {"both sides within a cavity", ball(9) + ball(8).turned() + cube + cube.turned(), kBothWays},
      {"crossing, one inside out", cube + other.turned(), kCrossing},
      {"the other one", cube.turned() + other, kCrossing},
      {"along an axis", cube + cube.turned().moved({0.5, 0, 0}), ""},
      {"an L, one leg inside out", box({0, 0, 0}, {2, 1, 1}) + box({0, 0.9, 0}, {1, 3, 1}).turned(), ""},
      {"bars", box({-5, -0.1, -0.1}, {5, 0.1, 0.1}) + box({-0.1, -5, -0.05}, {0.1, 5, 0.15}).turned(), kCrossing},
      {"balls", sphere + ball(1, {1.9, 0, 0}).turned(), kCrossing},
      {"a ball through a wall", box({-9, -9, 0}, {9, 9, 0.5}) + ball(0.4, {3, 2, 0.1}).turned(), kCrossing},

      {"a cube", cube, nullptr},
      {"inside out", cube.turned(), nullptr},
      {"crossing", cube + other, nullptr},
      {"crossing, both inside out", cube.turned() + other.turned(), nullptr},
      {"an L", ell(), nullptr},
      {"the same twice", cube + cube, nullptr},
      {"apart, one inside out", cube + cube.turned().moved({2, 0, 0}), nullptr},
      {"a cavity", ball(1) + ball(0.5).turned(), nullptr},
      {"a cavity, inside out", ball(1).turned() + ball(0.5), nullptr},
      {"a thin wall", ball(1) + ball(0.999).turned(), nullptr},
      {"a ball in a cavity in a ball", ball(1) + ball(0.7).turned() + ball(0.4), nullptr},
      {"cavities", ball(1) + ball(0.3, {0.5, 0, 0}).turned() + ball(0.3, {-0.5, 0, 0}).turned(), nullptr},
      {"one on another", cube + cube.moved({0, 0, 1}), nullptr},
      {"a plate above it", cube + plate, nullptr},
      {"a box without a lid, both sides", lidless, nullptr},
  };
}

TEST(HollowMesh, IsNoSolid) {
  int bad = 0, good = 0;
  for (const auto& [name, mesh, why] : meshes()) {
    SCOPED_TRACE(name);
    const std::string got = hollow(mesh);
    const auto make = [&mesh = mesh](MeshAs how) {
      return geometry_of_triangles(mesh.vertices, mesh.triangles, how, 0);
    };
    if (!why) {
      EXPECT_EQ(got, "");
      EXPECT_TRUE(is_solid(make(MeshAs::kSolid)));
      ++good;
      continue;
    }
    ++bad;
    EXPECT_NE(got.find(why), std::string::npos) << got;
    EXPECT_NE(got, "");
    EXPECT_EQ(error_text<std::invalid_argument>([&] { make(MeshAs::kSolid); }),
              "mesh_as: solid: the mesh does not enclose all that its faces go around: " + got);
    const Geometry geometry = make(MeshAs::kAuto);
    EXPECT_FALSE(is_solid(geometry));
    EXPECT_EQ(geometry.source, "mesh (hull)");
    EXPECT_FALSE(is_solid(make(MeshAs::kSurface))) << "its triangles may be had";
  }
  EXPECT_EQ(bad, 15);
  EXPECT_EQ(good, 15);
}

TEST(HollowMesh, IsWarnedAboutWithAPlace) {
  const Closed mesh = box({0, 0, 0}, {1, 1, 1}) + box({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5}).turned();
  engine::Scene scene;
  scene.add_mesh("it", mesh.vertices, mesh.triangles, MeshAs::kAuto, {});
  scene.add_mesh("both", (ell() + ell().turned()).vertices, (ell() + ell().turned()).triangles, MeshAs::kAuto, {});
  const std::vector<MeshWarning> warnings = mesh_warnings(scene);
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_NE(warnings[0].text.find("distances are to the hull; mesh (hull) is hollow: triangle "), std::string::npos)
      << warnings[0].text;
  EXPECT_NE(warnings[0].text.find(kCrossing), std::string::npos) << warnings[0].text;
  EXPECT_NE(warnings[1].text.find(kBothWays), std::string::npos) << warnings[1].text;
}

TEST(HollowMesh, MirroredByItsScale) {
  Mesh file;
  const Closed cup = box({0, 0, 0}, {1, 1, 1}) + box({0.5, 0.5, 0.5}, {1.5, 1.5, 1.5}), bad = cup + cup.turned();
  for (const bool is_bad : {false, true}) {
    file.submeshes = {{(is_bad ? bad : cup).vertices, (is_bad ? bad : cup).triangles}};
    for (const Vec3d& scale : {Vec3d{1, 1, 1}, Vec3d{-1, 1, 1}, Vec3d{1e-4, -1e-4, 1e-4}, Vec3d{1e4, 1e4, 1e4}}) {
      const Geometry geometry = geometry_of_mesh(file, {.scale = scale}, "it");
      EXPECT_EQ(is_solid(geometry), !is_bad) << scale.x;
    }
  }
}

// Boxes at random places and turns: hollow where they cross by more than a hundredth of their size, never where both
// are turned alike, or apart.
TEST(HollowMesh, RandomBoxes) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  int crossing = 0, apart = 0;
  for (int k = 0; k < 150; ++k) {
    const Closed a = box({-1, -1, -1}, {1, 1, 1});
    Closed b = a;
    Vec3d q{unit(random), unit(random), unit(random)}, at = Vec3d{unit(random), unit(random), unit(random)} * 2.5;
    const double n = squared_norm(q);
    if (n > 1) continue;
    for (Vec3d& v : b.vertices) {  // by the rotation of the quaternion (sqrt(1 - n), q)
      const Vec3d t = cross(q, v) * 2.0;
      v = v + t * std::sqrt(1 - n) + cross(q, t) + at;
    }
    const Surface solid_a(a.vertices, a.triangles, true), solid_b(b.vertices, b.triangles, true);
    int inside = 0;
    for (int i = 0; i < 4'000; ++i) {
      const Vec3d p{unit(random), unit(random), unit(random)};
      inside += winding_number(solid_b, p) != 0;
    }
    EXPECT_EQ(hollow(a + b), "");
    if (inside > 40) {
      EXPECT_NE(hollow(a + b.turned()), "") << inside;
      ++crossing;
    }
    if (inside == 0 && norm(at) > 3.5) {
      EXPECT_EQ(hollow(a + b.turned()), "");
      ++apart;
    }
  }
  EXPECT_GE(crossing, 15);
  EXPECT_GE(apart, 3);
}

}  // namespace
}  // namespace clearance
