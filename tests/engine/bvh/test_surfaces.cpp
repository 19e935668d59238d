// Storage of surfaces and solids: every triangle in its boxes and nowhere else, open edges found, winding numbers equal
// to those of exact arithmetic.
#include <gmpxx.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <utility>
#include <vector>

#include "engine/bvh/surface.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/cases/mesh_shapes.h"
#include "tests/oracle/exact/exact_surface.h"

namespace clearance {
namespace {

using exact::Mesh;
using exact::Random;

constexpr std::uint64_t kSeed = 29;

Surface surface_of(const Mesh& mesh, bool is_solid) {
  return {mesh.vertices, mesh.triangles, is_solid};
}

/// Meshes from several cases of every class, including degenerate ones.
std::vector<exact::SolidPtr> nasty_meshes(std::uint64_t each) {
  std::vector<exact::SolidPtr> meshes;
  for (const exact::CaseClass& cls : exact::mesh_classes())
    for (std::uint64_t i = 0; i < each; ++i) {
      const exact::Case c = exact::make_case(cls, kSeed, i);
      for (const exact::SolidPtr& s : {c.a, c.b})
        if (!s->triangles.empty()) meshes.push_back(s);
    }
  return meshes;
}

/// Walks a tree: each leaf's triangles are in the boxes and slabs of all nodes above it, exactly; leaves come in order.
class TreeWalk {
 public:
  explicit TreeWalk(const Surface& surface) : surface_(surface) { walk(0, 0); }
  std::uint32_t triangles = 0;  // in the leaves visited so far
  std::uint32_t nodes = 0;
  int depth = 0, outside = 0;

 private:
  void walk(std::uint32_t at, int level) {
    ASSERT_LT(at, surface_.nodes().size());
    const Surface::Node& node = surface_.nodes()[at];
    ++nodes;
    depth = std::max(depth, level);
    path_.push_back(at);
    if (node.is_leaf()) {
      ASSERT_EQ(node.begin(), triangles);
      ASSERT_GT(node.end(), node.begin());
      ASSERT_LE(node.end() - node.begin(), Surface::kLeafElements);
      ASSERT_LE(node.end(), surface_.triangles().size());
      for (; triangles < node.end(); ++triangles)
        for (const Vec3d& v : surface_.corners(triangles))
          for (const std::uint32_t above : path_) outside += !holds(above, v);
    } else {
      ASSERT_GT(node.right, at + 1);
      walk(at + 1, level + 1);
      ASSERT_EQ(node.right, nodes) << "a node that is nobody's child, or two nodes'";
      walk(node.right, level + 1);
    }
    path_.pop_back();
  }
  bool holds(std::uint32_t at, const Vec3d& v) const {
    const Surface::Node& box = surface_.nodes()[at];
    const Surface::Slab& slab = surface_.slabs()[at];
    mpq_class along;
    for (int k = 0; k < 3; ++k) {
      const mpq_class x = mpq_class(v[k]) - mpq_class(surface_.centre()[k]);
      along += x * mpq_class(slab.normal()[k]);
      if (x < mpq_class(static_cast<double>(box.low[static_cast<std::size_t>(k)]))) return false;
      if (x > mpq_class(static_cast<double>(box.high[static_cast<std::size_t>(k)]))) return false;
    }
    return along >= mpq_class(double{slab.low}) && along <= mpq_class(double{slab.high});
  }

  const Surface& surface_;
  std::vector<std::uint32_t> path_;
};

TEST(Surface, TreeHoldsEveryTriangleOnceInItsBoxesAndSlabs) {
  std::size_t most = 0, least = 1000, far = 0;
  std::vector<exact::SolidPtr> meshes = nasty_meshes(6);
  Random random(kSeed);
  for (const int sides : {40, 333})  // thousands of triangles
    meshes.push_back(exact::solid(
        exact::revolved(std::vector<exact::Point2>{{1, 0}, {1.5, 0.2}, {1.4, 0.9}, {1.1, 0.7}}, sides), true));
  for (const exact::SolidPtr& s : meshes) {
    const Surface surface(s->vertices, s->triangles, s->is_solid);
    ASSERT_EQ(surface.triangles().size(), s->triangles.size());
    std::vector<std::uint32_t> places(surface.places().begin(), surface.places().end());
    for (std::size_t i = 0; i < places.size(); ++i) EXPECT_EQ(surface.triangles()[i], s->triangles[places[i]]);
    std::sort(places.begin(), places.end());
    for (std::uint32_t i = 0; i < places.size(); ++i) ASSERT_EQ(places[i], i) << "a triangle twice, and one not at all";
    const TreeWalk walk(surface);
    EXPECT_EQ(walk.triangles, s->triangles.size());
    EXPECT_EQ(walk.nodes, surface.nodes().size());
    EXPECT_EQ(walk.outside, 0);
    EXPECT_LE(walk.depth, 2 + std::ceil(std::log2(static_cast<double>(s->triangles.size()))));
    EXPECT_EQ(surface.is_solid(), s->is_solid);
    most = std::max(most, s->triangles.size()), least = std::min(least, s->triangles.size());
    far += norm(surface.centre()) > 1e3;
  }
  EXPECT_GT(most, 2000u);
  EXPECT_EQ(least, 1u);
  EXPECT_GT(far, 2u);
}

TEST(Surface, TakesAtMost64BytesATriangleBesideItsVertices) {
  const Mesh mesh = exact::revolved(std::vector<exact::Point2>{{1, 0}, {1.5, 0.2}, {1.4, 0.9}, {1.1, 0.7}}, 5000);
  const Surface surface = surface_of(mesh, true);
  EXPECT_LE(surface.resident_bytes(),
            64 * mesh.triangles.size() + sizeof(Vec3d) * mesh.vertices.size() + sizeof surface);
}

TEST(Surface, DigestsDistinguishSurfaces) {
  const Mesh mesh = exact::box_mesh({1, 1, 1});
  EXPECT_EQ(surface_of(mesh, true).digest(), surface_of(mesh, true).digest());
  EXPECT_NE(surface_of(mesh, true).digest(), surface_of(mesh, false).digest());
  EXPECT_NE(surface_of(mesh, true).digest(), surface_of(exact::flipped(mesh), true).digest());
  EXPECT_NE(surface_of(mesh, true).digest(), surface_of(exact::scaled(mesh, {1, 1, 2}), true).digest());
}

// ---- open edges

TEST(Surface, ClosedMeshesHaveNoOpenEdge) {
  for (const exact::SolidPtr& s : nasty_meshes(4)) {
    if (s->is_solid) {
      EXPECT_EQ(open_edge(s->vertices, s->triangles), "");
    }
  }
}

TEST(Surface, AMissingOrTurnedTriangleLeavesAnOpenEdge) {
  Random random(kSeed);
  for (int i = 0; i < 100; ++i) {
    const Mesh mesh = exact::any_mesh(random);
    const auto at = static_cast<std::size_t>(random.integer(0, static_cast<int>(mesh.triangles.size()) - 1));
    Mesh open = mesh;
    open.triangles.erase(open.triangles.begin() + static_cast<std::ptrdiff_t>(at));
    EXPECT_NE(open_edge(open.vertices, open.triangles), "");
    EXPECT_THROW(surface_of(open, true), std::invalid_argument);
    EXPECT_NO_THROW(surface_of(open, false));
    Mesh turned = mesh;
    std::swap(turned.triangles[at][0], turned.triangles[at][1]);
    EXPECT_NE(open_edge(turned.vertices, turned.triangles).find("inconsistent orientations"), std::string::npos);
    EXPECT_THROW(surface_of(turned, true), std::invalid_argument);
    // Separate vertices at equal positions count as one.
    Mesh apart;
    for (const Triangle& t : mesh.triangles) {
      const auto n = static_cast<std::uint32_t>(apart.vertices.size());
      for (const std::uint32_t v : t) apart.vertices.push_back(mesh.vertices[v]);
      apart.triangles.push_back({n, n + 1, n + 2});
    }
    EXPECT_EQ(open_edge(apart.vertices, apart.triangles), "");
    // A difference in the last bit makes them distinct.
    Vec3d& moved = apart.vertices[static_cast<std::size_t>(random.integer(0, 2)) + 3 * at];
    moved.y = std::nextafter(moved.y, 10);
    EXPECT_NE(open_edge(apart.vertices, apart.triangles), "");
  }
}

TEST(Surface, RejectsNothingAndIndicesBeyond) {
  EXPECT_THROW(Surface({{0, 0, 0}}, {}, false), std::invalid_argument);
  EXPECT_THROW(Surface({{0, 0, 0}, {1, 0, 0}}, {{0, 1, 2}}, false), std::invalid_argument);
  EXPECT_THROW(Surface({}, {{0, 0, 0}}, true), std::invalid_argument);
  EXPECT_NO_THROW(Surface({{0, 0, 0}}, {{0, 0, 0}}, true)) << "a point is closed";
}

// ---- parts

TEST(Surface, NamesAVertexOfEachPart) {
  std::size_t most = 0;
  for (const exact::SolidPtr& s : nasty_meshes(4)) {
    const Surface surface(s->vertices, s->triangles, s->is_solid);
    // Positions grow together from each named vertex. In the end all positions of triangles are reached, from one
    // vertex each.
    using Key = std::array<double, 3>;
    std::map<Key, std::size_t> reached;
    const auto key = [&](std::uint32_t v) {  // -0 and 0 are one position
      return Key{s->vertices[v].x + 0.0, s->vertices[v].y + 0.0, s->vertices[v].z + 0.0};
    };
    for (std::size_t part = 0; part < surface.parts().size(); ++part)
      EXPECT_TRUE(reached.emplace(key(surface.parts()[part]), part).second) << "two names of one place";
    for (bool changed = true; std::exchange(changed, false);)
      for (const Triangle& t : s->triangles)
        for (const std::uint32_t from : t)
          for (const std::uint32_t to : t)
            if (const auto it = reached.find(key(from)); it != reached.end()) {
              const auto [other, is_new] = reached.emplace(key(to), it->second);
              EXPECT_EQ(other->second, it->second) << "two names of one part";
              changed = changed || is_new;
            }
    for (const Triangle& t : s->triangles)
      for (const std::uint32_t v : t) EXPECT_TRUE(reached.contains(key(v))) << "a part without a name";
    most = std::max(most, surface.parts().size());
  }
  EXPECT_GT(most, 5u);
}

// ---- winding numbers

/// Points that are hard to classify: anywhere; next to a vertex, an edge or a face by a last bit or more; in line with
/// vertices along an axis.
Vec3d hard_point(Random& random, const exact::Solid& s) {
  const auto vertex = [&] {
    const Triangle& t =
        s.triangles[static_cast<std::size_t>(random.integer(0, static_cast<int>(s.triangles.size()) - 1))];
    return s.vertices[t[static_cast<std::size_t>(random.integer(0, 2))]];
  };
  const Triangle& t =
      s.triangles[static_cast<std::size_t>(random.integer(0, static_cast<int>(s.triangles.size()) - 1))];
  const Vec3d &p = s.vertices[t[0]], &q = s.vertices[t[1]], &r = s.vertices[t[2]];
  const double size = norm(p - vertex()) + norm(p - vertex()) + norm(q - p);
  switch (random.integer(0, 4)) {
    case 0:
      return 0.5 * (vertex() + vertex()) + random.direction() * (0.1 * size * random.uniform());
    case 1:
      return {vertex().x, vertex().y, vertex().z};
    case 2:
      return vertex() + random.direction() * (size * random.log_uniform(1e-16, 1));
    case 3:
      return 0.5 * (p + q) + random.direction() * (size * random.log_uniform(1e-17, 1e-3));
    default:
      return 0.25 * p + 0.25 * q + 0.5 * r + random.direction() * (size * random.log_uniform(1e-17, 1e-3));
  }
}

TEST(Surface, WindingNumbersAreExact) {
  Random random(kSeed);
  std::map<int, int> seen;
  int on = 0, close = 0;
  for (const exact::SolidPtr& s : nasty_meshes(4)) {
    if (!s->is_solid) continue;
    const Surface surface(s->vertices, s->triangles, true);
    const exact::BodyView skin{s->vertices, s->triangles, false, 0};
    for (int i = 0; i < 12; ++i) {
      const Vec3d p = hard_point(random, *s);
      const exact::Result gap = exact::exact_distance(skin, {}, exact::BodyView{std::span(&p, 1), {}, false, 0}, {});
      if (gap.cores_overlap) {
        ++on;
        continue;
      }
      close += gap.distance.compare(1e-12) < 0;
      const int expected = exact::exact_winding_number(skin, {}, p);
      ++seen[expected];
      EXPECT_EQ(winding_number(surface, p), expected);
    }
  }
  for (const auto& [winding, count] : seen) std::printf("%d around %d points\n", winding, count);
  std::printf("%d nearer than 1e-12, %d on a triangle\n", close, on);
  EXPECT_GT(seen[-1], 20);
  EXPECT_GT(seen[0], 200);
  EXPECT_GT(seen[1], 200);
  EXPECT_GT(seen[2], 5);
  EXPECT_GT(close, 50);
}

}  // namespace
}  // namespace clearance
