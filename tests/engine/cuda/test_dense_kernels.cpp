// The kernels of dense queries (engine/cuda/dense/group_kernel.cuh), compiled for the host: their rows must have the
// CPU's bits. No GPU needed.
#include "tests/engine/cuda/emulated_chunk.h"

namespace clearance::test {
namespace {

constexpr std::uint32_t kFewBlocks = 2;  // fewer threads than pairs, so each takes several

// Many of its pairs overlap, and some have a hull that is too large for float32.
struct Case : EmulatedCase {
  static constexpr std::uint32_t kConfigurations = 160;  // more than a tile

  explicit Case(Precision precision, std::uint32_t configurations = kConfigurations)
      : EmulatedCase(12, configurations, 1.2, 5,
                     [](engine::Scene& to, const std::string& name, const engine::Scene::BodyOptions& options) {
                       to.add_hull(name, cloud_on_sphere(150, 0.4, 9), options);
                     }) {
    poses[3].translation.y = std::numeric_limits<double>::quiet_NaN();
    q.precision = precision;
  }
};

TEST(DenseKernels, GroupsThenProofsGiveTheBitsOfTheCpu) {
  Case c(Precision::kF64);
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  HostChunk chunk(cpu, c.q);
  chunk.launch(static_cast<std::uint32_t>(chunk.group_of_tile.size()), [&] { answer_groups<double>(chunk.view); });
  ASSERT_GT(chunk.counts[kEnclosedPairs], kFewBlocks * kTile) << "more than there are threads";
  chunk.launch_last(kFewBlocks, [](const ChunkView& view) { prove_overlaps(view, 5); });
  chunk.expect_the_cpus(cpu, c.q, "groups");
}

TEST(DenseKernels, StraysThatProveAtOnceGiveTheBitsOfTheCpu) {
  Case c(Precision::kF64);
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  HostChunk chunk(cpu, c.q);
  chunk.view.prove_at_once = true;
  chunk.view.enclosed = nullptr;
  const Group ungrouped{kNone, kNone, 0, static_cast<std::uint32_t>(chunk.pairs.size()), 0};
  const auto tiles = static_cast<std::uint32_t>((chunk.rest.size() + kTile - 1) / kTile);
  chunk.launch_last(tiles, [&](const ChunkView& view) { answer_ungrouped<false, false>(view, ungrouped); });
  chunk.expect_the_cpus(cpu, c.q, "strays");
}

TEST(DenseKernels, Float32ThenFloat64GiveTheBitsOfTheCpu) {
  Case c(Precision::kF32);
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  HostChunk chunk(cpu, c.q);
  const auto tiles = static_cast<std::uint32_t>(chunk.group_of_tile.size());
  chunk.launch(tiles, [&] { answer_groups<float>(chunk.view); });
  ASSERT_GT(chunk.counts[kLeftOpen], kFewBlocks * kTile) << "more than there are threads";
  ASSERT_GT(chunk.counts[kConvergedRows], 100u);
  chunk.launch(tiles, [&] { answer_groups<double>(chunk.view); });  // for the other hulls
  chunk.view.prove_at_once = true;
  chunk.launch(kFewBlocks, [&] { answer_open<false>(chunk.view, 5); });
  chunk.launch_last(kFewBlocks, [](const ChunkView& view) { prove_overlaps(view, 5); });
  chunk.expect_the_cpus(cpu, c.q, "float32");
}

// A warp per overlapping pair; few pairs are left to the CPU.
TEST(DenseKernels, DepthsGiveTheBitsOfTheCpu) {
  for (const double rel_tol : {1e-6, 0.05})
    for (const std::uint32_t fields : {kAllFields | 0u, kFloat32 | kFieldStatus}) {
      Case c(Precision::kF64, 8);
      c.q.signed_distance = true;
      c.q.fields = fields;
      c.q.rel_tol = rel_tol;
      const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
      HostChunk chunk(cpu, c.q);
      chunk.view.pair_limits.rel_tol = rel_tol;
      chunk.launch(static_cast<std::uint32_t>(chunk.group_of_tile.size()), [&] { answer_groups<double>(chunk.view); });
      const std::uint32_t enclosed = chunk.counts[kEnclosedPairs], left_before = chunk.counts[kRest];
      ASSERT_GT(enclosed, 4 * kFewBlocks * kDepthWarps) << "more than there are warps";
      chunk.launch_last(kFewBlocks, [](const ChunkView& view) { prove_depths(view); }, kDepthThreads);
      EXPECT_LT((chunk.host_counts[kRest] - left_before) * 20, enclosed) << "left to the CPU";
      chunk.expect_the_cpus(cpu, c.q, "depths");
    }
}

// Kernels that answer_chunk() launches for columns that need only bounds or float32 columns.
void expect_lean_rows(Case& c, std::uint32_t fields, const std::string& what) {
  ASSERT_EQ(fields & ~kLeanFields, 0u);
  const bool points = (fields & kFieldPoints32) != 0, f32 = c.q.precision == Precision::kF32;
  c.q.fields = fields;
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  HostChunk chunk(cpu, c.q);
  chunk.view.pair_limits.cull = c.q.max_distance < std::numeric_limits<double>::infinity();
  const auto tiles = static_cast<std::uint32_t>(chunk.group_of_tile.size());
  if (f32) {
    chunk.launch(tiles, [&] { points ? answer_lean<float, true>(chunk.view) : answer_lean<float, false>(chunk.view); });
    ASSERT_GT(chunk.counts[kLeftOpen], 0u) << what;
  }
  chunk.launch(tiles, [&] { points ? answer_lean<double, true>(chunk.view) : answer_lean<double, false>(chunk.view); });
  ASSERT_GT(chunk.counts[kConvergedRows], 30u) << what;
  if (f32) {
    chunk.view.prove_at_once = true;
    chunk.launch(kFewBlocks, [&] { answer_open<true>(chunk.view, 5); });
  } else {
    ASSERT_GT(chunk.counts[kEnclosedPairs], 0u) << what;
  }
  chunk.launch_last(kFewBlocks, [](const ChunkView& view) { prove_overlaps(view, 5); });
  chunk.expect_the_cpus(cpu, c.q, what);
}

constexpr std::uint32_t kBounds = kDefaultFields | kFieldPair | kFieldConfiguration;

TEST(DenseKernels, LeanOnesGiveTheBitsOfTheCpu) {
  for (const Precision precision : {Precision::kF64, Precision::kF32})
    for (const std::uint32_t fields : {kBounds, kFieldBounds | 0u, kFloat32 | kFieldStatus, kFieldPoints32 | 0u}) {
      Case c(precision);
      expect_lean_rows(c, fields,
                       (precision == Precision::kF32 ? "float32, fields " : "fields ") + std::to_string(fields));
    }
}

TEST(DenseKernels, LeanOnesLeaveOutPairsWhoseBoxesAreFar) {
  for (const std::uint32_t fields : {kBounds, kFloat32}) {
    Case c(Precision::kF64);
    c.q.max_distance = 0.2;
    expect_lean_rows(c, fields, "near, fields " + std::to_string(fields));
  }
}

// Contiguous poses are read 16 bytes at a time.
TEST(DenseKernels, LeanOnesOfOneConfigurationGiveTheBitsOfTheCpu) {
  for (const std::uint32_t fields : {kBounds, kFloat32}) {
    Case c(Precision::kF64, 1);
    expect_lean_rows(c, fields, "one configuration, fields " + std::to_string(fields));
  }
}

// Bodies that touch, that overlap by less than their radii, and that are beyond the distance limit: pairs left to the
// CPU.
struct TouchingCase {
  static constexpr std::uint32_t kConfigurations = 96;
  engine::Scene scene;
  std::vector<std::uint32_t> bodies;
  std::vector<BodyPair> pairs;
  std::vector<Pose> poses;
  QueryView q;

  TouchingCase() {
    Random random(11);
    scene.add_box("box", {1, 1, 1}, {.is_static = true, .pose = Pose()});
    scene.add_sphere("ball", 0.5, {.is_static = true, .pose = Pose{{5, 0, 0}}});
    scene.add_box("other box", {1, 2, 0.5}, {});
    scene.add_sphere("other ball", 0.25, {});
    scene.add_capsule("capsule", 0.1, 0.8, {});
    bodies = {2, 3, 4};
    pairs = {{0, 2}, {3, 0}, {1, 3}, {4, 0}, {1, 4}};
    for (std::uint32_t k = 0; k < kConfigurations; ++k) {
      const double turn = random.uniform(-3, 3), depth = 0.24 * random.uniform(-0.02, 1);
      poses.push_back({{1, 0, 0}, std::cos(turn / 2), std::sin(turn / 2), 0, 0});  // face to face
      poses.push_back({{5 - 0.75 + depth, 0, 0}});
      poses.push_back({{0.5 + 0.1 - 0.3 * depth, 0, 0}, std::cos(turn / 2), std::sin(turn / 2), 0, 0});
    }
    q.all_pairs = false;
    q.fields = kAllFields;
    q.configuration_count = kConfigurations;
    q.pairs = pairs;
    q.bodies = bodies;
    q.configurations = poses;
  }
};

TEST(DenseKernels, RowsThatRemainUnfinishedHaveBoundsThatHold) {
  TouchingCase c;
  const engine::Engine reference(std::move(c.scene), {"reference"});
  HostChunk chunk(reference, c.q);
  chunk.launch(static_cast<std::uint32_t>(chunk.group_of_tile.size()), [&] { answer_groups<double>(chunk.view); });
  chunk.launch(kFewBlocks, [&] { prove_overlaps(chunk.view, 5); });
  const std::set<std::uint32_t> left(chunk.rest.begin(), chunk.rest.begin() + chunk.counts[kRest]);
  ASSERT_GT(left.size(), kFewBlocks * kTile / 4u) << "more than these threads have warps";
  chunk.launch(kFewBlocks, [&] { answer_open_rows(chunk.view, chunk.pairs.data(), 5); });
  const Answer expected = evaluate(reference, c.q);
  std::set<Status> seen;
  for (const std::uint32_t row : left) {
    const ReplyView &got = chunk.rows.view, &exact = expected.view;
    EXPECT_LE(got.lower[row], exact.upper[row]) << row;
    EXPECT_GE(got.upper[row], exact.lower[row]) << row;
    EXPECT_TRUE(got.lower[row] >= 0 && got.upper[row] < 1e-9 + 3 * std::max(exact.upper[row], 0.0)) << row;
    const Vec3d a{got.point_a[3 * row], got.point_a[3 * row + 1], got.point_a[3 * row + 2]},
        b{got.point_b[3 * row], got.point_b[3 * row + 1], got.point_b[3 * row + 2]};
    EXPECT_LE(norm(a - b), got.upper[row] + 1e-12) << row;
    EXPECT_EQ(got.pair[row], exact.pair[row]) << row;
    seen.insert(static_cast<Status>(got.status[row]));
  }
  EXPECT_TRUE(seen.contains(Status::kOverlap)) << "rounded bodies";
  EXPECT_TRUE(seen.contains(Status::kContact)) << "face to face";
}

}  // namespace
}  // namespace clearance::test
