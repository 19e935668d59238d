// Empty intervals are never returned: their pairs are answered again, correctly or without a proof, and counted.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "engine/engine.h"
#include "engine/narrow/group.h"
#include "engine/narrow/part_batch.h"
#include "engine/selection/columns.h"
#include "tests/oracle/cases/misleading_table.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {
namespace {

constexpr std::uint64_t kSeed = 17;
constexpr double kInf = std::numeric_limits<double>::infinity();

/// Pairs of spheres large enough for tables, some distance apart, and the directions of their exact distances.
struct Spheres {
  std::vector<Case> cases;
  std::vector<Result> exact_value;

  Spheres() {
    const auto& spheres = *std::find_if(case_classes().begin(), case_classes().end(),
                                        [](const CaseClass& c) { return c.name == "shape_dense_spheres"; });
    Random random(kSeed);
    for (std::uint64_t i = 0; i < 20; ++i) {
      Case c = make_case(spheres, kSeed, i);
      set_gap(c, random.log_uniform(1e-2, 1) * scale_of(c));
      cases.push_back(c);
      exact_value.push_back(exact_answer(c));
    }
  }
};

/// Body a's table is wrong along the direction of b's nearest point, provided that GJK does not begin with it. If it
/// did, it would never see another vertex, and nothing would contradict.
Bench misled(const Spheres& spheres, const std::string& backend) {
  return Bench(spheres.cases, backend, 1, [&](const ConvexPartPtr& part, std::size_t i, bool is_b) {
    EXPECT_TRUE(part->table);
    if (is_b) return part;
    const Case& c = spheres.cases[i];
    const Vec3z& exact = spheres.exact_value[i].direction;
    Vec3d towards_b;
    for (int k = 0; k < 3; ++k) towards_b[k] = mpq_class(exact[k], abs(exact.x) + abs(exact.y) + abs(exact.z)).get_d();
    const Mat3d R_wa = rotation_of(c.X_wa);
    const Vec3d found = R_wa.transpose_times(towards_b);
    const Vec3d first = R_wa.transpose_times(c.X_wb.translation - c.X_wa.translation);
    return part->table->candidates(found).data() == part->table->candidates(first).data()
               ? part
               : with_misleading_table(*part, found);
  });
}

TEST(Contradictions, OfAMisleadingTableAreAnsweredAgainAndCounted) {
  const Spheres spheres;
  for (const std::string backend : {"cpu", "reference"}) {
    const Bench bench = misled(spheres, backend);
    std::uint64_t before = 0;
    for (const Setting& s : standard_settings({backend})) {
      const std::vector<Answer> answers = bench.evaluate(s);
      for (std::size_t i = 0; i < answers.size(); ++i) {
        const CheckResult v = hold_against(spheres.cases[i], spheres.exact_value[i], s, answers[i], false);
        EXPECT_TRUE(v.violation.empty()) << s.name() << ", case " << i << ": " << v.violation << in_words(answers[i]);
      }
      if (s.max_distance > 1) {
        EXPECT_GT(bench.engine().contradictions(), before) << s.name();
      }
      before = bench.engine().contradictions();
    }
  }
}

TEST(Contradictions, AreCaughtBeforeReductionsDecide) {
  const Spheres spheres;
  const Bench bench = misled(spheres, "cpu"), whole(spheres.cases, "cpu");
  for (const Reduce reduce : {Reduce::kMin, Reduce::kWithin}) {
    const auto evaluate = [&](const engine::Engine& engine) {
      QueryView query;
      query.reduce = reduce;
      query.max_results = 10000;
      std::vector<BodyPair> pairs;
      for (std::uint32_t i = 0; i < spheres.cases.size(); ++i) pairs.push_back({2 * i, 2 * i + 1});
      query.pairs = pairs;
      query.all_pairs = false;
      const QuerySize size = engine.size(query);
      std::vector<double> bounds(2 * size.rows);
      ReplyView reply;
      reply.lower = bounds.data();
      reply.upper = bounds.data() + size.rows;
      Job job = engine.start(query, reply);
      while (!job.advance()) {
      }
      std::vector<Interval> rows;
      for (std::uint64_t i = 0; i < job.info().rows; ++i) rows.push_back({bounds[i], bounds[size.rows + i]});
      return rows;
    };
    const std::vector<Interval> seen = evaluate(bench.engine()), expected = evaluate(whole.engine());
    ASSERT_EQ(seen.size(), expected.size());
    ASSERT_FALSE(seen.empty());
    for (std::size_t i = 0; i < seen.size(); ++i) {
      EXPECT_TRUE(seen[i].is_possible());
      EXPECT_TRUE(seen[i].lower <= expected[i].upper && expected[i].lower <= seen[i].upper) << i;
    }
  }
  EXPECT_GT(bench.engine().contradictions(), 0u);
  EXPECT_EQ(whole.engine().contradictions(), 0u);
}

// A faulty lane: converged, with lower above upper.
void run_broken_lanes(const LaneBatch& batch) {
  lane_kernel("baseline").run(batch);
  for (std::size_t i = 0; i < batch.count; ++i)
    if (batch.answers[i].converged && i % 2 == 0) batch.answers[i].lower = batch.answers[i].upper * (1 + 1e-9);
}
void run_broken_f32_lanes(const LaneBatch& batch) {
  lane_kernel("baseline").run_f32(batch);
  for (std::size_t i = 0; i < batch.count; ++i)
    if (batch.answers[i].converged && i % 2 == 0) batch.answers[i].upper = std::nan("");
}

struct Batch {
  std::vector<ConvexPartPtr> parts;
  std::vector<PoseMatrix> poses;
  std::vector<PartTask> tasks;

  explicit Batch(std::span<const Case> cases) {
    poses.reserve(2 * cases.size());
    for (const Case& c : cases) {
      for (const Solid* s : {c.a.get(), c.b.get()}) parts.push_back(make_convex_part(s->vertices, s->radius));
      for (const Pose& X : {c.X_wa, c.X_wb}) poses.push_back({rotation_of(X), X.translation, X});
      const std::size_t i = parts.size() - 2;
      tasks.push_back(
          {parts[i].get(), parts[i + 1].get(), &poses[i], &poses[i + 1], kInf, static_cast<std::uint32_t>(i / 2)});
    }
  }
  std::vector<Interval> evaluate(const NarrowOptions& options) const {
    std::vector<Interval> found(tasks.size());
    PartBatch(options).run(
        tasks,
        [&](const PartTask& t, const LaneAnswer& lane, const LaneWitness&) { found[t.id] = {lane.lower, lane.upper}; },
        [&](const PartTask& t, const NarrowAnswer& answer) { found[t.id] = answer.bounds; });
    return found;
  }
};

std::vector<Case> some_of_every_class() {
  std::vector<Case> cases;
  for (const CaseClass& cls : case_classes())
    for (std::uint64_t i = 0; i < (cls.cost > 3 ? 1 : 4); ++i) cases.push_back(make_case(cls, kSeed, i));
  return cases;
}

TEST(Contradictions, OfABrokenLaneAreAnsweredAgainAndCounted) {
  const LaneKernel broken{"broken", lane_kernel("baseline").lanes, run_broken_lanes, run_broken_f32_lanes};
  const std::vector<Case> cases = some_of_every_class();
  const Batch batch(cases);
  for (const bool f32 : {false, true}) {
    std::atomic<std::uint64_t> count{0};
    NarrowOptions options;
    options.lanes = &broken;
    options.f32 = f32;
    options.limits.rel_tol = 1e-4;
    options.contradictions = &count;
    const std::vector<Interval> found = batch.evaluate(options);
    EXPECT_GT(count, 15u) << "float32 " << f32;
    std::size_t apart = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const Result exact_value = exact_answer(cases[i], false);
      const Interval& b = found[i];
      EXPECT_TRUE(b.is_possible());
      if (exact_value.cores_overlap) continue;
      ++apart;
      EXPECT_TRUE(exact_value.distance.compare(b.lower) >= 0 && exact_value.distance.compare(b.upper) <= 0) << i;
    }
    EXPECT_GT(apart, found.size() / 4);
  }
}

// A group with a pair without a proof has no lower bound, and is not beyond max_distance.
TEST(Contradictions, LeaveNothingProvedOfTheirGroups) {
  PairAnswer beyond = beyond_answer(2);
  widen_to_group(beyond, -kInf, 1, 0, 1e-6);
  EXPECT_EQ(beyond.status, Status::kUnconverged) << "a pair of the group may be nearer than max_distance";
  EXPECT_EQ(beyond.lower, -kInf);
  EXPECT_EQ(lower_with_box(-kInf, 1), -kInf);
}

// Bounds that lanes and GPU kernels would return.
TEST(Contradictions, DoNotConvergeInARun) {
  Gjk<double> g;
  g.v = {1, 0, 0};
  g.squared_distance = 1;
  g.simplex.size = 1;
  g.simplex.vertex[0].w = {1, 0, 0};
  g.simplex.weight[0] = 1;
  g.end = Gjk<double>::code(GjkEnd::kConverged);
  for (const double gap : {1.0, 1.001, std::nan("")}) {
    g.gap = gap;
    const RunBounds<double> bounds(g, 0.0, 1.0, kInf, 0.0, 1e-6);
    EXPECT_EQ(static_cast<bool>(bounds.converged), gap == 1) << gap;
  }
  g.gap = 1.001;
  const RunBounds<double> beyond(g, 0.0, 1.0, 0.5, 0.0, 1e-6);
  EXPECT_FALSE(static_cast<bool>(beyond.converged));
}

// Bounds are rounded outward for any conversion to float32.
TEST(Contradictions, OfFloat32BoundsGoOutAsNothingProved) {
  PairAnswer answer = beyond_answer(0);
  volatile double lower = 0.5e-40, upper = 1.5e-40;
#if defined(__x86_64__)
  const unsigned before = __builtin_ia32_stmxcsr();
  __builtin_ia32_ldmxcsr(before | 1u << 15);  // flush to zero
#endif
  answer.lower = lower;
  answer.upper = upper;
  float bounds[2];
  ReplyView reply;
  reply.bounds = bounds;
  write_row(reply, 0, {0, 1}, 0, answer, {0, 0, 0}, {0, 0, 0});
#if defined(__x86_64__)
  __builtin_ia32_ldmxcsr(before);
#endif
  EXPECT_LE(static_cast<double>(bounds[0]), answer.lower);
  EXPECT_GE(static_cast<double>(bounds[1]), answer.upper);
}

}  // namespace
}  // namespace clearance::exact
