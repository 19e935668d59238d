// Decisions (Reduce::kAny) and robots' joints on a device: rows must have the CPU's bits.
#include <array>
#include <cmath>

#include "tests/engine/cuda/uncertain_scene.h"
#include "tests/source_file.h"

namespace clearance::test {
namespace {

const std::string kEveryJoint = source_file("tests/engine/robot/every_joint.urdf");

class CudaDecisions : public testing::Test {
 protected:
  void SetUp() override { SKIP_WITHOUT_DEVICE(); }
};

// Every kind of decision with its own code path.
std::vector<std::pair<std::string, QueryView>> queries() {
  std::vector<std::pair<std::string, QueryView>> all;
  const auto add = [&](const std::string& name, auto&& change) {
    QueryView q;
    q.fields = kAllFields | kFieldPairLower;
    q.reduce = Reduce::kAny;
    change(q);
    all.emplace_back(name, q);
  };
  for (const double margin : {0.0, 1e-6, 0.02, 0.3})
    add("margin " + std::to_string(margin), [&](QueryView& q) { q.margin = margin; });
  add("status alone", [](QueryView& q) { q.fields = kFieldStatus; });
  add("verdict", [](QueryView& q) { q.fields |= kFieldVerdict; });
  add("verdict alone", [](QueryView& q) { q.fields = kFieldVerdict; });
  add("float32 columns", [](QueryView& q) { q.fields = kFloat32 | kFieldFlags; });
  add("no tolerance", [](QueryView& q) { q.rel_tol = 0; });
  add("loose", [](QueryView& q) { q.rel_tol = 0.1, q.abs_tol = 0.01, q.margin = 0.05; });
  add("f32", [](QueryView& q) { q.precision = Precision::kF32; });
  add("f32, margin", [](QueryView& q) { q.precision = Precision::kF32, q.margin = 0.02; });
  return all;
}

// Runs a query on both, also with a margin per pair.
// \returns number of rows by status
std::array<std::uint64_t, 16> compare(const engine::Engine& device, const engine::Engine& cpu, QueryView q,
                                      const std::string& what) {
  std::array<std::uint64_t, 16> statuses{};
  const auto compare_one = [&](const std::string& with) {
    const Answer rows = evaluate(device, q), expected = evaluate(cpu, q);
    EXPECT_EQ(rows.info.backend, "cuda") << what;
    expect_same(rows, expected, what + with, true);
    for (std::uint64_t i = 0; expected.view.status && i < expected.info.rows; ++i)
      ++statuses[expected.view.status[i] & 15];
  };
  compare_one("");
  std::vector<double> margins(cpu.pairs(q).size());
  Random random(8);
  for (double& margin : margins) margin = random.uniform(0, 2 * q.margin + 0.001);
  q.pair_margins = margins;
  compare_one(", margins for each pair");
  return statuses;
}
std::uint64_t of(const std::array<std::uint64_t, 16>& statuses, Status status) {
  return statuses[static_cast<std::size_t>(status)];
}

TEST_F(CudaDecisions, HaveTheBitsOfTheCpu) {
  std::uint64_t beyond = 0, overlap = 0, near = 0, converged = 0;
  for (const double box : {1.0, 5.0, 20.0}) {
    const engine::Engine device(mixed_scene(80, box, 5), {"cuda"}),
        cpu(mixed_scene(80, box, 5), {.backend = "cpu", .covers = engine::Covers::kOff});
    for (const std::uint32_t K : {0u, 1u, 300u}) {
      Random random(6);
      const std::vector<std::uint32_t> bodies{1, 2, 3, 17};
      std::vector<Pose> poses;
      for (std::size_t i = 0; i < K * bodies.size(); ++i) poses.push_back(random.pose(i % 3 ? box : 10 * box));
      if (K > 1) poses[9].translation.z = std::numeric_limits<double>::quiet_NaN();
      for (auto [name, q] : queries()) {
        q.configuration_count = K;
        if (K > 0) q.bodies = bodies;
        q.configurations = poses;
        const auto statuses = compare(device, cpu, q, name + ", box " + std::to_string(box));
        beyond += of(statuses, Status::kBeyond);
        overlap += of(statuses, Status::kOverlap);
        near += of(statuses, Status::kOk);
      }
    }
    converged += counter(device, "cuda.pairs_converged");
    EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
  }
  EXPECT_GT(converged, 500u);
  EXPECT_GT(beyond, 500u);
  EXPECT_GT(overlap, 500u);
  EXPECT_GT(near, 100u);
}

TEST_F(CudaDecisions, HaveTheBitsOfTheCpuForUncertainBodies) {
  for (const std::uint32_t K : {0u, 1u, 40u, 3000u}) {
    UncertainCase c(K, 11);
    if (K > 1) c.poses[3].qw = c.poses[3].qx = c.poses[3].qy = c.poses[3].qz = 0;
    if (K > 1) c.positions[1] = 5;  // beyond its limits
    if (K > 5) c.positions[5 * c.joints.size()] = std::numeric_limits<double>::quiet_NaN();
    const engine::Engine device(uncertain_robot_scene(false), {"cuda"}),
        cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
    const std::vector<BodyPair> all = c.pairs;
    for (const std::size_t step : {1u, 9u}) {  // fewer pairs have fewer overlaps
      std::vector<BodyPair> some;
      for (std::size_t i = 0; i < all.size(); i += step) some.push_back(all[i]);
      for (auto [name, q] : queries()) {
        q.all_pairs = false;
        q.pairs = some;
        if (K > 0) {
          q.configuration_count = K;
          q.bodies = c.bodies;
          q.joints = c.joints;
          q.configurations = c.poses;
          q.positions = c.positions;
        }
        compare(device, cpu, q, name + ", " + std::to_string(K) + " configurations");
      }
    }
    EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
  }
}

// Robots with joints of every kind, one in the hand of the other, with all or some joints moving.
TEST_F(CudaDecisions, PutLinksWhereTheCpuPutsThem) {
  const auto scene = [] {
    engine::Scene s;
    s.add_box("floor", {4, 4, 0.1}, {.is_static = true, .pose = Pose{{0, 0, -0.6}}});
    engine::RobotOptions options;
    options.urdf = kEveryJoint;
    options.geometry_files.emplace();  // frames
    options.home = {{"lift", 0.7}};    // beyond its limits
    s.add_robot("one", options);
    options = at_home();
    options.parent = "one/hand";
    s.add_robot("arm", options);
    for (int i = 0; i < 6; ++i)
      s.add_hull("held" + std::to_string(i), cloud_on_sphere(20 + 9 * i, 0.15, 4),
                 {.parent = std::vector{"one/hand", "one/slide", "one/cart", "arm/flange"}[i % 4],
                  .pose = Pose{{0.1 * i, 0, 0.1}}});
    return s;
  };
  const engine::Engine device(scene(), {"cuda"}), cpu(scene(), {.backend = "cpu", .covers = engine::Covers::kOff});
  const std::vector<SceneJoint>& all = cpu.scene().joints();
  for (const bool few : {false, true}) {
    std::vector<std::uint32_t> joints;
    for (std::uint32_t j = 0; j < all.size(); ++j)
      if (!few || j % 4 == 1) joints.push_back(j);
    Random random(12);
    constexpr std::uint32_t K = 700;
    std::vector<double> positions;
    for (std::uint32_t k = 0; k < K; ++k)
      for (const std::uint32_t j : joints) {
        const double half = std::isfinite(all[j].lower) ? 0.51 * (all[j].upper - all[j].lower) : 3;
        positions.push_back((std::isfinite(all[j].lower) ? 0.5 * (all[j].upper + all[j].lower) : 0) +
                            random.uniform(-half, half));
      }
    positions[3 * joints.size() + 1] = 2e6;
    for (const Reduce reduce : {Reduce::kNone, Reduce::kNearest, Reduce::kMin, Reduce::kWithin, Reduce::kAny}) {
      QueryView q;
      q.fields = kAllFields;
      q.reduce = reduce;
      q.joints = joints;
      q.positions = positions;
      q.configuration_count = K;
      if (reduce == Reduce::kWithin) q.max_distance = 0.05;
      const Answer rows = evaluate(device, q), expected = evaluate(cpu, q);
      EXPECT_EQ(rows.info.backend, "cuda");
      expect_same(rows, expected, "reduce " + std::to_string(int(reduce)), reduce != Reduce::kNone);
    }
  }
  EXPECT_EQ(counter(device, "cuda.queries_on_cpu"), 0u);
}

}  // namespace
}  // namespace clearance::test
