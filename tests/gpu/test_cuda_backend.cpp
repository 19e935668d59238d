// The cuda backend must give the CPU's bits for every kind of query.
#include <numeric>
#include <set>
#include <thread>

#include "tests/engine/cuda/same_answer.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Many bodies of few shapes, so that groups form; some rounded, some too large for shared memory, some of two convex
// parts.
engine::Scene grouped_scene(int count, double box, std::uint64_t seed) {
  Random random(seed);
  engine::Scene scene;
  for (int i = 0; i < count; ++i) {
    engine::Scene::BodyOptions options;
    options.pose = random.pose(box);
    const std::string name = "body" + std::to_string(i);
    if (i % 40 == 7) {
      scene.add_hull(name, cloud_on_sphere(600, 0.6, 3), options);
    } else if (i % 40 == 13) {
      Body body;
      body.name = name;
      body.pose = options.pose;
      body.parts = {make_convex_part(cloud_on_sphere(10, 0.3, 5)), make_convex_part(cloud_on_sphere(10, 0.3, 6), 0.05)};
      scene.add_body(std::move(body));
    } else if (i % 4 == 0) {
      scene.add_capsule(name, 0.2, 0.5, options);
    } else if (i % 4 == 1) {
      scene.add_hull(name, cloud_on_sphere(200, 0.5, 4), options);
    } else {
      scene.add_uv_sphere(name, 0.5, 5, options);
    }
  }
  return scene;
}

class CudaBackend : public testing::Test {
 protected:
  void SetUp() override { SKIP_WITHOUT_DEVICE(); }
};

// Every kind of query with its own code path.
std::vector<std::pair<std::string, QueryView>> queries() {
  std::vector<std::pair<std::string, QueryView>> all;
  const auto add = [&](const std::string& name, auto&& change) {
    QueryView q;
    change(q);
    all.emplace_back(name, q);
  };
  add("default columns", [](QueryView&) {});
  add("all columns", [](QueryView& q) { q.fields = kAllFields; });
  add("float32 columns", [](QueryView& q) { q.fields = kFloat32; });
  add("float32 columns, status and flags", [](QueryView& q) { q.fields = kFloat32 | kFieldStatus | kFieldFlags; });
  add("no tolerance", [](QueryView& q) { q.rel_tol = 0, q.fields = kAllFields; });
  add("loose", [](QueryView& q) { q.rel_tol = 0.1, q.abs_tol = 0.01, q.fields = kAllFields; });
  add("near", [](QueryView& q) { q.max_distance = 1.5, q.fields = kAllFields; });
  add("depth", [](QueryView& q) { q.signed_distance = true, q.fields = kAllFields; });
  add("f32", [](QueryView& q) { q.precision = Precision::kF32, q.fields = kAllFields; });
  add("f32, float32 columns", [](QueryView& q) { q.precision = Precision::kF32, q.fields = kFloat32; });
  add("f32, bounds", [](QueryView& q) { q.precision = Precision::kF32, q.fields = kFieldLower | kFieldUpper; });
  add("f32, hardly attainable",
      [](QueryView& q) { q.precision = Precision::kF32, q.rel_tol = 1e-5, q.fields = kAllFields; });
  add("f32, near", [](QueryView& q) { q.precision = Precision::kF32, q.max_distance = 1.5, q.fields = kAllFields; });
  add("f32, depth",
      [](QueryView& q) { q.precision = Precision::kF32, q.signed_distance = true, q.fields = kAllFields; });
  return all;
}

void compare(const engine::Engine& device, const engine::Engine& cpu, const QueryView& q, const std::string& what) {
  expect_same(evaluate(device, q), evaluate(cpu, q), what);
}

TEST_F(CudaBackend, GivesTheBitsOfTheCpuForAllPairsOfAScene) {
  for (const double box : {3.0, 20.0}) {
    const engine::Engine device(grouped_scene(300, box, 1), {"cuda"}),
        cpu(grouped_scene(300, box, 1), {.backend = "cpu", .covers = engine::Covers::kOff});
    EXPECT_EQ(device.backend(), "cuda");
    for (const auto& [name, q] : queries()) compare(device, cpu, q, name + ", box " + std::to_string(box));
    EXPECT_GT(counter(device, "cuda.pairs_converged"), 100'000u);
    EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
  }
}

// In several chunks, and in one answered with as few calls as possible.
TEST_F(CudaBackend, FindsMostDepths) {
  for (const int bodies : {150, 600}) {
    const engine::Engine device(grouped_scene(bodies, 3, 7), {"cuda"}),
        cpu(grouped_scene(bodies, 3, 7), {.backend = "cpu", .covers = engine::Covers::kOff});
    for (const Precision precision : {Precision::kF64, Precision::kF32})
      for (const std::uint32_t fields : {kAllFields | 0u, kDefaultFields | 0u}) {
        QueryView q;
        q.signed_distance = true;
        q.precision = precision;
        q.fields = fields;
        const std::uint64_t before = counter(device, "cuda.pairs_finished_on_cpu");
        const Answer rows = evaluate(device, q);
        expect_same(rows, evaluate(cpu, q), "depths");
        std::uint64_t overlaps = 0;
        for (std::uint64_t i = 0; i < rows.info.rows; ++i)
          overlaps += static_cast<Status>(rows.view.status[i]) == Status::kOverlap;
        EXPECT_GT(overlaps, 100u);
        EXPECT_LT((counter(device, "cuda.pairs_finished_on_cpu") - before) * 4, overlaps);
      }
  }
}

TEST_F(CudaBackend, GivesTheBitsOfTheCpuWhereEveryBodyHasItsOwnShape) {
  const engine::Engine device(mixed_scene(120, 4, 2), {"cuda"}),
      cpu(mixed_scene(120, 4, 2), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const auto& [name, q] : queries()) compare(device, cpu, q, name);
}

// Bodies of 1 to 40 convex parts, at the snapshot's poses and in configurations.
TEST_F(CudaBackend, GivesTheBitsOfTheCpuForBodiesOfSeveralParts) {
  for (const double box : {0.8, 5.0}) {
    const engine::Engine device(decomposed_scene(90, box, 41), {"cuda"}),
        cpu(decomposed_scene(90, box, 41), {.backend = "cpu", .covers = engine::Covers::kOff});
    Random random(42);
    const std::vector<std::uint32_t> bodies{0, 2, 3, 7, 15, 26, 30};
    for (auto [name, q] : queries()) {
      const std::string what = name + ", box " + std::to_string(box);
      compare(device, cpu, q, what);
      for (const std::uint32_t K : {1u, 33u, 150u}) {
        if (K == 150 && q.signed_distance) continue;  // overlaps are left to the CPU
        std::vector<Pose> poses;
        for (std::size_t i = 0; i < K * bodies.size(); ++i) poses.push_back(random.pose(box));
        poses[1].qw = poses[1].qx = poses[1].qy = poses[1].qz = 0;
        q.bodies = bodies;
        q.configurations = poses;
        q.configuration_count = K;
        compare(device, cpu, q, what + ", " + std::to_string(K) + " configurations");
        q.configurations = {};
      }
    }
    EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
    const std::uint64_t converged = counter(device, "cuda.pairs_converged"),
                        rest = counter(device, "cuda.pairs_finished_on_cpu");
    EXPECT_GT(converged, 100'000u);
    EXPECT_GT(converged, 5 * rest)
        << rest << " were finished by the CPU: those without a tolerance, and depths of several pieces";
  }
}

// A body with a convex part that the device cannot hold is left to the CPU as a whole.
TEST_F(CudaBackend, LeavesBodiesWithAPartThatTheDeviceCannotHoldToTheCpu) {
  const auto with_large = [] {
    engine::Scene scene = decomposed_scene(30, 2, 43), large;
    large.add_uv_sphere("large", 0.3, 200, {});  // 79,602 vertices
    Body body;
    body.name = "both";
    body.pose = Pose{{0.1, 0.2, 0.3}};
    body.parts = {scene.bodies()[0].parts[0], large.bodies()[0].parts[0]};
    scene.add_body(std::move(body));
    return scene;
  };
  const engine::Engine device(with_large(), {"cuda"}),
      cpu(with_large(), {.backend = "cpu", .covers = engine::Covers::kOff});
  QueryView q;
  q.fields = kAllFields;
  compare(device, cpu, q, "dense");
  EXPECT_GE(counter(device, "cuda.pairs_finished_on_cpu"), 30u);
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
  q.reduce = Reduce::kNearest;
  expect_same(evaluate(device, q), evaluate(cpu, q), "nearest", true);
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 1u);
}

// Hulls that do not fit in shared memory are read from the scene's arrays, with tables coarse enough for 16 bits. The
// largest have no table, and the CPU answers.
TEST_F(CudaBackend, GivesTheBitsOfTheCpuForLargeHulls) {
  const auto large = [](bool with_largest) {
    Random random(31);
    engine::Scene scene, shapes;
    for (const int vertices : {513, 900, 2500, 6000, 42})
      shapes.add_hull("h" + std::to_string(vertices), cloud_on_sphere(vertices, 0.6, 6), {});
    if (with_largest) shapes.add_uv_sphere("largest", 0.6, 200, {});  // 79,602 vertices
    for (int i = 0; i < 60; ++i) {
      Body body;
      body.name = "b" + std::to_string(i);
      body.parts = shapes.bodies()[static_cast<std::size_t>(i) % shapes.bodies().size()].parts;
      body.pose = random.pose(4);
      scene.add_body(std::move(body));
    }
    return scene;
  };
  Random random(32);
  const std::vector<std::uint32_t> bodies{2, 3, 14};
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < 100 * bodies.size(); ++i) poses.push_back(random.pose(4));
  for (const bool with_largest : {false, true}) {
    // Where the device leaves a query to its CPU, covers would answer.
    const engine::Engine device(large(with_largest), {.backend = "cuda", .covers = engine::Covers::kOff}),
        cpu(large(with_largest), {.backend = "cpu", .covers = engine::Covers::kOff});
    const std::string scene = with_largest ? "with the largest" : "large";
    for (auto [name, q] : queries()) {
      compare(device, cpu, q, scene + ", " + name);
      q.bodies = bodies;
      q.configurations = poses;
      q.configuration_count = 100;
      compare(device, cpu, q, scene + ", configurations, " + name);
      if (q.signed_distance) continue;  // overlaps are left to the CPU
      for (const Reduce reduce : {Reduce::kNearest, Reduce::kMin}) {
        q.reduce = reduce;
        expect_same(evaluate(device, q), evaluate(cpu, q), scene + ", reduced, " + name, true);
      }
    }
    if (with_largest)
      EXPECT_GT(counter(device, "cuda.queries_on_cpu"), 0u);
    else
      EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
    EXPECT_GT(counter(device, "cuda.pairs_converged"), 50'000u);
  }
}

// Poses of chains of followers are rounded, which is slack.
TEST_F(CudaBackend, GivesTheBitsOfTheCpuForFollowers) {
  const auto arm = [] {
    engine::Scene scene = grouped_scene(60, 3, 3);
    for (int i : {20, 21, 22}) scene.set_parent("body" + std::to_string(i + 1), "body" + std::to_string(i));
    return scene;
  };
  const engine::Engine device(arm(), {"cuda"}), cpu(arm(), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const auto& [name, query] : queries()) compare(device, cpu, query, name);
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
}

// Over several chunks with a smaller last one.
TEST_F(CudaBackend, GivesTheBitsOfTheCpuForConfigurations) {
  const auto arm = [] { return grouped_scene(60, 3, 3); };
  engine::Engine device(arm(), {"cuda"}), cpu(arm(), {.backend = "cpu", .covers = engine::Covers::kOff});
  const std::vector<std::uint32_t> bodies{2, 21, 23, 40, 30};
  Random random(4);
  for (const std::uint32_t K : {1u, 2u, 130u, 2000u}) {
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < K * bodies.size(); ++i) poses.push_back(random.pose(3));
    poses[3].qw = poses[3].qx = poses[3].qy = poses[3].qz = 0;
    poses[1].translation.y = std::numeric_limits<double>::quiet_NaN();
    poses[0].qx *= 100;
    for (const auto& [name, query] : queries()) {
      QueryView q = query;
      if (K == 2000 && q.fields == kAllFields && !(q.max_distance < kInf)) continue;
      q.configuration_count = K;
      q.bodies = bodies;
      q.configurations = poses;
      compare(device, cpu, q, name + ", " + std::to_string(K) + " configurations");
    }
  }
  EXPECT_GT(counter(device, "cuda.chunks"), counter(device, "cuda.queries")) << "some took several chunks";
}

TEST_F(CudaBackend, AnswersExplicitPairsInTheirOrder) {
  const engine::Engine device(grouped_scene(100, 4, 5), {"cuda"}),
      cpu(grouped_scene(100, 4, 5), {.backend = "cpu", .covers = engine::Covers::kOff});
  Random random(6);
  std::vector<BodyPair> pairs;
  while (pairs.size() < 5000) {
    const BodyPair p{static_cast<std::uint32_t>(random.below(103)), static_cast<std::uint32_t>(random.below(103))};
    if (p.a != p.b) pairs.push_back(p);  // 100 to 102 are unknown bodies
  }
  for (const std::size_t count : {5000u, 700u, 63u, 1u, 0u}) {
    QueryView q;
    q.all_pairs = false;
    q.pairs = std::span(pairs).first(count);
    q.fields = kAllFields;
    compare(device, cpu, q, std::to_string(count) + " pairs");
  }
}

TEST_F(CudaBackend, SaysWhichPosesAreBadMissingRenormalisedOrStale) {
  engine::Scene scene = grouped_scene(50, 3, 7), same = grouped_scene(50, 3, 7);
  for (engine::Scene* s : {&scene, &same}) s->add_box("late", {1, 1, 1}, {});
  engine::Engine device(std::move(scene), {"cuda"}),
      cpu(std::move(same), {.backend = "cpu", .covers = engine::Covers::kOff});
  std::vector<BodyPose> poses{
      {3, Pose{{1, 2, 3}, 0, 0, 0, 0}}, {4, Pose{{kInf, 0, 0}}}, {6, Pose{{0, 1, 0}, 2, 0, 0, 0}}};
  for (engine::Engine* e : {&device, &cpu}) e->set_poses(poses);
  QueryView q;
  q.fields = kAllFields;
  compare(device, cpu, q, "bad poses");
  q.max_pose_age_ns = std::int64_t{1} << 62;
  compare(device, cpu, q, "poses that were never received are stale");
  const Answer r = evaluate(device, q);
  std::set<std::uint8_t> statuses(r.view.status, r.view.status + r.size.rows);
  EXPECT_TRUE(statuses.count(static_cast<std::uint8_t>(Status::kBadPose)));
  EXPECT_TRUE(statuses.count(static_cast<std::uint8_t>(Status::kNoPose)));
}

// At a tolerance near the limit of float32, some pairs keep its answer and some get float64's.
TEST_F(CudaBackend, LeavesToFloat64WhatFloat32CannotSettle) {
  const engine::Engine device(grouped_scene(300, 3, 15), {"cuda"}),
      cpu(grouped_scene(300, 3, 15), {.backend = "cpu", .covers = engine::Covers::kOff});
  QueryView q;
  q.rel_tol = 1e-5;
  const Answer f64 = evaluate(device, q);
  q.precision = Precision::kF32;
  const Answer f32 = evaluate(device, q);
  expect_same(f32, evaluate(cpu, q), "float32");
  const std::vector<BodyPair> pairs = device.pairs(q);
  std::uint64_t converged = 0, finished = 0;
  const auto may_begin_in_f32 = [](std::uint32_t body) { return body % 4 != 1 && body % 40 != 7; };
  for (std::uint64_t i = 0; i < f32.size.rows; ++i) {
    const BodyPair pair = pairs[i];
    if (!may_begin_in_f32(pair.a) || !may_begin_in_f32(pair.b) || !(f64.view.lower[i] > 0)) continue;
    ++(same_bits(f32.view.lower[i], f64.view.lower[i]) ? finished : converged);
  }
  EXPECT_GT(converged, 500u);
  EXPECT_GT(finished, 500u);
}

TEST_F(CudaBackend, FollowsPosesAndAttachments) {
  engine::Engine device(grouped_scene(80, 3, 8), {"cuda"}),
      cpu(grouped_scene(80, 3, 8), {.backend = "cpu", .covers = engine::Covers::kOff});
  Random random(9);
  QueryView q;
  q.fields = kAllFields;
  for (int round = 0; round < 4; ++round) {
    std::vector<BodyPose> poses;
    for (std::uint32_t b = 0; b < 80; ++b) poses.push_back({b, random.pose(3)});
    for (engine::Engine* e : {&device, &cpu}) {
      e->set_poses(poses);
      if (round == 2) e->attach(5, 6);
    }
    compare(device, cpu, q, "round " + std::to_string(round));
  }
}

TEST_F(CudaBackend, WorksInSlicesAndAllocatesNothingOnceWarm) {
  const engine::Engine device(grouped_scene(900, 12, 10), {"cuda"}),
      cpu(grouped_scene(900, 12, 10), {.backend = "cpu", .covers = engine::Covers::kOff});
  const Answer expected = evaluate(cpu, {});
  expect_same(evaluate(device, {}, std::chrono::nanoseconds(1)), expected, "in slices");
  const std::uint64_t allocations = counter(device, "cuda.allocations"), bytes = counter(device, "cuda.scene_bytes");
  for (int i = 0; i < 3; ++i) expect_same(evaluate(device, {}), expected, "again");
  EXPECT_EQ(counter(device, "cuda.allocations"), allocations);
  EXPECT_EQ(counter(device, "cuda.scene_bytes"), bytes);
  EXPECT_GT(bytes, 0u);
}

TEST_F(CudaBackend, WritesStraightIntoPinnedMemory) {
  const engine::Engine device(grouped_scene(800, 12, 11), {"cuda"}),
      cpu(grouped_scene(800, 12, 11), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const auto& [name, q] : queries()) {
    const Answer expected = evaluate(cpu, q);
    std::uint64_t bytes = 0;
    reply_view_over(nullptr, expected.size.rows, expected.size.fields, &bytes);
    const cuda::PinnedMemory memory(bytes);
    Answer direct;
    direct.size = expected.size;
    direct.view = reply_view_over(memory.data(), expected.size.rows, expected.size.fields);
    ASSERT_TRUE(cuda::is_pinned(memory.data()));
    Job job = device.start(q, direct.view);
    while (!job.advance(std::chrono::nanoseconds(1))) {
    }
    direct.info = job.info();
    expect_same(direct, expected, name);
  }
}

TEST_F(CudaBackend, AnswersSeveralThreadsAtOnceAndSurvivesJobsThatAreGivenUp) {
  const engine::Engine device(grouped_scene(400, 8, 12), {"cuda"}),
      cpu(grouped_scene(400, 8, 12), {.backend = "cpu", .covers = engine::Covers::kOff});
  QueryView q;
  q.fields = kAllFields;
  const Answer expected = evaluate(cpu, q), room = evaluate(cpu, q);
  {
    Job given_up = device.start(q, room.view);
    given_up.advance(std::chrono::nanoseconds(1));
  }
  std::vector<Answer> answers(4);
  std::vector<std::thread> threads;
  for (Answer& a : answers) threads.emplace_back([&] { a = evaluate(device, q, std::chrono::microseconds(100)); });
  for (std::thread& t : threads) t.join();
  for (const Answer& a : answers) expect_same(a, expected, "of a thread");
}

TEST_F(CudaBackend, StaysWithinItsMemoryBudget) {
  const engine::Engine free(grouped_scene(700, 12, 14), {"cuda"}),
      cpu(grouped_scene(700, 12, 14), {.backend = "cpu", .covers = engine::Covers::kOff});
  const Answer expected = evaluate(cpu, {});
  expect_same(evaluate(free, {}), expected, "without a budget");
  const std::uint64_t scene = counter(free, "cuda.scene_bytes"), all = scene + counter(free, "cuda.query_bytes");
  ASSERT_GT(all, scene + 1'000'000);
  engine::Engine::Options options{"cuda"};
  for (const std::uint64_t budget : {scene / 2, scene + 1'000'000, all}) {
    options.device_memory = budget;
    options.device_fallback = true;
    const engine::Engine device(grouped_scene(700, 12, 14), options);
    const Answer a = evaluate(device, {});
    expect_same(a, expected, "budget " + std::to_string(budget));
    EXPECT_EQ(a.info.backend, budget == all ? "cuda" : "cpu");
    EXPECT_LE(counter(device, "cuda.scene_bytes") + counter(device, "cuda.query_bytes"), budget);
    if (budget == all) continue;
    EXPECT_NE(device.device_error().find("bytes would be needed, and the budget is " + std::to_string(budget)),
              std::string::npos)
        << device.device_error();
    options.device_fallback = false;
    if (budget < scene) {
      EXPECT_THROW(engine::Engine(grouped_scene(700, 12, 14), options), std::runtime_error);
    } else {
      EXPECT_THROW(evaluate(engine::Engine(grouped_scene(700, 12, 14), options), {}), engine::QueryError);
    }
  }
}

TEST(CudaBackendAbsent, SaysWhy) {
  if (cuda::device_info().present) GTEST_SKIP() << "there is a device: " << cuda::device_info().name;
  EXPECT_FALSE(cuda::device_info().reason.empty());
  try {
    engine::Engine engine(mixed_scene(4, 3, 1), {"cuda"});
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_EQ(e.what(),
              "backend 'cuda' is not there (" + cuda::device_info().reason + "); there are: auto, cpu, reference");
  }
}

}  // namespace
}  // namespace clearance::test
