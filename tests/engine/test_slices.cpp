// Jobs in slices of few units of work: they stop between the part pairs of a pair, and the bits are those of a single
// slice.
#include <gtest/gtest.h>

#include <cstring>

#include "engine/hull/shapes.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {
namespace {

constexpr std::uint64_t kSlice = 16;  // units

/// Bodies of many convex parts, each a cloud of 20 vertices, all overlapping.
engine::Scene heaps(int bodies, int parts) {
  Random random(5);
  engine::Scene scene;
  for (int b = 0; b < bodies; ++b) {
    Body body;
    body.name = "heap" + std::to_string(b);
    body.pose = Pose{};
    for (int p = 0; p < parts; ++p) {
      const Vec3d centre{random.uniform(-3, 3), random.uniform(-3, 3), random.uniform(-3, 3)};
      std::vector<Vec3d> vertices = random.cloud(20, {0.3, 0.3, 0.3});
      for (Vec3d& v : vertices) v = v + centre;
      body.parts.push_back(make_convex_part(std::move(vertices)));
    }
    scene.add_body(std::move(body));
  }
  return scene;
}

/// All columns, from where they are aligned.
std::vector<std::byte> columns_of(Answer& a) {
  void* begin = a.memory.data();
  std::size_t room = a.memory.size();
  std::align(64, a.memory.size() - 64, begin, room);
  const auto* const first = static_cast<const std::byte*>(begin);
  return {first, first + a.memory.size() - 64};
}

/// The answer in slices of kSlice units.
/// \param slices receives their number
/// \param longest receives the units of the longest
Answer in_slices(const engine::Engine& engine, const QueryView& query, int& slices, std::uint64_t& longest) {
  Answer a = empty_answer(engine, query);
  Job job = engine.start(query, a.view);
  slices = 0;
  longest = 0;
  for (bool done = false; !done; ++slices) {
    const std::uint64_t before = job.units();
    done = job.advance(WorkBudget{.units = kSlice});
    longest = std::max(longest, job.units() - before);
  }
  a.info = job.info();
  return a;
}

TEST(Slices, EndWithinAPairOfBodiesOfManyParts) {
  const engine::Engine engine(heaps(2, 60), {.threads = 1});
  QueryView query;
  query.signed_distance = true;
  query.fields = kAllFields;
  const Answer whole = evaluate(engine, query);
  ASSERT_EQ(whole.info.rows, 1u) << "one pair of bodies";
  int slices = 0;
  std::uint64_t longest = 0;
  const Answer sliced = in_slices(engine, query, slices, longest);
  EXPECT_GT(slices, 10);
  // A slice ends after the current part pair, or the current boxes: of 60 x 60 a unit for each sixteen.
  EXPECT_LT(longest, 5000u);
  EXPECT_EQ(whole.view.lower[0], sliced.view.lower[0]);
  EXPECT_EQ(whole.view.upper[0], sliced.view.upper[0]);
  EXPECT_EQ(whole.view.parts[0], sliced.view.parts[0]);
  EXPECT_EQ(whole.view.parts[1], sliced.view.parts[1]);
}

TEST(Slices, GiveEveryReductionTheSameBits) {
  for (const int threads : {1, 3}) {
    const engine::Engine engine(heaps(12, 6), {.threads = threads});
    for (const Reduce reduce : {Reduce::kNone, Reduce::kWithin, Reduce::kNearest, Reduce::kMin}) {
      QueryView query;
      query.reduce = reduce;
      query.signed_distance = true;
      const std::vector<std::uint32_t> bodies{3};
      std::vector<Pose> configurations;
      for (int k = 0; k < 9; ++k) configurations.push_back(Pose{{0.5 * k, 0, 0}});
      query.bodies = bodies;
      query.configurations = configurations;
      query.configuration_count = 9;
      query.max_distance = 2;
      const Answer whole = evaluate(engine, query);
      int slices = 0;
      std::uint64_t longest = 0;
      const Answer sliced = in_slices(engine, query, slices, longest);
      EXPECT_GT(slices, 3) << int(reduce);
      ASSERT_EQ(whole.info.rows, sliced.info.rows);
      ASSERT_GT(whole.info.rows, 0u);
      EXPECT_EQ(whole.info.pairs_evaluated, sliced.info.pairs_evaluated);
      EXPECT_EQ(std::memcmp(whole.view.lower, sliced.view.lower, 8 * whole.info.rows), 0) << int(reduce);
      EXPECT_EQ(std::memcmp(whole.view.upper, sliced.view.upper, 8 * whole.info.rows), 0) << int(reduce);
    }
  }
}

TEST(Slices, EndWithinAPairThatIsTheNearest) {
  const engine::Engine engine(heaps(2, 60), {.threads = 1});
  QueryView query;
  query.reduce = Reduce::kNearest;
  query.k = 1;
  query.signed_distance = true;
  query.fields = kAllFields;
  Answer whole = evaluate(engine, query);
  ASSERT_EQ(whole.info.rows, 1u);
  int slices = 0;
  std::uint64_t longest = 0;
  Answer sliced = in_slices(engine, query, slices, longest);
  EXPECT_GT(slices, 10);
  EXPECT_LT(longest, 5000u);
  EXPECT_EQ(columns_of(whole), columns_of(sliced));
}

TEST(Slices, OfTheNearestPairsEndBetweenPairs) {
  for (const int threads : {1, 3}) {
    const engine::Engine engine(heaps(12, 6), {.threads = threads});
    QueryView query;
    query.reduce = Reduce::kNearest;
    query.k = 5;
    query.signed_distance = true;
    query.fields = kAllFields | kFieldSmoothRadius;
    const std::vector<std::uint32_t> bodies{3};
    std::vector<Pose> configurations;
    for (int k = 0; k < 9; ++k) configurations.push_back(Pose{{0.5 * k, 0, 0}});
    query.bodies = bodies;
    query.configurations = configurations;
    query.configuration_count = 9;
    Answer whole = evaluate(engine, query);
    ASSERT_EQ(whole.info.rows, 9 * 5u);
    int slices = 0;
    std::uint64_t longest = 0;
    Answer sliced = in_slices(engine, query, slices, longest);
    EXPECT_GT(slices, 9) << "more than one a configuration";
    EXPECT_EQ(whole.info.pairs_evaluated, sliced.info.pairs_evaluated);
    EXPECT_EQ(columns_of(whole), columns_of(sliced)) << threads;
  }
}

TEST(Slices, CountTheOrderOfTheNearestPairs) {
  engine::Scene scene;
  for (int i = 0; i < 400; ++i) scene.add_sphere("ball" + std::to_string(i), 0.1, {.pose = Pose{{1.0 * i, 0, 0}}});
  const engine::Engine engine(std::move(scene), {.threads = 1});
  QueryView query;
  query.reduce = Reduce::kNearest;
  query.k = 1;
  Answer a = empty_answer(engine, query);
  Job job = engine.start(query, a.view);
  ASSERT_TRUE(job.advance());
  EXPECT_LT(job.info().pairs_evaluated, 1000u);
  EXPECT_GT(job.units(), 400u * 399 / 2 / 16);
}

TEST(Slices, CountSecondDerivativesAndEndBetweenTheirRows) {
  for (const int threads : {1, 3}) {
    const engine::Engine engine(heaps(2, 60), {.threads = threads});
    const std::vector<std::uint32_t> bodies{1};
    std::vector<Pose> configurations;
    for (int k = 0; k < 9; ++k) configurations.push_back(Pose{{8 + 0.5 * k, 0, 0}});
    for (const Reduce reduce : {Reduce::kNone, Reduce::kWithin, Reduce::kNearest, Reduce::kMin}) {
      for (const std::uint32_t k : {0u, 1u}) {
        if (k && reduce != Reduce::kNearest) continue;
        QueryView query;
        query.reduce = reduce;
        query.k = k;
        query.bodies = bodies;
        query.configurations = configurations;
        query.configuration_count = 9;
        const auto units = [&](std::uint32_t fields) {
          query.fields = fields;
          Answer a = empty_answer(engine, query);
          Job job = engine.start(query, a.view);
          EXPECT_TRUE(job.advance());
          return job.units();
        };
        const std::uint64_t without = units(kFieldPointA), with = units(kFieldPointA | kFieldSmoothRadius);
        const std::uint64_t rows = reduce == Reduce::kNearest && k == 0 ? 18 : 9;
        EXPECT_GT(with, without + rows * 60 * 60 / 16) << "the balls of all parts of each row, " << int(reduce);
        Answer whole = evaluate(engine, query);
        ASSERT_EQ(whole.info.rows, rows);
        for (std::uint64_t i = 0; i < rows; ++i) ASSERT_TRUE(whole.view.smooth_radius[i] >= 0);
        int slices = 0;
        std::uint64_t longest = 0;
        Answer sliced = in_slices(engine, query, slices, longest);
        EXPECT_EQ(columns_of(whole), columns_of(sliced)) << int(reduce) << ", k " << k;
        const int least =
            reduce == Reduce::kWithin || k == 1 ? int(rows) : 1;  // others write a block of rows at a time
        EXPECT_GE(slices, least);
      }
    }
  }
}

TEST(Slices, APairThatIsTooExpensiveIsBegunAgainInTheNextOne) {
  Random random(9);
  engine::Scene scene;
  for (int b = 0; b < 2; ++b) {
    engine::Scene::BodyOptions options;
    options.pose = Pose{{0.1 * b, 0, 0}};
    std::vector<Vec3d> vertices = random.cloud(3000, {1, 1, 1});
    for (Vec3d& v : vertices) v = v * (1 / norm(v));
    scene.add_hull("ball" + std::to_string(b), vertices, options);
  }
  const engine::Engine engine(std::move(scene), {.threads = 1});
  QueryView query;
  query.signed_distance = true;
  const Answer whole = evaluate(engine, query);
  ASSERT_LT(whole.view.upper[0], 0);
  Answer again = empty_answer(engine, query);
  Job job = engine.start(query, again.view);
  const WorkBudget little{.units = 100, .pair_units = 100};
  for (int i = 0; i < 3; ++i) {
    const std::uint64_t before = job.units();
    ASSERT_FALSE(job.advance(little));
    EXPECT_LT(job.units() - before, 1000u);
  }
  ASSERT_TRUE(job.advance());
  EXPECT_EQ(whole.view.lower[0], again.view.lower[0]);
  EXPECT_EQ(whole.view.upper[0], again.view.upper[0]);
}

TEST(Slices, CountWhatAQueryNames) {
  engine::Scene scene = heaps(5, 4);
  const std::vector<std::string> names{"heap0", "heap1", "heap2"};
  scene.add_group("three", names);
  const engine::Engine engine(std::move(scene), {.threads = 1});
  QueryView query;
  EXPECT_EQ(engine.cost(query).pairs, 10u) << "the table's";
  const std::vector<BodyPair> pairs{{0, 1}, {kGroupBit, kEveryBody}, {99, 0}};
  query.pairs = pairs;
  query.all_pairs = false;
  const QueryCost cost = engine.cost(query);
  EXPECT_EQ(cost.pairs, 1u + 15 + 1);
  EXPECT_EQ(cost.part_pairs, 16u + 12 * 20);
  EXPECT_EQ(cost.units, 2 * (16u + 12 * 20)) << "20 vertices are a unit";
  query.configuration_count = 7;
  EXPECT_EQ(engine.cost(query).part_pairs, 7 * (16u + 12 * 20));
}

TEST(Slices, CountTheTrianglesOfAMesh) {
  const Shape ball = make_uv_sphere(1, 20);  // 1520 triangles
  engine::Scene scene;
  scene.add_sphere("point", 1, {.pose = Pose{}});
  scene.add_mesh("hull", ball.vertices, ball.triangles, MeshAs::kHull, {.pose = Pose{{3, 0, 0}}});
  scene.add_mesh("solid", ball.vertices, ball.triangles, MeshAs::kSolid, {.pose = Pose{{6, 0, 0}}});
  const engine::Engine engine(std::move(scene), {.threads = 1});
  QueryView query;
  query.all_pairs = false;
  const auto units = [&](BodyPair pair) {
    query.pairs = std::span(&pair, 1);
    return engine.cost(query).units;
  };
  EXPECT_EQ(units({2, 0}) - units({1, 0}), 64u + ball.triangles.size() / 64);
}

}  // namespace
}  // namespace clearance::test
