// The kernel that decides configurations (engine/cuda/reduce/decide_kernel.cuh), compiled for the host: its rows must
// have the CPU's bits. No GPU needed.
#include "tests/engine/cuda/emulated_scene.h"

#define cuda emulated
#include "engine/cuda/reduce/decide_kernel.cuh"
#undef cuda

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kThreads = 16;  // of a team

// The kernel's results for a query.
struct Decided {
  Answer rows;
  std::vector<std::uint8_t> answered;              // (K,)
  std::vector<std::vector<std::uint32_t>> listed;  // pairs of each configuration, ascending
  std::uint32_t looks = 0;
};

Decided decide(const engine::Engine& engine, const QueryView& q) {
  const std::uint32_t K = q.configuration_count, P = static_cast<std::uint32_t>(q.pairs.size());
  const HullArrays hulls(engine.scene(), kMostShared);
  const HostBodies bodies(engine.scene(), hulls.view(), q);
  const std::vector<PairRef> pairs = bodies.refs();
  Decided d;
  d.rows = empty_answer(engine, q);
  d.rows.info.rows = d.rows.info.total = K;
  d.answered.assign(K, 2);
  std::vector<std::uint64_t> keys(5 * K);
  std::vector<std::uint32_t> unusable(K, kNoPair);
  std::vector<PairAnswer> answers(std::max(K, K * P));
  std::vector<std::uint32_t> items(K * P);
  std::uint32_t counts[kCounts] = {}, host_counts[kCounts] = {};
  ReducedView r{};
  r.chunk.hulls = hulls.view();
  r.chunk.bodies = bodies.view;
  r.chunk.pair_limits = {
      q.max_distance, q.abs_tol, q.rel_tol < 0 ? default_rel_tol(q.precision) : q.rel_tol, 256, true, true, true, true,
      false,          false};
  r.chunk.pairs = pairs.data();
  r.chunk.pair_count = P;
  r.chunk.configurations = K;
  r.chunk.reply = d.rows.view;
  r.chunk.counts = counts;
  r.chunk.host_counts = host_counts;
  r.chunk.blocks = (K * kThreads + kDecideThreads - 1) / kDecideThreads;
  r.reduce = Reduce::kMin;
  r.groups = 1;
  r.rows = K * P;
  r.seed = keys.data();
  r.unusable = unusable.data();
  r.answered = d.answered.data();
  r.items = items.data();
  r.answers = answers.data();
  r.capacity = K * P;
  EmulatedGrid::one().launch(r.chunk.blocks, kDecideThreads, [&] { decide_configurations<kThreads>(r); });
  EXPECT_TRUE(std::all_of(counts, counts + kCounts, [](std::uint32_t c) { return c == 0; }))
      << "left for the next chunk";
  d.looks = host_counts[kConvergedRows];
  d.listed.resize(K);
  for (std::uint32_t i = 0; i < host_counts[kCandidates]; ++i) d.listed[items[i] / P].push_back(items[i] % P);
  for (auto& of_one : d.listed) std::sort(of_one.begin(), of_one.end());
  return d;
}

// Includes capsules, which touch without overlapping cores.
struct Case : EmulatedCase {
  Case(double room, std::uint32_t configurations)
      : EmulatedCase(24, configurations, room, 3,
                     [](engine::Scene& to, const std::string& name, const engine::Scene::BodyOptions& options) {
                       to.add_capsule(name, 0.2, 0.5, options);
                     }) {
    q.reduce = Reduce::kMin;
  }
  void step() {
    for (Pose& p : poses) p.translation.x += 0.004, p.qz += 0.003;
  }
};

// Expects the CPU's values in answered rows.
// \returns number of answered rows
std::size_t expect_the_cpus_rows(const engine::Engine& cpu, const QueryView& q, const Decided& d,
                                 const std::string& what) {
  Answer expected = evaluate(cpu, q);
  std::size_t answered = 0;
  for (std::uint32_t k = 0; k < q.configuration_count; ++k) {
    EXPECT_LE(d.answered[k], 1) << what;
    EXPECT_EQ(d.listed[k].empty(), d.answered[k] == 1) << what << ", configuration " << k;
    answered += d.answered[k];
    if (d.answered[k]) continue;
    const auto copy = [&](auto* from, auto* to, std::size_t width) {
      std::copy_n(from + k * width, from ? width : 0, to + k * width);
    };
    for_each_column(copy, expected.view, d.rows.view);  // excluded from the comparison
  }
  expect_same(d.rows, expected, what, true);
  return answered;
}

TEST(DecideKernel, GivesTheBitsOfTheCpu) {
  for (const double room : {1.0, 2.5, 8.0}) {
    Case c(room, 41);
    const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
    std::size_t answered = 0;
    const auto compare = [&](const std::string& what) {
      answered += expect_the_cpus_rows(cpu, c.q, decide(cpu, c.q), what + ", room " + std::to_string(room));
    };
    compare("all");
    c.q.rel_tol = 0.2, c.q.abs_tol = 0.01;
    compare("loose");
    c.q.rel_tol = -1, c.q.abs_tol = 0;
    for (const double distance : {0.0, 1e-9, 0.3}) {
      c.q.max_distance = distance;
      compare("near " + std::to_string(distance));
    }
    c.q.max_distance = kInf;
    EXPECT_GT(answered, 80u) << "of 205; capsules that overlap by their radius are left open";
    // Invalid poses, also in all of a configuration.
    c.poses[2].qw = c.poses[2].qx = c.poses[2].qy = c.poses[2].qz = 0;
    c.poses[0].qx *= 100;
    c.poses[3 * c.bodies.size() + 1].translation.y = std::numeric_limits<double>::quiet_NaN();
    for (std::size_t i = 0; i < c.bodies.size(); ++i) c.poses[5 * c.bodies.size() + i].qw = kInf;
    compare("bad poses");
    const std::vector<BodyPair> all = std::exchange(c.pairs, {c.pairs[0]});
    c.point();
    compare("one pair");
    c.pairs.clear();  // each several times, more than one round of boxes compares
    while (c.pairs.size() < 1200) c.pairs.push_back(all[c.pairs.size() * 7 % all.size()]);
    c.point();
    compare("many pairs");
  }
}

TEST(DecideKernel, LooksAtLittleBehindTheFirstOverlap) {
  Case c(1.0, 41);
  const engine::Engine cpu(std::move(c.scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  const Answer least = evaluate(cpu, c.q);
  ASSERT_TRUE(std::all_of(least.view.status, least.view.status + 41,
                          [](std::uint8_t s) { return s == static_cast<std::uint8_t>(Status::kOverlap); }));
  EXPECT_LT(decide(cpu, c.q).looks, 41 * 2 * kThreads) << "a second look at most";
  QueryView touching = c.q;
  touching.reduce = Reduce::kNone;
  touching.max_distance = 0;
  EXPECT_GT(evaluate(cpu, touching).info.pairs_evaluated, 41 * 4 * kThreads) << "boxes leave more";
}

// Configurations it cannot resolve stay open, with all pairs listed that may be the nearest.
TEST(DecideKernel, LeavesOpenWhatTouches) {
  engine::Scene scene;
  for (int i = 0; i < 64; ++i)
    scene.add_box("b" + std::to_string(i), {1, 1, 1},
                  {.pose = Pose{{1.0 * (i % 4), 1.0 * (i / 4 % 4), 1.0 * (i / 16)}}});
  const engine::Engine cpu(std::move(scene), {.backend = "cpu", .covers = engine::Covers::kOff});
  const std::vector<std::uint32_t> bodies{7};
  std::vector<BodyPair> pairs;
  for (std::uint32_t b = 0; b < 64; ++b)
    if (b != 7) pairs.push_back({7, b});
  Random random(14);
  std::vector<Pose> poses;
  for (int k = 0; k < 30; ++k) poses.push_back(k % 3 == 0 ? Pose{{2, 1, k % 2 ? 6 : 4.0}} : random.pose(9));
  QueryView q;
  q.all_pairs = false;
  q.pairs = pairs;
  q.bodies = bodies;
  q.configurations = poses;
  q.configuration_count = 30;
  q.fields = kAllFields;
  QueryView dense = q;
  q.reduce = Reduce::kMin;
  const Decided d = decide(cpu, q);
  const std::size_t answered = expect_the_cpus_rows(cpu, q, d, "a grid");
  EXPECT_GT(answered, 10u);
  EXPECT_LE(answered, 25u);
  const Answer all = evaluate(cpu, dense);
  for (std::uint32_t k = 0; k < 30; ++k) {
    if (d.answered[k]) continue;
    const double* lower = all.view.lower + k * pairs.size();
    const double least = *std::min_element(all.view.upper + k * pairs.size(), all.view.upper + (k + 1) * pairs.size());
    EXPECT_EQ(std::adjacent_find(d.listed[k].begin(), d.listed[k].end()), d.listed[k].end()) << "each once";
    for (std::uint32_t p = 0; p < pairs.size(); ++p) {
      EXPECT_TRUE(lower[p] > least || std::binary_search(d.listed[k].begin(), d.listed[k].end(), p))
          << "configuration " << k << ", pair " << p;
    }
  }
}

}  // namespace
}  // namespace clearance::test
