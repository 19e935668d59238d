// Kernels with uncertain bodies (engine/cuda/pair/slack.cuh), emulated on the host: the slack of each pair in each
// configuration, and dense rows, must have the CPU's bits. No GPU needed.
#include "engine/device/query/device_movers.h"
#include "engine/selection/body_poses.h"
#include "engine/selection/configuration_poses.h"
#include "tests/engine/cuda/uncertain_scene.h"
// After all other headers.
#include "tests/engine/cuda/emulated_chunk.h"

namespace clearance::test {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

bool same_slack(const Slack& a, const Slack& b) {
  return same_bits(a.inner, b.inner) && same_bits(a.outer, b.outer);
}

// Over all bodies and pairs of a query, in all its configurations.
struct Comparison {
  std::uint64_t uncertain = 0, between_links = 0, grown = 0;

  void run(const engine::Scene& scene, const QueryView& q) {
    const HullArrays hulls(scene, kMostShared);
    const HostBodies bodies(scene, hulls.view(), q, true);
    const Plan& plan = bodies.plan;
    ASSERT_TRUE(bodies.uncertain);
    ChunkView view{};
    view.bodies = bodies.view;
    view.hulls = hulls.view();
    view.configurations = static_cast<std::uint32_t>(plan.size.configurations);
    const std::vector<PairRef> refs = bodies.refs();
    BodyPoses placement(scene, plan, {});
    ConfigurationPoses poses(plan);
    std::vector<Mat3d> rotations(plan.bodies.size());
    for (std::uint32_t k = 0; k < view.configurations; ++k) {
      const ConfigurationPoses::PoseBlock given = poses.at(k, 1);
      rotations_of(given.poses, rotations);
      placement.configure(k, given, rotations);
      for (std::uint32_t slot = 0; slot < plan.moved.size(); ++slot) compare_body(scene, view, placement, slot, k);
      for (std::size_t p = 0; p < refs.size(); ++p) {
        const BodyPair pair = plan.pairs.at(p);
        if (placement[pair.a].status != Status::kOk || placement[pair.b].status != Status::kOk) continue;
        const Slack cpu = pair_slack(placement, pair), device = pair_slack(view, refs[p], k);
        EXPECT_TRUE(same_slack(cpu, device)) << "configuration " << k << ", pair " << p;
        uncertain += cpu.any();
        between_links += joints_between(placement.uncertainty(pair.a), placement.uncertainty(pair.b)) < kNoLimit;
      }
    }
  }

 private:
  void compare_body(const engine::Scene& scene, const ChunkView& view, const BodyPoses& placement, std::uint32_t slot,
                    std::uint32_t k) {
    const std::uint32_t body = view.bodies.moved_body[slot];
    const BodyPoseRef at(view.bodies, view.configurations, slot | kMovedBit, k);
    const std::string what = scene.bodies()[body].name + " in configuration " + std::to_string(k);
    ASSERT_EQ(at.status(), placement[body].status) << what;
    if (at.status() != Status::kOk) return;
    const PoseUncertainty& cpu = placement.uncertainty(body);
    const BodySlack& device = slack_of(view, slot | kMovedBit, k);
    EXPECT_TRUE(same_slack(device.all, cpu.slack)) << what;
    EXPECT_TRUE(same_slack(device.relative, cpu.relative)) << what;
    EXPECT_TRUE(same_bits(device.travel, cpu.link.travel)) << what;
    if (view.hulls.of_body[body] == kNone || scene.bodies()[body].parts.empty()) return;
    const Aabb expected = placement.box(body), box = at.box();
    for (int i = 0; i < 3; ++i)
      EXPECT_TRUE(same_bits(box.low[i], expected.low[i]) && same_bits(box.high[i], expected.high[i])) << what;
    grown += cpu.slack.inner > 0;
  }
};

TEST(SlackKernels, KnowWhatTheCpuKnowsOfEachPair) {
  UncertainCase c(25, 3, true);
  Comparison all;
  all.run(c.scene, c.q);
  EXPECT_GT(all.uncertain, 25u * 60);
  EXPECT_GT(all.between_links, 25u * 10) << "links of one robot, whose base counts for neither";
  EXPECT_GT(all.grown, 25u * 5);
  // Invalid poses, also of parents.
  c.poses[2].qw = c.poses[2].qx = c.poses[2].qy = c.poses[2].qz = 0;
  c.poses[c.bodies.size()].translation.y = std::numeric_limits<double>::quiet_NaN();
  c.positions[c.joints.size() * 3] = std::numeric_limits<double>::quiet_NaN();
  Comparison bad;
  bad.run(c.scene, c.q);
  EXPECT_LT(bad.grown, all.grown);
  // Of joints alone, and of bodies alone: the parents of the others are then fixed, and have an age.
  for (const bool by_joints : {true, false}) {
    UncertainCase part(10, 4, true);
    by_joints ? part.bodies.clear() : part.joints.clear();
    by_joints ? part.poses.clear() : part.positions.clear();
    part.point();
    Comparison some;
    some.run(part.scene, part.q);
    EXPECT_GT(some.uncertain, 10u * 60);
  }
}

// Groups of a chunk whose pairs of single convex parts come first, as on a device.
struct Split {
  Group singles{kNone, kNone, 0, 0, 0}, several = singles;

  explicit Split(HostChunk& chunk) {
    const auto is_single = [&](std::uint32_t p) {
      const PairRef ref = chunk.bodies.refs()[p];
      return !has_several(chunk.view.hulls, body_of(chunk.view.bodies, ref.a), body_of(chunk.view.bodies, ref.b));
    };
    const auto middle = std::stable_partition(chunk.position.begin(), chunk.position.end(), is_single);
    const std::vector<PairRef> refs = chunk.bodies.refs();
    for (std::size_t i = 0; i < refs.size(); ++i) chunk.pairs[i] = refs[chunk.position[i]];
    singles.count = several.first = static_cast<std::uint32_t>(middle - chunk.position.begin());
    several.count = static_cast<std::uint32_t>(refs.size()) - several.first;
  }
};

std::uint32_t tiles_of(const Group& group, const HostChunk& chunk) {
  return (group.count * chunk.view.configurations + kTile - 1) / kTile;
}

// Answers a query, and expects the rows of the CPU.
// \returns number of rows by status and flag
struct Seen {
  std::uint64_t slack = 0, contact = 0, overlap = 0, beyond = 0, left = 0, beyond_limits = 0;
};
template <bool kF32>
Seen expect_rows_of_the_cpu(const engine::Engine& cpu, const QueryView& q, const std::string& what) {
  HostChunk chunk(cpu, q);
  chunk.view.pair_limits.cull = q.max_distance < kNoLimit;
  chunk.view.prove_at_once = true;
  chunk.view.enclosed = nullptr;
  const Split split(chunk);
  EXPECT_GT(split.several.count, 10u);
  EXPECT_LT(chunk.bodies.placed.size(), chunk.bodies.plan.moved.size()) << "frames are not placed";
  chunk.launch(tiles_of(split.several, chunk), [&] { answer_several<kF32>(chunk.view, split.several); });
  chunk.launch_last(tiles_of(split.singles, chunk),
                    [&](const ChunkView& view) { answer_ungrouped<kF32, false, Slack>(view, split.singles); });
  chunk.expect_the_cpus(cpu, q, what, 0.2);
  Seen seen;
  seen.left = chunk.host_counts[kRest];
  for (std::size_t row = 0; row < chunk.rest.size(); ++row) {
    const auto status = static_cast<Status>(chunk.rows.view.status[row]);
    seen.slack += (chunk.rows.view.flags[row] & kFlagUncertaintyLimited) != 0;
    seen.beyond_limits += (chunk.rows.view.flags[row] & kFlagBeyondLimits) != 0;
    seen.contact += status == Status::kContact;
    seen.overlap += status == Status::kOverlap;
    seen.beyond += status == Status::kBeyond;
  }
  return seen;
}

TEST(SlackKernels, DenseRowsHaveTheBitsOfTheCpu) {
  UncertainCase c(50, 7);
  c.poses[3].translation.y = std::numeric_limits<double>::quiet_NaN();
  c.positions[c.joints.size() * 7] = 3;  // beyond its limits
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  const Seen all = expect_rows_of_the_cpu<false>(cpu, c.q, "float64");
  EXPECT_GT(all.slack, 500u);
  EXPECT_GT(all.contact, 50u) << "slack alone makes them touch";
  EXPECT_GT(all.overlap, 500u);
  EXPECT_GT(all.beyond_limits, 50u) << "what a joint beyond its limits moves";
  for (const double distance : {0.0, 0.05, 0.3}) {
    c.q.max_distance = distance;
    EXPECT_GT(expect_rows_of_the_cpu<false>(cpu, c.q, "near " + std::to_string(distance)).beyond, 500u);
  }
  c.q.precision = Precision::kF32;
  EXPECT_GT(expect_rows_of_the_cpu<true>(cpu, c.q, "float32, near").beyond, 500u);
  c.q.max_distance = kNoLimit;
  EXPECT_GT(expect_rows_of_the_cpu<true>(cpu, c.q, "float32").slack, 500u);
}

// The column gradient_joints: of joints, one of them fixed, on a robot that a body carries, and of bodies that follow
// links.
TEST(SlackKernels, DifferentiateByJointsAsTheCpuDoes) {
  UncertainCase c(40, 7);
  c.poses[3].translation.y = std::numeric_limits<double>::quiet_NaN();
  c.positions[c.joints.size() * 7] = 3;  // beyond its limits
  c.q.fields = kAllFields | kFieldGradientJoints;
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  for (const double distance : {kNoLimit, 0.1}) {
    c.q.max_distance = distance;
    HostChunk chunk(cpu, c.q);
    const JointGradient gradient(cpu.scene(), chunk.bodies.plan);
    const cuda::DeviceMovers movers(gradient, chunk.bodies.plan);
    chunk.view.movers = {movers.setup().movers.data(), movers.setup().of_body.data()};
    chunk.view.pair_limits.cull = distance < kNoLimit;
    chunk.view.prove_at_once = true;
    EXPECT_EQ(chunk.bodies.placed.size(), chunk.bodies.plan.moved.size()) << "joint columns read frames";
    const Split split(chunk);
    chunk.launch(tiles_of(split.several, chunk), [&] { answer_several<false>(chunk.view, split.several); });
    chunk.launch_last(tiles_of(split.singles, chunk),
                      [&](const ChunkView& view) { answer_ungrouped<false, false, Slack>(view, split.singles); });
    chunk.expect_the_cpus(cpu, c.q, "within " + std::to_string(distance), 0.2);
    std::uint64_t slopes = 0, none = 0;
    for (std::size_t i = 0; i < chunk.rest.size() * c.joints.size(); ++i) {
      const double slope = chunk.rows.view.gradient_joints[i];
      slopes += std::abs(slope) > 1e-3;
      none += std::isnan(slope);
    }
    EXPECT_GT(slopes, 500u);
    EXPECT_GT(none, c.joints.size() * 10) << "bad poses, and what is beyond";
  }
}

// A box that overlaps, or may overlap, the prism around a can by about the excess of the prism.
struct CanCase {
  engine::Scene scene;
  std::vector<Pose> poses;
  const std::vector<std::uint32_t> bodies{1};
  const std::vector<BodyPair> pairs{{0, 1}};
  QueryView q;

  CanCase() {
    Random random(2);
    const double excess = 1e-3;
    add_prism(scene, "can", 0.8, 1, {.is_static = true, .pose = Pose()});
    scene.add_box("box", {1, 1, 0.5}, {});
    const double corner = 0.8 / std::cos(M_PI / 64);  // of the prism, outside of the cylinder
    EXPECT_GT(corner - 0.8, excess / 2);
    for (int k = 0; k < 300; ++k) {
      const double turn = random.uniform(-3, 3), deep = random.uniform(-excess, 3 * excess), out = 0.8 + 0.5 - deep;
      poses.push_back({{out * std::cos(turn), out * std::sin(turn), random.uniform(0, 0.1)},
                       std::cos(turn / 2),
                       0,
                       0,
                       std::sin(turn / 2)});
    }
    q.all_pairs = false;
    q.pairs = pairs;
    q.bodies = bodies;
    q.configurations = poses;
    q.configuration_count = 300;
    q.fields = kAllFields;
  }
};

// Convex parts that overlap by less than `outer` prove nothing about the exact bodies; an overlap by more does.
TEST(SlackKernels, OverlapsAreProvedByMoreThanTheUncertainty) {
  CanCase c;
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  HostChunk chunk(cpu, c.q);
  ASSERT_TRUE(chunk.bodies.uncertain);
  chunk.view.prove_at_once = true;
  const Group all{kNone, kNone, 0, 1, 0};
  chunk.launch_last(tiles_of(all, chunk),
                    [&](const ChunkView& view) { answer_ungrouped<false, false, Slack>(view, all); });
  std::set<std::uint32_t> left(chunk.rest.begin(), chunk.rest.begin() + chunk.host_counts[kRest]);
  std::uint64_t proved = 0, shallow = 0;
  const Answer expected = evaluate(cpu, c.q);
  for (std::uint32_t k = 0; k < 300; ++k) {
    const bool overlaps = static_cast<Status>(expected.view.status[k]) == Status::kOverlap;
    if (left.contains(k)) {
      shallow += !overlaps;
    } else {
      EXPECT_EQ(chunk.rows.view.status[k], expected.view.status[k]) << k;
      proved += overlaps;
    }
  }
  EXPECT_GT(proved, 50u);
  EXPECT_GT(shallow, 10u) << "the CPU has to say that these are contacts";
  chunk.expect_the_cpus(cpu, c.q, "a can", 0.7);
}

// Rows that no CPU finishes have bounds that contain the CPU's distances, including slack.
TEST(SlackKernels, RowsThatRemainUnfinishedHaveBoundsThatHold) {
  CanCase c;
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  HostChunk chunk(cpu, c.q);
  chunk.view.prove_at_once = true;
  const Group all{kNone, kNone, 0, 1, 0};
  chunk.launch(tiles_of(all, chunk), [&] { answer_ungrouped<false, false, Slack>(chunk.view, all); });
  const std::set<std::uint32_t> left(chunk.rest.begin(), chunk.rest.begin() + chunk.counts[kRest]);
  chunk.launch(3, [&] { answer_open_rows(chunk.view, chunk.pairs.data(), 5); });
  const Answer expected = evaluate(cpu, c.q);
  std::uint64_t kept_apart = 0;
  for (const std::uint32_t row : left) {
    const ReplyView &got = chunk.rows.view, &exact = expected.view;
    // The CPU's bounds are within its tolerance of the best possible ones; slack is included in both.
    EXPECT_LE(got.lower[row], exact.lower[row] + 1e-9) << row;
    EXPECT_GE(got.upper[row], exact.upper[row] - 1e-9) << row;
    EXPECT_LE(got.upper[row], exact.upper[row] + 1e-2) << row;
    kept_apart += exact.upper[row] > 1e-6;
  }
  EXPECT_GT(kept_apart, 10u) << "pieces that touch, of bodies that may not";
}

}  // namespace
}  // namespace clearance::test
