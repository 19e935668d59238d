// Compares queries with model `pieces` with the oracle. For any convex parts the interval contains the distance of the
// meshes, in every reduction; with signed distance it contains that of the parts. Its width is the parts' possible
// deviation from the mesh.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "engine/engine.h"
#include "engine/geometry/make_geometry.h"
#include "engine/hull/decomposition.h"
#include "tests/oracle/cases/mesh_shapes.h"
#include "tests/oracle/cases/proposals.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 57;
constexpr std::uint32_t kOthers = 3, kPlaces = 3;  // bodies other than the first; configurations of it

struct Found {
  int rows = 0, wide = 0, apart = 0, overlapping = 0, held = 0, of_parts = 0, free = 0, hit = 0, within = 0;
  int wrong = 0;
  std::string first_wrong;

  void expect(bool holds, const char* what) {
    if (!holds && wrong++ == 0) first_wrong = what;
  }
};

/// A decomposed body among a hull, another decomposed one and a solid without decomposition.
struct Trial {
  std::array<SolidPtr, 1 + kOthers> solids;
  std::array<ConvexPartPtr, 1 + kOthers> parts;
  std::array<Pose, kOthers> stands;
  std::array<Pose, kPlaces> places;
  std::array<std::array<Result, kOthers>, kPlaces> exact_value;

  Trial(Random& random, Kind kind) {
    const Mesh mesh = concave_mesh(random, 50);
    make(0, random, mesh, kind, random.chance(0.5) ? 0 : random.uniform(0, 0.2));
    for (std::uint32_t i = 1; i <= kOthers; ++i) {
      Mesh other = concave_mesh(random, 30);
      const double scale = std::exp2(random.integer(-4, 0));
      for (Vec3d& v : other.vertices) v = scale * v;
      const double radius = random.chance(0.5) ? 0 : 0.125 * scale;
      if (i == 1) {
        solids[i] = std::make_shared<const Solid>(Solid{other.vertices, radius});
        parts[i] = make_convex_part(other.vertices, radius);
      } else if (i == 2) {
        make(i, random, other, kind, radius);
      } else {
        solids[i] = solid(other, true, radius);
        parts[i] = make_surface_part(other.vertices, other.triangles, true, radius);
      }
      stands[i - 1] = random.rotation(random.direction() * (size_of(mesh) * random.uniform(0.2, 1.1)));
    }
    for (Pose& place : places) place = random.rotation();
    check_all();
  }
  /// Filled by the caller; all bodies are at the origin.
  Trial() = default;

  void check_all() {
    for (std::uint32_t k = 0; k < kPlaces; ++k)
      for (std::uint32_t i = 0; i < kOthers; ++i)
        exact_value[k][i] = exact_answer({solids[0], solids[1 + i], places[k], stands[i]}, false);
  }

  void make(std::uint32_t at, Random& random, const Mesh& mesh, Kind kind, double radius) {
    solids[at] = solid(mesh, true, radius);
    parts[at] = make_decomposed_part(mesh.vertices, mesh.triangles, propose(random, mesh, kind), radius);
  }

  engine::Scene scene() const {
    engine::Scene scene;
    for (std::uint32_t i = 0; i <= kOthers; ++i) {
      Body body;
      body.name = "body " + std::to_string(i);
      body.parts = {parts[i]};
      body.pose = i == 0 ? places[0] : stands[i - 1];
      scene.add_body(std::move(body));
    }
    return scene;
  }

  bool is_by_parts(std::uint32_t i) const { return parts[i]->surface && parts[i]->surface->decomposition(); }
  /// Bound on the difference between parts and meshes of a pair.
  double slack(std::uint32_t other) const {
    double sum = 0;
    for (const std::uint32_t i : {0u, other})
      if (is_by_parts(i)) {
        const Decomposition& of = *parts[i]->surface->decomposition();
        sum += of.inner + of.most_outer();
      }
    return sum;
  }
};

struct Rows {
  std::array<double, 16> lower{}, upper{};
  std::array<std::uint8_t, 16> status{};
  std::array<std::uint16_t, 16> flags{};
  std::array<BodyPair, 16> pair{};
  std::array<std::uint32_t, 16> configuration{};
  std::uint64_t count = 0;

  Status status_of(std::size_t row) const { return static_cast<Status>(status[row]); }
};

Rows evaluate(const engine::Engine& engine, const Trial& trial, QueryView q) {
  static constexpr std::array<BodyPair, kOthers> kPairs{BodyPair{0, 1}, {0, 2}, {0, 3}};
  static constexpr std::array<std::uint32_t, 1> kMoved{0};
  q.pairs = kPairs;
  q.all_pairs = false;
  q.bodies = kMoved;
  q.configurations = trial.places;
  q.configuration_count = kPlaces;
  q.model = Model::kPieces;
  q.fields = kFieldLower | kFieldUpper | kFieldStatus | kFieldFlags | kFieldPair | kFieldConfiguration;
  Rows rows;
  ReplyView reply;
  reply.rows = rows.lower.size();
  reply.lower = rows.lower.data();
  reply.upper = rows.upper.data();
  reply.status = rows.status.data();
  reply.flags = rows.flags.data();
  reply.pair = rows.pair.data();
  reply.configuration = rows.configuration.data();
  Job job = engine.start(q, reply);
  while (!job.advance()) {
  }
  rows.count = job.info().rows;
  return rows;
}

/// Whether a lower bound holds for a distance that is 0 if the bodies overlap.
bool is_below(double lower, const Result& exact_value) {
  return exact_value.distance.compare(0) <= 0 ? lower <= 0
         : std::isinf(lower)                  ? lower < 0
                                              : exact_value.distance.compare(lower) >= 0;
}
bool is_above(double upper, const Result& exact_value) {
  return exact_value.distance.compare(0) <= 0 ? upper >= 0
                                              : std::isinf(upper) || exact_value.distance.compare(upper) <= 0;
}
bool is_farther(const Result& exact_value, double than) {
  return exact_value.distance.compare(0) > 0 && exact_value.distance.compare(than) > 0;
}

/// Checks each row alone.
void look_at_rows(const engine::Engine& engine, const Trial& trial, double limit, Precision precision, Found& found) {
  QueryView q;
  q.max_distance = limit;
  q.precision = precision;
  const Rows rows = evaluate(engine, trial, q);
  for (std::uint32_t row = 0; row < kPlaces * kOthers; ++row) {
    const Result& exact_value = trial.exact_value[row / kOthers][row % kOthers];
    const double lower = rows.lower[row], upper = rows.upper[row];
    const Status status = rows.status_of(row);
    ++found.rows;
    found.expect(lower <= upper && is_below(lower, exact_value) && is_above(upper, exact_value),
                 "a row holds the mesh's distance");
    found.expect(status != Status::kBeyond || is_farther(exact_value, limit), "what is beyond is farther");
    found.expect(status != Status::kOverlap || exact_value.distance.compare(0) <= 0, "meshes overlap");
    (exact_value.distance.compare(0) > 0 ? found.apart : found.overlapping) += 1;
    // Without triangles the interval has the width of the slack, and with them a smaller one.
    const double slack = trial.slack(1 + row % kOthers);
    if (status == Status::kOk && slack > 1e-3) {
      ++found.wide;
      found.expect(upper - lower >= slack * (1 - 1e-9) && upper - lower <= slack + 1e-3,
                   "a row is as wide as the slack");
    }
  }
}

/// Checks each pair's least signed distance of parts.
void look_at_signed_rows(const engine::Engine& engine, const Trial& trial, Found& found) {
  QueryView q;
  q.signed_distance = true;
  const Rows rows = evaluate(engine, trial, q);
  const auto solids_of = [&](std::uint32_t i) {
    std::vector<SolidPtr> all;
    if (!trial.is_by_parts(i)) return std::vector{trial.solids[i]};
    for (const ConvexPartPtr& part : trial.parts[i]->surface->decomposition()->parts)
      all.push_back(std::make_shared<const Solid>(Solid{part->vertices, trial.parts[i]->radius}));
    return all;
  };
  for (std::uint32_t row = 0; row < 2; ++row) {  // of the hull, and of the other decomposed body
    const double lower = rows.lower[row], upper = rows.upper[row];
    const Result& exact_value = trial.exact_value[0][row];
    bool below = true, above = false, apart = true;
    for (const SolidPtr& a : solids_of(0))
      for (const SolidPtr& b : solids_of(1 + row)) {
        const Result parts = exact_answer({a, b, trial.places[0], trial.stands[row]});
        below &= parts.distance.compare(lower) >= 0;
        above |= parts.distance.compare(upper) <= 0;
        apart &= parts.distance.compare(0) > 0;
      }
    ++found.rows;
    const bool is_held = apart && exact_value.distance.compare(0) <= 0;
    if (is_held && upper < 0) {  // from the mesh
      found.expect(!(rows.flags[row] & kFlagPieces), "what one mesh holds is no depth of pieces");
      continue;
    }
    found.expect(lower <= upper && (is_held || (below && above)), "a signed row holds the pieces' distance");
    found.expect(!(lower > 0) || (is_below(lower, exact_value) && is_above(upper, exact_value)),
                 "a signed row holds the mesh's");
    found.expect(!(lower < 0) || (rows.flags[row] & kFlagPieces), "a depth says that it is the pieces'");
    found.of_parts += upper < 0;
  }
}

/// Whether the interval contains the least distance of some pairs of a configuration.
bool holds_least(double lower, double upper, std::span<const Result> exact_value) {
  bool above = std::isinf(upper);
  for (const Result& t : exact_value) {
    if (!is_below(lower, t)) return false;
    above |= is_above(upper, t);
  }
  return above;
}

void look_at_reductions(const engine::Engine& engine, const Trial& trial, double limit, Precision precision,
                        Found& found) {
  QueryView q;
  q.precision = precision;
  q.reduce = Reduce::kMin;
  const Rows least = evaluate(engine, trial, q);
  q.reduce = Reduce::kNearest;
  const Rows nearest = evaluate(engine, trial, q);
  for (std::uint32_t k = 0; k < kPlaces; ++k) {
    found.expect(holds_least(least.lower[k], least.upper[k], trial.exact_value[k]), "min");
    for (std::uint32_t body = 0; body <= kOthers; ++body) {
      const std::size_t row = k * (1 + kOthers) + body;
      const auto all = std::span(trial.exact_value[k]);
      found.expect(holds_least(nearest.lower[row], nearest.upper[row], body == 0 ? all : all.subspan(body - 1, 1)),
                   "nearest");
    }
    found.rows += 2 + kOthers;
  }
  q.reduce = Reduce::kWithin;
  q.max_distance = limit;
  const Rows within = evaluate(engine, trial, q);
  for (std::uint32_t k = 0; k < kPlaces; ++k)
    for (std::uint32_t i = 0; i < kOthers; ++i) {
      bool there = false;
      for (std::size_t row = 0; row < within.count; ++row)
        there |= within.configuration[row] == k && within.pair[row].b == 1 + i;
      found.expect(there || is_farther(trial.exact_value[k][i], limit), "within");
      found.within += there;
    }
  q.reduce = Reduce::kAny;
  q.max_distance = std::numeric_limits<double>::infinity();
  q.margin = limit;
  const Rows any = evaluate(engine, trial, q);
  for (std::uint32_t k = 0; k < kPlaces; ++k) {
    const Status status = any.status_of(k);
    const bool beyond = status == Status::kBeyond, open = status == Status::kUnconverged;
    for (std::uint32_t i = 0; i < kOthers; ++i) {
      if (beyond) found.expect(is_farther(trial.exact_value[k][i], limit), "what is free");
      if (!beyond && !open && any.pair[k].b == 1 + i)
        found.expect(!is_farther(trial.exact_value[k][i], limit), "what is not free");
    }
    found.free += beyond;
    found.hit += !beyond && !open;
  }
}

/// A box of a mesh whose convex parts cover its skin alone, around a small body that overlaps none of them.
void look_at_held(Random& random, Found& found) {
  const Mesh box = box_mesh({1, 1, 1});
  ConvexParts skin;
  for (const Triangle& t : box.triangles) {
    skin.emplace_back();
    for (const std::uint32_t corner : t) skin.back().push_back(box.vertices[corner]);
  }
  engine::Scene scene;
  Body first, second;
  first.name = "a", second.name = "b";
  first.parts = {make_decomposed_part(box.vertices, box.triangles, skin, 0)};
  second.parts = {make_convex_part({random.direction() * 0.1, random.direction() * 0.1}, 0)};
  first.pose = Pose{}, second.pose = random.rotation(random.direction() * random.uniform(0, 0.3));
  scene.add_body(std::move(first));
  scene.add_body(std::move(second));
  const engine::Engine engine(std::move(scene), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  for (const Reduce reduce : {Reduce::kNone, Reduce::kWithin, Reduce::kMin, Reduce::kAny})
    for (const bool is_signed : {false, true}) {
      if (is_signed && reduce == Reduce::kAny) continue;
      double lower = 1, upper = 1;
      std::uint16_t flags = 0;
      QueryView q;
      q.model = Model::kPieces;
      q.reduce = reduce;
      q.signed_distance = is_signed;
      if (reduce != Reduce::kAny) q.max_distance = 0.25;  // which all parts are beyond
      q.fields = kFieldLower | kFieldUpper | kFieldFlags;
      ReplyView reply;
      reply.rows = 1;
      reply.lower = &lower;
      reply.upper = &upper;
      reply.flags = &flags;
      Job job = engine.start(q, reply);
      job.advance();
      ++found.held;
      found.expect(job.info().rows == 1 && lower <= upper && upper <= 0 && !(flags & kFlagPieces),
                   "a body that is held");
      if (is_signed) found.expect(lower >= -4 && lower <= -0.5 && upper <= -0.25, "how deep it is held");
    }
}

/// A ball within a long tube whose proxy is its hull: its depth in the hull exceeds the hull's deviation from the tube,
/// although the ball does not touch the tube.
void look_at_tube(Found& found) {
  static constexpr std::array<Point2, 4> kProfile{{{0.75, -2}, {1, -2}, {1, 2}, {0.75, 2}}};
  const Mesh mesh = on_lattice(revolved(kProfile, 8));
  Trial trial;
  trial.solids = {solid(mesh, true), std::make_shared<const Solid>(Solid{{{0, 0, 0}}, 0.125})};
  trial.parts = {make_decomposed_part(mesh.vertices, mesh.triangles, std::array{mesh.vertices}, 0),
                 make_convex_part({{0, 0, 0}}, 0.125)};
  for (std::uint32_t i = 2; i <= kOthers; ++i) trial.solids[i] = trial.solids[1], trial.parts[i] = trial.parts[1];
  trial.check_all();
  const engine::Engine engine(trial.scene(), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  const int apart = found.apart;
  for (const double limit : {0.0, 1.0}) look_at_rows(engine, trial, limit, Precision::kF64, found);
  look_at_reductions(engine, trial, 0.25, Precision::kF64, found);
  found.expect(found.apart == apart + 2 * static_cast<int>(kPlaces * kOthers), "the ball is in the tube's hole");
}

void try_all(Random& random, Kind kind, Found& found) {
  const Trial trial(random, kind);
  const engine::Engine engine(trial.scene(), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  double near = 0.1;
  for (const Result& exact_value : trial.exact_value[0])
    if (exact_value.distance.compare(0) > 0) near = exact_value.distance.upper();
  for (const Precision precision : {Precision::kF64, Precision::kF32}) {
    look_at_rows(engine, trial, std::numeric_limits<double>::infinity(), precision, found);
    look_at_rows(engine, trial, 0.999 * near, precision, found);
    look_at_reductions(engine, trial, random.uniform(0.5, 1.2) * near, precision, found);
  }
  look_at_reductions(engine, trial, 0, Precision::kF64, found);
  look_at_signed_rows(engine, trial, found);
  look_at_held(random, found);
}

#ifdef CLEARANCE_MUTANT
TEST(ModelParts, MutantsAreFound) {
  Random random(kSeed);
  Found found;
  look_at_tube(found);
  for (int i = 0; i < 10 && found.wrong == 0; ++i)
    for (const Kind kind : kKinds) try_all(random, kind, found);
  EXPECT_GT(found.wrong, 0);
}
#else
TEST(ModelParts, HoldWhatTheOracleAllows) {
  Random random(kSeed);
  Found found;
  look_at_tube(found);
  for (int i = 0; i < 2; ++i)
    for (const Kind kind : kKinds) try_all(random, kind, found);
  std::printf(
      "%d rows, %d wrong; %d as wide as the slack; %d apart, %d overlapping, %d held, %d depths of pieces; %d within; "
      "%d free, %d not\n",
      found.rows, found.wrong, found.wide, found.apart, found.overlapping, found.held, found.of_parts, found.within,
      found.free, found.hit);
  EXPECT_EQ(found.wrong, 0) << found.first_wrong;
  EXPECT_GE(found.wide, 50);
  EXPECT_GE(found.apart, 100);
  EXPECT_GE(found.overlapping, 30);
  EXPECT_GE(found.of_parts, 3);
  EXPECT_GE(found.free, 5);
  EXPECT_GE(found.hit, 5);
  EXPECT_GE(found.within, 20);
}
#endif

}  // namespace
}  // namespace clearance::exact
