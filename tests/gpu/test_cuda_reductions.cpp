// Nearest, least and within a distance on the device: rows must have the CPU's bits for every kind of query.
#include <algorithm>
#include <thread>

#include "tests/engine/cuda/reduced_scene.h"
#include "tests/engine/cuda/same_answer.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

std::vector<std::pair<std::string, QueryView>> queries() {
  std::vector<std::pair<std::string, QueryView>> all;
  for (const Reduce reduce : kReductions) {
    const auto add = [&](const std::string& name, auto&& change) {
      QueryView q;
      q.fields = kAllFields;
      q.reduce = reduce;
      if (reduce == Reduce::kWithin) q.max_distance = 0.8;
      change(q);
      all.emplace_back("reduction " + std::to_string(int(reduce)) + ", " + name, q);
    };
    add("all columns", [](QueryView&) {});
    add("default columns", [](QueryView& q) { q.fields = kDefaultFields; });
    add("float32 columns", [](QueryView& q) { q.fields = kFloat32 | kFieldFlags; });
    add("no tolerance", [](QueryView& q) { q.rel_tol = 0; });
    add("hardly any tolerance", [](QueryView& q) { q.rel_tol = 1e-15; });
    add("loose", [](QueryView& q) { q.rel_tol = 0.2, q.abs_tol = 0.01; });
    add("near", [](QueryView& q) { q.max_distance = 0.3; });
    add("nearer than any", [](QueryView& q) { q.max_distance = 1e-9; });
    add("of no distance", [](QueryView& q) { q.max_distance = 0; });
    add("depth", [](QueryView& q) { q.signed_distance = true; });
    add("depth, near", [](QueryView& q) { q.signed_distance = true, q.max_distance = 0.2; });
    add("f32", [](QueryView& q) { q.precision = Precision::kF32; });
    add("f32, loose", [](QueryView& q) { q.precision = Precision::kF32, q.rel_tol = 0.2, q.abs_tol = 0.01; });
    add("f32, near", [](QueryView& q) { q.precision = Precision::kF32, q.max_distance = 0.3; });
    if (reduce == Reduce::kWithin) {
      add("all", [](QueryView& q) { q.max_distance = kInf; });
      add("the first few", [](QueryView& q) { q.max_results = 17; });
      add("none", [](QueryView& q) { q.max_results = 0; });
    }
  }
  return all;
}

class CudaReductions : public testing::Test {
 protected:
  void SetUp() override { SKIP_WITHOUT_DEVICE(); }
};

void compare(const engine::Engine& device, const engine::Engine& cpu, const QueryView& q, const std::string& what) {
  expect_same(evaluate(device, q), evaluate(cpu, q), what, true);
}

TEST_F(CudaReductions, GiveTheBitsOfTheCpuForAllPairsOfAScene) {
  for (const double box : {0.7, 3.0, 20.0}) {
    const engine::Engine device(simple_scene(150, box, 1), {"cuda"}),
        cpu(simple_scene(150, box, 1), {.backend = "cpu", .covers = engine::Covers::kOff});
    for (const auto& [name, q] : queries()) compare(device, cpu, q, name + ", box " + std::to_string(box));
    EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
    EXPECT_GT(counter(device, "cuda.pairs_converged"), 1000u);
    if (box < 1) {
      EXPECT_GT(counter(device, "cuda.pairs_finished_on_cpu"), 1000u) << "depths";
    }
  }
}

// Many bodies, in sorted and unsorted tiles, some without poses, some pairs excluded, and a last tile that is not full.
TEST_F(CudaReductions, FindNearPairsOfLargeScenes) {
  for (const int count : {3, 33, 1000, 6200, 9001}) {
    const auto crowd = [&] {
      Random random(8);
      engine::Scene scene, shapes = simple_scene(4, 1, 2);
      const double side = 0.7 * std::cbrt(count);
      for (int i = 0; i < count; ++i) {
        Body body;
        body.name = "b" + std::to_string(i);
        body.parts = shapes.bodies()[static_cast<std::size_t>(i % 4)].parts;
        body.is_static = i % 9 == 4;
        if (i % 500 != 33) body.pose = random.pose(side);
        scene.add_body(std::move(body));
      }
      for (int i = 0; i + 1 < count; i += 3)
        scene.ignore("b" + std::to_string(i), "b" + std::to_string((i + 5) % count));
      return scene;
    };
    const engine::Engine device(crowd(), {"cuda"}), cpu(crowd(), {.backend = "cpu", .covers = engine::Covers::kOff});
    QueryView q;
    q.reduce = Reduce::kWithin;
    q.fields = kAllFields;
    for (const double distance : {0.0, 0.2, 1.0}) {
      q.max_distance = distance;
      const Answer a = evaluate(device, q), expected = evaluate(cpu, q);
      expect_same(a, expected, std::to_string(count) + " bodies within " + std::to_string(distance), true);
      EXPECT_EQ(a.info.backend, "cuda");
      if (count >= 1000 && distance > 0) {
        EXPECT_GT(a.info.total, static_cast<std::uint64_t>(count) / 4);
      }
    }
    q.signed_distance = true;  // the CPU finishes overlaps, which are listed by their position in the table
    compare(device, cpu, q, std::to_string(count) + " bodies with depths");
    if (count >= 1000) {
      EXPECT_GT(counter(device, "cuda.pairs_finished_on_cpu"), 20u);
    }
    EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
  }
}

// Boxes on a grid.
engine::Scene grid(double step) {
  engine::Scene scene;
  for (int i = 0; i < 216; ++i)
    scene.add_box("b" + std::to_string(i), {1, 1, 1},
                  {.pose = Pose{{step * (i % 6), step * (i / 6 % 6), step * (i / 36)}}});
  return scene;
}

// Many distances and box gaps are equal.
TEST_F(CudaReductions, BreakTiesAsTheCpuDoes) {
  const engine::Engine device(grid(2), {"cuda"}), cpu(grid(2), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const auto& [name, q] : queries()) compare(device, cpu, q, name);
  QueryView q;
  q.fields = kAllFields;
  for (const double max_distance : {0.5, 1.0, 1.5, 3.0})
    for (const Reduce reduce : kReductions) {
      q.reduce = reduce;
      q.max_distance = max_distance;
      compare(device, cpu, q, "max_distance " + std::to_string(max_distance));
    }
}

// The device cannot resolve touching pairs: every group is left open, in configurations with more pairs than the
// initial capacity.
TEST_F(CudaReductions, FinishOnTheCpuWhatTouches) {
  const engine::Engine device(grid(1), {"cuda"}), cpu(grid(1), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const auto& [name, q] : queries()) compare(device, cpu, q, name);
  constexpr std::uint64_t kTouching = 540 + 900 + 500;  // by faces, by edges, by corners
  EXPECT_GE(counter(device, "cuda.pairs_finished_on_cpu"), queries().size() * kTouching);
  // Some configurations with contacts among others without.
  std::vector<Pose> poses;
  Random random(14);
  constexpr std::uint32_t kConfigurations = 2000;
  for (std::uint32_t k = 0; k < kConfigurations; ++k)
    poses.push_back(k % 3 == 0 ? Pose{{2, 1, k % 2 ? 6 : 2.5}} : random.pose(9));
  const std::vector<std::uint32_t> moved{7};
  std::uint64_t most = 0;  // pairs of one query that teams leave open
  for (const auto& [name, query] : queries()) {
    if (query.signed_distance) continue;
    QueryView q = query;
    q.bodies = moved;
    q.configurations = poses;
    q.configuration_count = kConfigurations;
    const std::uint64_t before = counter(device, "cuda.pairs_finished_on_cpu");
    compare(device, cpu, q, name + ", configurations");
    if (q.reduce == Reduce::kMin && q.precision == Precision::kF64 && q.rel_tol != 0)
      most = std::max(most, counter(device, "cuda.pairs_finished_on_cpu") - before);
  }
  EXPECT_GT(most, 8192u) << "there was room for all of them";
}

TEST_F(CudaReductions, GiveTheBitsOfTheCpuForConfigurations) {
  const auto arm = [] { return simple_scene(40, 2, 3); };
  const engine::Engine device(arm(), {"cuda"}), cpu(arm(), {.backend = "cpu", .covers = engine::Covers::kOff});
  const std::vector<std::uint32_t> bodies{2, 21, 23, 39, 30};
  Random random(4);
  for (const std::uint32_t K : {1u, 2u, 130u, 3000u}) {
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < K * bodies.size(); ++i) poses.push_back(random.pose(3));
    poses[3].qw = poses[3].qx = poses[3].qy = poses[3].qz = 0;
    poses[1].translation.y = std::numeric_limits<double>::quiet_NaN();
    poses[0].qx *= 100;
    for (const auto& [name, query] : queries()) {
      QueryView q = query;
      if (K == 3000 && (q.signed_distance || q.rel_tol == 0 || q.max_distance == kInf)) {
        if (q.reduce != Reduce::kMin || q.signed_distance) continue;
      }
      q.configuration_count = K;
      q.bodies = bodies;
      q.configurations = poses;
      compare(device, cpu, q, name + ", " + std::to_string(K) + " configurations");
    }
  }
  EXPECT_GT(counter(device, "cuda.chunks"), counter(device, "cuda.queries")) << "some took several chunks";
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
}

TEST_F(CudaReductions, TakeExplicitPairsAndLeaveUnknownBodiesToTheCpu) {
  const engine::Engine device(simple_scene(60, 3, 5), {"cuda"}),
      cpu(simple_scene(60, 3, 5), {.backend = "cpu", .covers = engine::Covers::kOff});
  Random random(6);
  std::vector<BodyPair> pairs;
  while (pairs.size() < 5000) {
    const BodyPair p{static_cast<std::uint32_t>(random.below(50)), static_cast<std::uint32_t>(random.below(50))};
    if (p.a != p.b) pairs.push_back(p);  // some twice, some reversed; bodies 50 to 59 have none
  }
  for (const std::size_t count : {5000u, 63u, 1u, 0u})
    for (const Reduce reduce : kReductions) {
      QueryView q;
      q.all_pairs = false;
      q.pairs = std::span(pairs).first(count);
      q.fields = kAllFields;
      q.reduce = reduce;
      compare(device, cpu, q, std::to_string(count) + " pairs");
    }
  const std::uint64_t on_cpu = counter(device, "cuda.queries_on_cpu");
  pairs.push_back({3, 1000});
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.fields = kAllFields;
  q.reduce = Reduce::kWithin;
  q.max_distance = 0.1;
  compare(device, cpu, q, "an unknown body");
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), on_cpu + 1);
}

TEST_F(CudaReductions, SayWhichGroupsHoldUnusablePoses) {
  engine::Scene scene = simple_scene(50, 3, 7), same = simple_scene(50, 3, 7);
  for (engine::Scene* s : {&scene, &same}) s->add_box("late", {1, 1, 1}, {});
  engine::Engine device(std::move(scene), {"cuda"}),
      cpu(std::move(same), {.backend = "cpu", .covers = engine::Covers::kOff});
  std::vector<BodyPose> poses{
      {2, Pose{{1, 2, 3}, 0, 0, 0, 0}}, {4, Pose{{kInf, 0, 0}}}, {6, Pose{{0, 1, 0}, 2, 0, 0, 0}}};
  for (engine::Engine* e : {&device, &cpu}) e->set_poses(poses);
  for (const auto& [name, query] : queries()) {
    QueryView q = query;
    compare(device, cpu, q, name);
    q.max_pose_age_ns = std::int64_t{1} << 62;
    compare(device, cpu, q, name + ", stale");
  }
  // Bad bodies alone, and bad bodies before good ones.
  const BodyPair bad[] = {{4, 2}, {2, 50}, {50, 4}};
  const BodyPair mixed[] = {{4, 2}, {2, 8}, {8, 12}, {12, 4}};
  for (const auto& [name, query] : queries())
    for (const std::span<const BodyPair> pairs : {std::span<const BodyPair>(bad), std::span<const BodyPair>(mixed)}) {
      QueryView q = query;
      q.all_pairs = false;
      q.pairs = pairs;
      compare(device, cpu, q, name + ", " + std::to_string(pairs.size()) + " pairs of bad bodies");
    }
}

TEST_F(CudaReductions, GrowWhereAllPairsAreNearAndAllocateNothingOnceWarm) {
  const engine::Engine device(simple_scene(700, 1.0, 8), {"cuda"}),
      cpu(simple_scene(700, 1.0, 8), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const Reduce reduce : kReductions) {
    QueryView q;
    q.reduce = reduce;
    if (reduce == Reduce::kWithin) q.max_distance = 10;
    const Answer expected = evaluate(cpu, q);
    if (reduce == Reduce::kWithin) {
      ASSERT_GT(expected.info.rows, std::uint64_t{1} << 17);
    }
    expect_same(evaluate(device, q, std::chrono::nanoseconds(1)), expected, "in slices", true);
    const std::uint64_t allocations = counter(device, "cuda.allocations");
    for (int i = 0; i < 3; ++i) expect_same(evaluate(device, q), expected, "again", true);
    EXPECT_EQ(counter(device, "cuda.allocations"), allocations);
  }
}

TEST_F(CudaReductions, WriteStraightIntoPinnedMemory) {
  const engine::Engine device(simple_scene(300, 6, 9), {"cuda"}),
      cpu(simple_scene(300, 6, 9), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const auto& [name, q] : queries()) {
    const Answer expected = evaluate(cpu, q);
    std::uint64_t bytes = 0;
    reply_view_over(nullptr, expected.size.rows, expected.size.fields, &bytes);
    const cuda::PinnedMemory memory(bytes + 1);
    Answer direct;
    direct.size = expected.size;
    direct.view = reply_view_over(memory.data(), expected.size.rows, expected.size.fields);
    Job job = device.start(q, direct.view);
    while (!job.advance(std::chrono::nanoseconds(1))) {
    }
    direct.info = job.info();
    expect_same(direct, expected, name, true);
  }
}

TEST_F(CudaReductions, AnswerSeveralThreadsAtOnceAndSurviveJobsThatAreGivenUp) {
  const engine::Engine device(simple_scene(300, 4, 12), {"cuda"}),
      cpu(simple_scene(300, 4, 12), {.backend = "cpu", .covers = engine::Covers::kOff});
  std::vector<Answer> expected;
  std::vector<QueryView> requested;
  for (const auto& [name, q] : queries()) {
    requested.push_back(q);
    expected.push_back(evaluate(cpu, q));
  }
  for (std::size_t i = 0; i < requested.size(); i += 5) {
    const Answer room = evaluate(cpu, requested[i]);
    const Job given_up = device.start(requested[i], room.view);
  }
  std::vector<std::thread> threads;
  std::vector<std::vector<Answer>> answers(4, std::vector<Answer>(requested.size()));
  for (std::size_t t = 0; t < answers.size(); ++t)
    threads.emplace_back([&, t] {
      for (std::size_t i = 0; i < requested.size(); ++i)
        answers[t][(i + t) % requested.size()] = evaluate(device, requested[(i + t) % requested.size()]);
    });
  for (std::thread& t : threads) t.join();
  for (const auto& mine : answers)
    for (std::size_t i = 0; i < requested.size(); ++i) expect_same(mine[i], expected[i], "of a thread", true);
}

TEST_F(CudaReductions, GiveTheBitsOfTheCpuForBodiesOfSeveralParts) {
  for (const double box : {0.8, 3.0, 8.0}) {
    const engine::Engine device(decomposed_scene(90, box, 21), {"cuda"}),
        cpu(decomposed_scene(90, box, 21), {.backend = "cpu", .covers = engine::Covers::kOff});
    Random random(22);
    const std::vector<std::uint32_t> bodies{0, 2, 3, 7, 15, 26, 30};
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < 150 * bodies.size(); ++i) poses.push_back(random.pose(box));
    poses[1].qw = poses[1].qx = poses[1].qy = poses[1].qz = 0;
    for (auto [name, q] : queries()) {
      compare(device, cpu, q, name + ", box " + std::to_string(box));
      if (q.signed_distance && box < 1) continue;  // overlaps are left to the CPU
      q.bodies = bodies;
      q.configurations = poses;
      q.configuration_count = 150;
      compare(device, cpu, q, name + ", configurations, box " + std::to_string(box));
    }
    EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
    EXPECT_GT(counter(device, "cuda.pairs_converged"), 10'000u);
  }
}

TEST_F(CudaReductions, LeaveScenesThatTheDeviceDoesNotKnowToTheCpu) {
  const auto with_large = [] {
    engine::Scene scene = mixed_scene(40, 2, 13);
    scene.add_uv_sphere("large", 0.3, 200, {});  // 79,602 vertices
    return scene;
  };
  const engine::Engine device(with_large(), {"cuda"}),
      cpu(with_large(), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const auto& [name, q] : queries()) compare(device, cpu, q, name);
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), queries().size());
}

// The pair with the least lower bound, without uncertainty.
TEST_F(CudaReductions, KnowsThePairOfTheLeastLowerBound) {
  const engine::Engine device(simple_scene(80, 3, 5), {"cuda"}),
      cpu(simple_scene(80, 3, 5), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (auto [name, q] : queries()) {
    q.fields |= kFieldPairLower;
    expect_same(evaluate(device, q), evaluate(cpu, q), name, true);
  }
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
}

}  // namespace
}  // namespace clearance::test
