// Distances at seven tolerances, in states and scenes that no other test has: true intervals, no wider than requested,
// and less work the wider they may be.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "tests/engine/decision/least_distances.h"

namespace clearance::test {
namespace {

constexpr int kStates = 150;
/// Each needs at most the work of those before it, but the last one, which is relative.
constexpr Tolerance kTolerances[] = {{0, 1e-6},    {1e-6, 1e-6}, {1e-4, 1e-6}, {1e-3, 1e-6},
                                     {1e-2, 1e-6}, {5e-2, 1e-6}, {0, 0.1}};

/// States of the arm, a third of them near one another.
ArmStates kept_back(const engine::Scene& scene, Reduce reduce) {
  ArmStates s = least_distances(scene, kStates);
  Random random(1977);
  for (std::size_t i = 0; i < s.positions.size(); ++i) {
    const SceneJoint& joint = scene.joints()[s.joints[i % s.joints.size()]];
    const bool is_near = i >= s.joints.size() && i / s.joints.size() % 3 == 0;
    const double at = random.uniform(joint.lower, joint.upper);
    s.positions[i] = is_near ? 0.9 * s.positions[i - s.joints.size()] + 0.1 * at : at;
  }
  s.query.reduce = reduce;
  return s;
}

std::uint64_t work_of(const engine::Engine& engine, QueryView query, const Tolerance& tolerance) {
  query.abs_tol = tolerance.abs;
  query.rel_tol = tolerance.rel;
  std::uint64_t units = 0;
  for (int run = 0; run < 2; ++run) {  // covers answer from the second time on
    const Answer answer = empty_answer(engine, query);
    Job job = engine.start(query, answer.view);
    while (!job.advance()) {
    }
    units = job.units();
  }
  return units;
}

/// \param least_gain of the work at 5 cm, compared with that at 1e-6
void judge(const engine::Engine& engine, const Answer& exact, const QueryView& query, const std::string& name,
           double least_gain) {
  SCOPED_TRACE(name);
  std::vector<std::uint64_t> work;
  for (const Tolerance& tolerance : kTolerances) {
    SCOPED_TRACE(tolerance.abs);
    const Answer rows = bounds_of(engine, query, tolerance);
    EXPECT_GT(expect_true_rows(exact, rows, tolerance, exact.size.rows), kStates / 4);
    work.push_back(work_of(engine, query, tolerance));
  }
  EXPECT_LE(static_cast<double>(work[1]), 1.03 * static_cast<double>(work[0]));  // the same search, nearly
  for (std::size_t i = 2; i + 1 < work.size(); ++i) EXPECT_LE(work[i], work[i - 1]) << kTolerances[i].abs;
  EXPECT_LE(work.back(), work.front()) << "a tenth";
  EXPECT_GE(static_cast<double>(work[0]), least_gain * static_cast<double>(work[5]));
  std::printf("%s: %.1f times less work at 1 cm, %.1f at 5 cm\n", name.c_str(),
              static_cast<double>(work[0]) / static_cast<double>(work[4]),
              static_cast<double>(work[0]) / static_cast<double>(work[5]));
}

/// The crowded scene, in which the palm carries a scanned box.
engine::Scene with_carried_cloud() {
  engine::Scene scene = crowded_scene();
  Random random(78);
  scene.add_points("seen", scanned_box({0, 0.1, 0}, {0.05, 0.04, 0.1}, 1500, random), 0,
                   {.radius = 0.004, .parent = "arm/palm", .pose = Pose{{0, 0, 0.15}}});
  for (const char* link : {"arm/wrist", "arm/palm", "arm/flange", "arm/left_finger", "arm/right_finger", "held"})
    scene.ignore("seen", link);
  return scene;
}

void judge_scene(const engine::Scene& scene, const CoverEngines& engines, const std::string& name, double least_gain) {
  const SameCovers engine(scene, engines);
  for (const auto& [reduce, kind] :
       {std::pair{Reduce::kMin, "min"}, {Reduce::kNearest, "nearest"}, {Reduce::kNone, "rows"}}) {
    const ArmStates s = kept_back(scene, reduce);
    const Answer exact = bounds_of(engine.without, s.query, {0, 1e-12});
    judge(engine.with, exact, s.query, name + ", " + kind, least_gain);
    judge(engine.without, exact, s.query, name + ", " + kind + ", without covers", 0.9);
  }
}

/// Pairs of one body and all obstacles.
std::vector<BodyPair> pairs_of(const engine::Scene& scene, const std::string& name) {
  std::vector<BodyPair> pairs;
  const std::uint32_t body = scene.find_body(name);
  for (std::uint32_t b = 0; b < scene.bodies().size(); ++b)
    if (scene.bodies()[b].is_static && scene.bodies()[b].robot == kNone && !scene.bodies()[b].parts.empty())
      pairs.push_back({std::min(b, body), std::max(b, body)});
  return pairs;
}

void judge_pairs_of_a_cloud(const CoverEngines& engines) {
  const engine::Scene scene = with_carried_cloud();
  const SameCovers engine(scene, engines);
  const std::vector<BodyPair> pairs = pairs_of(scene, "seen");
  ArmStates s = kept_back(scene, Reduce::kMin);
  s.query.all_pairs = false;
  s.query.pairs = pairs;
  judge(engine.with, bounds_of(engine.without, s.query, {0, 1e-12}), s.query, "carried cloud", 8);
}

// Pairs of links that stay have the same bounds in each state.
void judge_pairs_that_stay(const CoverEngines& engines) {
  const engine::Scene scene = crowded_scene(false);
  const SameCovers engine(scene, engines);
  std::vector<BodyPair> pairs = pairs_of(scene, "arm/base");
  const std::size_t still = pairs.size();
  for (const char* link : {"arm/upper", "arm/fore", "arm/palm", "held"})
    for (const BodyPair& pair : pairs_of(scene, link)) pairs.push_back(pair);
  for (const Reduce reduce : {Reduce::kMin, Reduce::kNearest}) {
    ArmStates s = kept_back(scene, reduce);
    s.query.all_pairs = false;
    s.query.pairs = pairs;
    const Answer exact = bounds_of(engine.without, s.query, {0, 1e-12});
    judge(engine.with, exact, s.query, "with pairs that stay", 4.5);
    expect_same_rows(bounds_of(engine.without, s.query, {0, 1e-6}), 0, bounds_of(engine.with, s.query, {0, 1e-6}),
                     exact.size.rows);
    std::uint64_t nearest = 0;
    for (std::uint64_t k = 0; k < exact.size.rows && reduce == Reduce::kMin; ++k)
      nearest += std::find(pairs.begin(), pairs.begin() + still, exact.view.pair[k]) < pairs.begin() + still;
    if (reduce == Reduce::kMin) {
      EXPECT_GT(nearest, 10u) << "a pair that stays is the nearest";
      EXPECT_LT(nearest, exact.size.rows - 10);
    }
  }
}

// In one process: the covers take seconds.
TEST(Tolerances, AreKeptInStatesKeptBack) {
  ::setenv("CLEARANCE_CACHE", "off", 1);
  const CoverEngines engines;
  ASSERT_TRUE(engines.with.wait_covers(kCoversPatience));
  judge_scene(crowded_scene(false), engines, "hulls", 1.7);
  judge_scene(with_carried_cloud(), engines, "surfaces and clouds", 2);
  judge_pairs_of_a_cloud(engines);
  judge_pairs_that_stay(engines);
}

}  // namespace
}  // namespace clearance::test
