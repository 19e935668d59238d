// Compares non-convex bodies with the oracle: every class of meshes, every setting. For every answer the exact distance
// must lie within its bounds, its status must be true, and its witnesses must lie on the bodies. Linked once with the
// engine, and once with each version of it that lacks one proof (CMakeLists.txt), which the oracle must detect.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "engine/engine.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 1;
constexpr int kCases = 40;

#ifdef CLEARANCE_MUTANT

// The first class that detects it is enough; with tolerance 0, so that rounding decides.
TEST(Mutants, OfSurfacesAreFound) {
  std::int64_t answers = 0, violations = 0;
  Setting exactly, beyond;
  exactly.rel_tol = 0;
  beyond.max_distance = 0.1;
  for (const CaseClass& c : mesh_classes()) {
    std::vector<Case> cases;
    for (int i = 0; i < 3 * kCases; ++i) cases.push_back(make_case(c, kSeed, static_cast<std::uint64_t>(i)));
    for (const Tally& t : try_cases(cases, std::array{exactly, beyond}, 1, false, nullptr)) {
      answers += t.cases;
      violations += t.violations;
    }
    if (violations > 0) break;
  }
  std::printf("%d violations in %d answers\n", static_cast<int>(violations), static_cast<int>(answers));
  EXPECT_GT(violations, 0);
}

#else

constexpr double kInf = std::numeric_limits<double>::infinity();

class Meshes : public testing::TestWithParam<std::size_t> {};

TEST_P(Meshes, AnswersContainTheExactDistance) {
  const CaseClass& c = mesh_classes()[GetParam()];
  std::vector<Case> cases;
  for (int i = 0; i < kCases; ++i) cases.push_back(make_case(c, kSeed, static_cast<std::uint64_t>(i)));
  const std::vector<Setting> settings = standard_settings({"cpu", "reference"}, false);
  int shown = 0;
  const std::vector<Tally> tallies = try_cases(
      cases, settings, 1, true, [&](std::size_t i, const Setting& s, const CheckResult& v, const std::string& answer) {
        if (++shown > 5) return;
        ADD_FAILURE() << c.name << " case " << i << " of seed " << kSeed << ", " << s.name() << ": " << v.violation
                      << " " << v.inaccuracy << "\n  " << answer << "\n  exact "
                      << exact_answer(cases[i]).distance.lower();
      });
  for (std::size_t k = 0; k < settings.size(); ++k) {
    const Tally& t = tallies[k];
    std::printf("%-30s %d apart, %d not; worst error %.3g, width %.3g of what is allowed; %d contact, %d unconverged\n",
                settings[k].name().c_str(), static_cast<int>(t.apart), static_cast<int>(t.touching + t.overlapping),
                t.worst_error, t.worst_width, static_cast<int>(t.contact), static_cast<int>(t.unconverged));
    EXPECT_EQ(t.violations, 0) << settings[k].name();
    EXPECT_EQ(t.inaccurate, 0) << settings[k].name();
    EXPECT_LE(t.worst_width, 1.0) << settings[k].name();
    EXPECT_EQ(t.unconverged, 0) << settings[k].name();
    EXPECT_GE(t.apart, kCases / 8);
    EXPECT_GE(t.touching + t.overlapping, 1);
  }
}

INSTANTIATE_TEST_SUITE_P(Classes, Meshes, testing::Range<std::size_t>(0, mesh_classes().size()),
                         [](const auto& param) { return mesh_classes()[param.param].name; });

// ---- many bodies

/// The bodies of some cases at their poses, some of which move, and the exact distances of all pairs.
struct Crowd {
  static constexpr std::size_t kConfigurations = 3;
  std::vector<SolidPtr> bodies;
  std::vector<Pose> poses;
  std::vector<std::uint32_t> moved;
  std::vector<Pose> configurations;               // (K, moved)
  std::vector<std::vector<Result> > exact_value;  // (K, pairs)
  std::vector<BodyPair> pairs;                    // with a body that moves

  Crowd(const CaseClass& cls, std::uint64_t first) {
    for (std::uint64_t i = first; i < first + 3; ++i) {
      const Case c = make_case(cls, kSeed, i);
      bodies.insert(bodies.end(), {c.a, c.b});
      poses.insert(poses.end(), {c.X_wa, c.X_wb});
    }
    moved = {0, 3, 4};
    Random random(kSeed + first);
    for (std::size_t k = 0; k < kConfigurations; ++k)
      for (const std::uint32_t body : moved) {
        const double size = reach(*bodies[body]) + bodies[body]->radius;
        configurations.push_back(
            random.rotation(poses[body].translation + random.direction() * (2 * size * random.uniform())));
      }
    const auto moves = [&](std::uint32_t b) { return std::find(moved.begin(), moved.end(), b) != moved.end(); };
    for (std::uint32_t a = 0; a < bodies.size(); ++a)
      for (std::uint32_t b = a + 1; b < bodies.size(); ++b)
        if (moves(a) || moves(b)) pairs.push_back({a, b});
    for (std::size_t k = 0; k < kConfigurations; ++k) {
      std::vector<Pose> at = poses;
      for (std::size_t i = 0; i < moved.size(); ++i) at[moved[i]] = configurations[k * moved.size() + i];
      std::vector<Result>& row = exact_value.emplace_back();
      for (const BodyPair& p : pairs) row.push_back(exact_answer({bodies[p.a], bodies[p.b], at[p.a], at[p.b]}));
    }
  }
  const Result& of(std::size_t k, BodyPair pair) const {
    return exact_value[k][static_cast<std::size_t>(std::find(pairs.begin(), pairs.end(), pair) - pairs.begin())];
  }
  engine::Scene scene() const {
    engine::Scene scene;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      Body body;
      body.name = "b" + std::to_string(i);
      body.parts = {part_of(*bodies[i])};
      body.pose = poses[i];
      scene.add_body(std::move(body));
    }
    return scene;
  }
};

/// A complete reply.
struct Rows {
  std::vector<std::byte> bytes;
  ReplyView view;
  ReplyInfo info;
};

Rows evaluate(const engine::Engine& engine, QueryView query, const WorkBudget& slice = {}) {
  query.fields = kDefaultFields | kFieldFlags | kFieldPair | kFieldConfiguration;
  const QuerySize size = engine.size(query);
  Rows rows;
  std::uint64_t bytes = 0;
  reply_view_over(nullptr, size.rows, size.fields, &bytes);
  rows.bytes.resize(bytes + kColumnAlignment);
  void* base = rows.bytes.data();
  std::size_t room = rows.bytes.size();
  std::align(kColumnAlignment, bytes, base, room);
  rows.view = reply_view_over(static_cast<std::byte*>(base), size.rows, size.fields);
  Job job = engine.start(query, rows.view);
  while (!job.advance(slice)) {
  }
  rows.info = job.info();
  return rows;
}

/// Whether an exact distance, clipped at 0, is above a bound.
bool is_above(const Result& exact_value, double bound) {
  return exact_value.distance.compare(bound) > 0 && bound >= 0;
}
bool is_below(const Result& exact_value, double bound) {
  return bound > 0 && exact_value.distance.compare(bound) < 0;
}
bool contains(const Rows& rows, std::size_t i, const Result& exact_value) {
  return !is_below(exact_value, rows.view.lower[i]) && !is_above(exact_value, std::min(rows.view.upper[i], 1e300));
}

class Requested {
 public:
  int answers = 0, wrong = 0, within = 0, beyond = 0, overlaps = 0, wide = 0;

  void dense(const Crowd& crowd, const Rows& rows) {
    for (std::size_t k = 0; k < Crowd::kConfigurations; ++k)
      for (std::size_t p = 0; p < crowd.pairs.size(); ++p)
        row(rows, k * crowd.pairs.size() + p, crowd.exact_value[k][p]);
  }
  void least(const Crowd& crowd, const Rows& rows) {
    for (std::size_t k = 0; k < Crowd::kConfigurations; ++k) row(rows, k, *least_of(crowd, k, kNone));
  }
  void nearest(const Crowd& crowd, const Rows& rows) {
    for (std::size_t i = 0; i < rows.info.rows; ++i) {
      const auto body = static_cast<std::uint32_t>(i % crowd.bodies.size());
      row(rows, i, *least_of(crowd, i / crowd.bodies.size(), body));
    }
  }
  void listed(const Crowd& crowd, const Rows& rows, double max_distance) {
    std::set<std::pair<std::uint32_t, BodyPair> > seen;
    for (std::size_t i = 0; i < rows.info.rows; ++i) {
      const std::uint32_t k = rows.view.configuration[i];
      wrong += !seen.insert({k, rows.view.pair[i]}).second;
      row(rows, i, crowd.of(k, rows.view.pair[i]));
    }
    for (std::uint32_t k = 0; k < Crowd::kConfigurations; ++k)
      for (const BodyPair& p : crowd.pairs)
        wrong += crowd.of(k, p).distance.compare(max_distance) <= 0 && !seen.contains({k, p});
  }
  void decided(const Crowd& crowd, const Rows& rows, double margin) {
    for (std::size_t k = 0; k < Crowd::kConfigurations; ++k) {
      ++answers;
      const Result& least = *least_of(crowd, k, kNone);
      const auto status = static_cast<Status>(rows.view.status[k]);
      if (status == Status::kBeyond) {
        ++beyond;
        wrong += least.distance.compare(margin) <= 0;
      } else if (status == Status::kUnconverged) {
        // Without a proof: correct only at the margin.
        wide += std::abs(least.distance.lower() - margin) > 1e-6 * (1 + margin);
      } else {
        ++within;
        wrong += crowd.of(k, rows.view.pair[k]).distance.compare(margin) > 0;
      }
    }
  }

 private:
  /// Of all pairs, or of those of one body.
  static const Result* least_of(const Crowd& crowd, std::size_t k, std::uint32_t body) {
    const Result* least = nullptr;
    for (std::size_t p = 0; p < crowd.pairs.size(); ++p) {
      if (body != kNone && crowd.pairs[p].a != body && crowd.pairs[p].b != body) continue;
      const Result& r = crowd.exact_value[k][p];
      // Radii differ between pairs, so doubles decide except for the last bit.
      if (!least || r.distance.lower() < least->distance.lower()) least = &r;
    }
    return least;
  }
  void row(const Rows& rows, std::size_t i, const Result& exact_value) {
    ++answers;
    wrong += !contains(rows, i, exact_value);
    const auto status = static_cast<Status>(rows.view.status[i]);
    const bool is_apart = exact_value.distance.compare(0) > 0;
    wrong += (status == Status::kOverlap && is_apart) || (status == Status::kOk && !is_apart);
    overlaps += status == Status::kOverlap;
    wide += status == Status::kUnconverged && !(rows.view.flags[i] & kFlagRoundingLimited);
  }
};

TEST(MeshCrowds, EveryReductionIsTrue) {
  Requested requested;
  for (const CaseClass& cls : mesh_classes()) {
    const Crowd crowd(cls, 100);
    engine::Engine::Options options;
    options.backend = "cpu";
    options.threads = 1 + static_cast<int>(&cls - mesh_classes().data()) % 2;
    const engine::Engine engine(crowd.scene(), options);
    std::vector<double> distances;
    for (const auto& row : crowd.exact_value)
      for (const Result& r : row) distances.push_back(std::max(0.0, r.distance.lower()));
    std::sort(distances.begin(), distances.end());
    const double middle = distances[distances.size() / 2];
    for (const Precision precision : {Precision::kF64, Precision::kF32}) {
      QueryView q;
      q.precision = precision;
      q.configuration_count = Crowd::kConfigurations;
      q.bodies = crowd.moved;
      q.configurations = crowd.configurations;
      requested.dense(crowd, evaluate(engine, q));
      q.reduce = Reduce::kMin;
      requested.least(crowd, evaluate(engine, q));
      q.reduce = Reduce::kNearest;
      requested.nearest(crowd, evaluate(engine, q));
      q.reduce = Reduce::kWithin;
      for (const double most : {0.0, 0.5 * middle, middle}) {
        q.max_distance = most;
        requested.listed(crowd, evaluate(engine, q), most);
      }
      q.max_distance = kInf;
      q.reduce = Reduce::kAny;
      for (const Result& r : crowd.exact_value[0])
        for (const double by : {0.5, 1.0, 2.0}) {
          q.margin = by * std::max(0.0, r.distance.lower());
          requested.decided(crowd, evaluate(engine, q), q.margin);
        }
    }
  }
  std::printf("%d answers, %d wrong, %d wide, %d overlaps; decisions: %d within, %d beyond\n", requested.answers,
              requested.wrong, requested.wide, requested.overlaps, requested.within, requested.beyond);
  EXPECT_EQ(requested.wrong, 0);
  EXPECT_EQ(requested.wide, 0);
  EXPECT_GT(requested.overlaps, 500);
  EXPECT_GT(requested.within, 500);
  EXPECT_GT(requested.beyond, 100);
}

// A body of a mesh and another part, hull or mesh, both grown by padding: the nearer of them counts.
TEST(MeshCrowds, PartsOfAllKindsMakeABody) {
  constexpr double kPadding = 0.0625;
  int first_is_nearer = 0, second_is_nearer = 0, overlapping = 0;
  for (const CaseClass& cls : mesh_classes())
    for (std::uint64_t i = 0; i < 10; ++i) {
      const Case c = make_case(cls, kSeed, 300 + i), other = make_case(cls, kSeed, 400 + i);
      if (c.a->radius != 0 || other.b->radius != 0) continue;  // padding adds to radii, rounded
      Body a, b;
      a.name = "a", b.name = "b";
      a.parts = {part_of(*c.a), part_of(*other.b)};
      b.parts = {part_of(*c.b)};
      a.pose = c.X_wa, b.pose = c.X_wb;
      a.padding = kPadding;
      engine::Scene scene;
      scene.add_body(std::move(a));
      scene.add_body(std::move(b));
      engine::Engine::Options options;
      options.backend = "cpu";
      const Rows rows = evaluate(engine::Engine(std::move(scene), options), {});
      Solid grown = *c.a, grown_other = *other.b;
      grown.radius = grown_other.radius = kPadding;
      const Result exact_value[] = {
          exact_answer({std::make_shared<const Solid>(grown), c.b, c.X_wa, c.X_wb}, false),
          exact_answer({std::make_shared<const Solid>(grown_other), c.b, c.X_wa, c.X_wb}, false)};
      const int nearer = exact_value[0].distance.compare(exact_value[1].distance) <= 0 ? 0 : 1;
      const bool is_apart = exact_value[nearer].distance.compare(0) > 0;
      (is_apart ? nearer == 0 ? first_is_nearer : second_is_nearer : overlapping)++;
      EXPECT_TRUE(contains(rows, 0, exact_value[nearer])) << cls.name << ' ' << i;
      const auto status = static_cast<Status>(rows.view.status[0]);
      EXPECT_TRUE(status == Status::kContact || status == (is_apart ? Status::kOk : Status::kOverlap))
          << cls.name << ' ' << i << ' ' << static_cast<int>(status);
    }
  EXPECT_GT(first_is_nearer, 10);
  EXPECT_GT(second_is_nearer, 3);
  EXPECT_GT(overlapping, 20);
}

// An answer does not depend on slices, threads or instruction sets.
TEST(MeshCrowds, AnswersHaveTheSameBitsHoweverTheyAreMade) {
  int compared = 0;
  for (std::size_t at = 0; at < mesh_classes().size(); at += 5) {
    const Crowd crowd(mesh_classes()[at], 200);
    std::optional<Rows> first[3];
    for (const std::string& set : engine::Engine::instruction_sets())
      for (const int threads : {1, 2})
        for (const char* broad : {"brute", "tree"}) {
          engine::Engine::Options options;
          options.backend = "cpu";
          options.threads = threads;
          options.instruction_set = set;
          options.broad_phase = broad;
          const engine::Engine engine(crowd.scene(), options);
          for (const std::uint64_t units : {WorkBudget::kNoLimit, std::uint64_t{7}})
            for (const int reduce : {0, 1, 2}) {
              QueryView q;
              q.reduce = std::array{Reduce::kNone, Reduce::kMin, Reduce::kNearest}[static_cast<std::size_t>(reduce)];
              q.configuration_count = Crowd::kConfigurations;
              q.bodies = crowd.moved;
              q.configurations = crowd.configurations;
              Rows rows = evaluate(engine, q, {.units = units});
              std::optional<Rows>& known = first[reduce];
              if (!known) {
                known = std::move(rows);
                continue;
              }
              for (std::size_t i = 0; i < rows.info.rows; ++i) {
                ++compared;
                EXPECT_EQ(rows.view.lower[i], known->view.lower[i])
                    << mesh_classes()[at].name << ' ' << set << ' ' << i;
                EXPECT_EQ(rows.view.upper[i], known->view.upper[i])
                    << mesh_classes()[at].name << ' ' << set << ' ' << i;
                EXPECT_EQ(rows.view.status[i], known->view.status[i]);
              }
            }
        }
  }
  EXPECT_GT(compared, 1000);
}
#endif

}  // namespace
}  // namespace clearance::exact
