// Compares decomposed solids with the oracle. For any convex parts (hulls of parts of the mesh, shrunk or flat ones, or
// with parts missing) no pair is reported farther than it is, and no overlap is missed, whether parts or triangles
// answer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "engine/engine.h"
#include "engine/geometry/make_geometry.h"
#include "tests/oracle/cases/mesh_shapes.h"
#include "tests/oracle/cases/proposals.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 31;

struct Row {
  double lower, upper;
  Status status;
};
/// \param limits max_distance of each query
std::vector<Row> evaluate(const ConvexPartPtr& a, const Pose& X_wa, const ConvexPartPtr& b, const Pose& X_wb,
                          std::span<const double> limits) {
  engine::Scene scene;
  Body first, second;
  first.name = "a", second.name = "b";
  first.parts = {a}, second.parts = {b};
  first.pose = X_wa, second.pose = X_wb;
  scene.add_body(std::move(first));
  scene.add_body(std::move(second));
  const engine::Engine engine(std::move(scene), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  std::vector<Row> rows;
  for (const double limit : limits) {
    Row& row = rows.emplace_back();
    std::uint8_t status = 0;
    QueryView q;
    q.max_distance = limit;
    q.fields = kFieldLower | kFieldUpper | kFieldStatus;
    ReplyView reply;
    reply.rows = 1;
    reply.lower = &row.lower;
    reply.upper = &row.upper;
    reply.status = &status;
    engine.start(q, reply).advance();
    row.status = static_cast<Status>(status);
  }
  return rows;
}

struct Found {
  int requested = 0, wrong = 0, by_parts = 0, overlapping = 0, held = 0;
};

/// Whether a row contradicts the exact result.
bool is_wrong(const Row& row, const Result& exact_value, double limit) {
  if (std::isnan(row.lower) || row.lower > row.upper) return true;
  if (exact_value.distance.compare(0) <= 0) return row.lower > 0 || row.status == Status::kBeyond;
  if (std::isfinite(row.lower) && exact_value.distance.compare(row.lower) < 0) return true;
  if (std::isfinite(row.upper) && exact_value.distance.compare(row.upper) > 0) return true;
  return row.status == Status::kBeyond && exact_value.distance.compare(limit) <= 0;
}

/// A decomposed body and another one: also decomposed, a solid without decomposition, or a hull.
void try_pair(Random& random, Kind kind, Found& found) {
  const Mesh mesh = concave_mesh(random, 100);
  const double radius_a = random.chance(0.5) ? 0 : random.uniform(0, 0.2), size = size_of(mesh);
  const SolidPtr a = solid(mesh, true, radius_a);
  Mesh other = concave_mesh(random, 60);
  const double scale = std::exp2(random.integer(-4, 0));
  for (Vec3d& v : other.vertices) v = scale * v;
  const double radius_b = random.chance(0.5) ? 0 : 0.125 * scale;
  const int what = random.integer(0, 2);
  const SolidPtr b =
      what == 2 ? std::make_shared<const Solid>(Solid{other.vertices, radius_b}) : solid(other, true, radius_b);
  const ConvexPartPtr with = make_decomposed_part(mesh.vertices, mesh.triangles, propose(random, mesh, kind), radius_a),
                      without = make_surface_part(mesh.vertices, mesh.triangles, true, radius_a);
  const ConvexPartPtr part_b =
      what == 2   ? make_convex_part(other.vertices, radius_b)
      : what == 1 ? make_surface_part(other.vertices, other.triangles, true, radius_b)
                  : make_decomposed_part(other.vertices, other.triangles, propose(random, other, kind), radius_b);
  for (int k = 0; k < 3; ++k) {
    Case c{a, b, random.rotation(), random.rotation(random.direction() * (size * random.uniform(0, 0.6)))};
    const Result exact_value = exact_answer(c, false);
    const bool apart = exact_value.distance.compare(0) > 0;
    const double near = apart ? exact_value.distance.upper() : 0.1;
    const std::array<double, 4> limits{0.0, 0.5 * near, 0.999 * near, 1.01 * near};
    const std::vector<Row> rows = evaluate(with, c.X_wa, part_b, c.X_wb, limits),
                           plain = evaluate(without, c.X_wa, part_b, c.X_wb, limits);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      ++found.requested;
      found.wrong += is_wrong(rows[i], exact_value, limits[i]);
      // Triangles give the same answer, except for the proved lower bound.
      found.wrong += rows[i].status != plain[i].status;
      found.by_parts += rows[i].status == Status::kBeyond && rows[i].lower != plain[i].lower;
    }
    found.overlapping += !apart;
  }
}

/// A ball of a mesh whose convex parts cover its skin alone, around a small body that overlaps none of them.
void try_held(Random& random, Found& found) {
  const Mesh box = box_mesh({1, 1, 1});
  ConvexParts skin;
  for (const Triangle& t : box.triangles) {
    skin.emplace_back();
    for (const std::uint32_t corner : t) skin.back().push_back(box.vertices[corner]);
  }
  const ConvexPartPtr a = make_decomposed_part(box.vertices, box.triangles, skin, 0),
                      b = make_convex_part({random.direction() * 0.1, random.direction() * 0.1}, 0);
  const std::array<double, 2> limits{0.0, 0.25};
  for (const Row& row : evaluate(a, {}, b, random.rotation(random.direction() * random.uniform(0, 0.3)), limits)) {
    ++found.held;
    found.wrong += row.status != Status::kOverlap;
  }
}

#ifdef CLEARANCE_MUTANT
TEST(DecomposedBodies, MutantsAreFound) {
  Random random(kSeed);
  Found found;
  for (int i = 0; i < 20 && found.wrong == 0; ++i) {
    for (const Kind kind : kKinds) try_pair(random, kind, found);
    try_held(random, found);
  }
  EXPECT_GT(found.wrong, 0);
}
#else
TEST(DecomposedBodies, AreNoFartherThanTheOracleAllows) {
  Random random(kSeed);
  Found found;
  for (int i = 0; i < 3; ++i) {
    for (const Kind kind : kKinds) try_pair(random, kind, found);
    try_held(random, found);
  }
  std::printf("%d rows, %d wrong, %d by pieces; %d pairs overlap, %d rows of bodies that are held\n", found.requested,
              found.wrong, found.by_parts, found.overlapping, found.held);
  EXPECT_EQ(found.wrong, 0);
  EXPECT_GE(found.by_parts, 10);
  EXPECT_GE(found.overlapping, 10);
}
#endif

}  // namespace
}  // namespace clearance::exact
