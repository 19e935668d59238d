// Uncertain bodies and robots on a device: rows must have the CPU's bits.
#include "tests/engine/cuda/uncertain_scene.h"

namespace clearance::test {
namespace {

class CudaSlack : public testing::Test {
 protected:
  void SetUp() override { SKIP_WITHOUT_DEVICE(); }
};

// Every kind of query with its own code path.
std::vector<std::pair<std::string, QueryView>> queries() {
  std::vector<std::pair<std::string, QueryView>> all;
  for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest, Reduce::kMin, Reduce::kWithin}) {
    const auto add = [&](const std::string& name, auto&& change) {
      QueryView q;
      q.fields = kAllFields | kFieldPairLower;
      q.reduce = reduce;
      if (reduce == Reduce::kWithin) q.max_distance = 0.2;
      change(q);
      all.emplace_back("reduce " + std::to_string(int(reduce)) + ", " + name, q);
    };
    add("all columns", [](QueryView&) {});
    add("default columns", [](QueryView& q) { q.fields = kDefaultFields; });
    add("float32 columns", [](QueryView& q) { q.fields = kFloat32 | kFieldFlags; });
    add("no tolerance", [](QueryView& q) { q.rel_tol = 0; });
    add("loose", [](QueryView& q) { q.rel_tol = 0.1, q.abs_tol = 0.01; });
    add("near", [](QueryView& q) { q.max_distance = 0.05; });
    add("of no distance", [](QueryView& q) { q.max_distance = 0; });
    add("depth", [](QueryView& q) { q.signed_distance = true; });
    add("f32", [](QueryView& q) { q.precision = Precision::kF32; });
    add("f32, near", [](QueryView& q) { q.precision = Precision::kF32, q.max_distance = 0.05; });
  }
  return all;
}

// At the snapshot's poses, and in configurations of joints and bodies, also over several chunks.
TEST_F(CudaSlack, GivesTheBitsOfTheCpu) {
  for (const std::uint32_t K : {0u, 1u, 40u, 3000u}) {
    UncertainCase c(K, 11);
    if (K > 1) c.poses[3].qw = c.poses[3].qx = c.poses[3].qy = c.poses[3].qz = 0;
    if (K > 1) c.positions[1] = 5;  // beyond its limits
    const engine::Engine device(uncertain_robot_scene(false), {"cuda"}),
        cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
    for (const auto& [name, query] : queries()) {
      if (K == 3000 && query.signed_distance) continue;  // overlaps are left to the CPU
      QueryView q = query;
      if (K > 0 && q.fields == (kAllFields | kFieldPairLower)) q.fields |= kFieldGradientJoints;
      q.all_pairs = false;
      q.pairs = c.pairs;
      if (K > 0) {
        q.configuration_count = K;
        q.bodies = c.bodies;
        q.joints = c.joints;
        q.configurations = c.poses;
        q.positions = c.positions;
      }
      const Answer rows = evaluate(device, q), expected = evaluate(cpu, q);
      EXPECT_EQ(rows.info.backend, "cuda") << name;
      expect_same(rows, expected, name + ", " + std::to_string(K) + " configurations", q.reduce != Reduce::kNone);
    }
    EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
    EXPECT_GT(counter(device, "cuda.pairs_converged"), 100u * (K + 1));
  }
}

// A whole table, some of whose bodies follow others.
TEST_F(CudaSlack, GivesTheBitsOfTheCpuForAllPairs) {
  const auto scene = [] {
    Random random(3);
    engine::Scene s = uncertain_robot_scene(false);
    for (int i = 0; i < 100; ++i) {
      const std::string name = "more" + std::to_string(i);
      if (i % 3 == 0)
        s.add_hull(name, cloud_on_sphere(30, 0.1, 4), {.pose = random.pose(1), .uncertainty = {0, 0.1}});
      else if (i % 3 == 1)
        s.add_box(name, {0.1, 0.2, 0.1}, {.pose = random.pose(1)});
      else
        add_prism(s, name, 0.1, 0.1, {.parent = "more" + std::to_string(i - 1), .pose = random.pose(0.2)});
    }
    return s;
  };
  const engine::Engine device(scene(), {"cuda"}), cpu(scene(), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const auto& [name, q] : queries())
    expect_same(evaluate(device, q), evaluate(cpu, q), name, q.reduce != Reduce::kNone);
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
}

// Slack grows with time: it lies between that of a scene loaded earlier and queried later, and that of one loaded later
// and queried earlier.
TEST_F(CudaSlack, CountsTheAgeOfPoses) {
  UncertainCase c(20, 12, true);
  c.q.fields = kDefaultFields;
  const engine::Engine old(uncertain_robot_scene(true), {.backend = "cpu", .covers = engine::Covers::kOff}),
      device(uncertain_robot_scene(true), {"cuda"}),
      young(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  const Answer most = evaluate(young, c.q), rows = evaluate(device, c.q), least = evaluate(old, c.q);
  ASSERT_EQ(rows.info.backend, "cuda");
  std::uint64_t grown = 0;
  for (std::uint64_t i = 0; i < rows.info.rows; ++i) {
    EXPECT_TRUE(least.view.lower[i] <= rows.view.lower[i] && rows.view.lower[i] <= most.view.lower[i]) << i;
    EXPECT_TRUE(same_bits(rows.view.upper[i], least.view.upper[i])) << i;
    grown += least.view.lower[i] < rows.view.lower[i];
  }
  EXPECT_GT(grown, 20u);
}

}  // namespace
}  // namespace clearance::test
