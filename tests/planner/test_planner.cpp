// The planner: paths that a prover of a known world and the engine prove free, and reasons why there are none.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/api/engine.h"
#include "planner/path_report.h"
#include "planner/planner.h"
#include "planner/samples.h"
#include "planner/state_tree.h"

namespace clearance {
namespace {

using States = std::vector<double>;

/// The plane with a wall at x = 0, which has a gap. Segments are decided exactly, in the plane's numbers.
class WallWithGap final : public EdgeProver {
 public:
  explicit WallWithGap(double gap) : gap_(gap) {}
  bool is_free(std::span<const double> ends) override {
    ++calls;
    const double x0 = ends[0], y0 = ends[1], x1 = ends[2], y1 = ends[3];
    if ((x0 < 0) == (x1 < 0) && x0 != 0 && x1 != 0) return true;
    const double y = x0 == x1 ? std::max(std::abs(y0), std::abs(y1)) : y0 + (0 - x0) / (x1 - x0) * (y1 - y0);
    return std::abs(y - 1.5) < gap_;
  }
  std::uint64_t calls = 0;

 private:
  double gap_;
};

const std::vector<JointLimits> kSquare{{-2, 2}, {-2, 2}};

void expect_proved(EdgeProver& prover, const States& path, std::size_t joints, const States& start,
                   const States& goal) {
  ASSERT_GE(path.size(), 2 * joints);
  EXPECT_TRUE(std::equal(start.begin(), start.end(), path.begin()));
  EXPECT_TRUE(std::equal(goal.begin(), goal.end(), path.end() - static_cast<std::ptrdiff_t>(joints)));
  for (std::size_t i = 0; i + 2 * joints <= path.size(); i += joints)
    EXPECT_TRUE(prover.is_free(std::span(path).subspan(i, 2 * joints))) << i;
}

double length_of(const States& path) {
  double sum = 0;
  for (std::size_t i = 0; i + 4 <= path.size(); i += 2)
    sum += std::hypot(path[i + 2] - path[i], path[i + 3] - path[i + 1]);
  return sum;
}

TEST(Planner, FindsPathsThroughAGap) {
  const States start{-1.5, -1.5}, goal{1.5, -1.5};
  for (const double gap : {0.3, 0.05})
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      WallWithGap prover(gap);
      const PathFound raw = find_path(prover, kSquare, start, goal, {.shortcuts = 0, .seed = seed});
      EXPECT_EQ(raw.edges, prover.calls);
      expect_proved(prover, raw.path, 2, start, goal);
      EXPECT_GT(raw.iterations, 0u);
      const PathFound by_small_steps = find_path(prover, kSquare, start, goal, {.range = 0.1, .seed = seed});
      expect_proved(prover, by_small_steps.path, 2, start, goal);
      const PathFound shorter = find_path(prover, kSquare, start, goal, {.shortcuts = 64, .seed = seed});
      expect_proved(prover, shorter.path, 2, start, goal);
      EXPECT_LE(length_of(shorter.path), length_of(raw.path) * (1 + 1e-12));
      EXPECT_GE(length_of(shorter.path), 2 * std::hypot(1.5, 3 - gap) - 1e-9);  // the shortest way
    }
}

TEST(Planner, GivesTheSamePathForTheSameSeed) {
  const States start{-1.5, -1.5}, goal{1.5, -1.5};
  std::vector<States> paths;
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    WallWithGap one(0.1), two(0.1);
    const PathFound a = find_path(one, kSquare, start, goal, {.seed = seed});
    const PathFound b = find_path(two, kSquare, start, goal, {.seed = seed});
    EXPECT_EQ(a.path, b.path);
    EXPECT_EQ(a.edges, b.edges);
    paths.push_back(a.path);
  }
  EXPECT_NE(paths[0], paths[1]);
}

TEST(Planner, TriesTheStraightMotionFirst) {
  WallWithGap prover(0.1);
  const PathFound found = find_path(prover, kSquare, States{1, -1}, States{1.5, 1}, {});
  EXPECT_EQ(found.path, (States{1, -1, 1.5, 1}));
  EXPECT_EQ(found.iterations, 0u);
  EXPECT_EQ(found.edges, 1u);
}

TEST(Planner, GivesUp) {
  WallWithGap closed(0);
  const PathFound found = find_path(closed, kSquare, States{-1, 0}, States{1, 0}, {.max_iterations = 50});
  EXPECT_TRUE(found.path.empty());
  EXPECT_EQ(found.iterations, 50u);
}

TEST(Planner, TriesFewMotionsThatHit) {
  WallWithGap closed(0);
  const std::vector<JointLimits> wide{{-2, 200}, {-2, 2}};  // most uniform samples are far behind the wall
  const PathFound found = find_path(closed, wide, States{-1, 0}, States{1, 0}, {.max_iterations = 2000});
  EXPECT_EQ(found.iterations, 2000u);
  EXPECT_LT(found.edges, 2400u);  // without domains 2800
}

/// Proves all motions but the first two: the straight one and the first extension.
class FreeFromTheThirdOn final : public EdgeProver {
 public:
  bool is_free(std::span<const double>) override { return ++calls_ > 2; }

 private:
  int calls_ = 0;
};

TEST(Planner, TakesFarSamplesIfAllAreFar) {
  const std::vector<JointLimits> limits(14, {-2, 2});
  FreeFromTheThirdOn prover;
  const PathFound found = find_path(prover, limits, States(14, -1.5), States(14, 1.5),
                                    {.range = 0.1, .max_iterations = 5000, .shortcuts = 0});
  EXPECT_FALSE(found.path.empty());
  EXPECT_GT(found.iterations, 100u);  // most samples were left out
}

TEST(Planner, SamplesJointsWithoutLimits) {
  const double none = std::numeric_limits<double>::infinity();
  WallWithGap prover(0.3);
  const std::vector<JointLimits> open{{-none, none}, {-2, none}};
  for (const double range : {1.0, 1e300, none})
    expect_proved(prover, find_path(prover, open, States{-1, 0}, States{1, 0}, {.range = range}).path, 2, {-1, 0},
                  {1, 0});
}

TEST(StateSampler, DrawsHalfOfTheSamplesNearTheStraightMotion) {
  const std::vector<JointLimits> wide{{-1e6, 1e6}, {-1e6, 1e6}};
  const States start{1, 7}, goal{5, 7};
  constexpr double kSpread = 0.5, kMost = 2 * 1.7320509 * kSpread;  // of a sum of four uniform numbers
  constexpr int kSamples = 4000;
  StateSampler sampler(wide, start, goal, kSpread, 3);
  States state(2);
  int near = 0;
  double sum = 0, squares = 0;
  for (int i = 0; i < kSamples; ++i) {
    sampler.sample(state);
    const double off = state[1] - start[1];
    if (std::abs(off) > kMost) continue;  // uniform
    EXPECT_GE(state[0], start[0] - kMost);
    EXPECT_LE(state[0], goal[0] + kMost);
    ++near;
    sum += off;
    squares += off * off;
  }
  EXPECT_NEAR(near, kSamples / 2, 150);
  EXPECT_NEAR(sum / near, 0, 0.05);
  EXPECT_NEAR(squares / near, kSpread * kSpread, 0.02);
}

TEST(StateSampler, KeepsToTheLimits) {
  const double none = std::numeric_limits<double>::infinity();
  const std::vector<JointLimits> limits{{-1, 1}, {-none, none}};
  const States start{-1, 9}, goal{1, 9};  // beyond the uniform samples of the joint without limits
  StateSampler sampler(limits, start, goal, 2, 3);
  States state(2);
  int at_limit = 0, beyond = 0;
  for (int i = 0; i < 1000; ++i) {
    sampler.sample(state);
    ASSERT_LE(std::abs(state[0]), 1);
    at_limit += std::abs(state[0]) == 1;
    beyond += state[1] > 4;
  }
  EXPECT_GT(at_limit, 100);
  EXPECT_GT(beyond, 400);
}

TEST(Planner, FindsPathsNearTheStraightMotionWithinWideLimits) {
  const std::vector<JointLimits> wide{{-100, 100}, {-100, 100}};
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    WallWithGap prover(0.3);
    const PathFound found = find_path(prover, wide, States{-1.5, 0.5}, States{1.5, 0.5}, {.seed = seed});
    expect_proved(prover, found.path, 2, {-1.5, 0.5}, {1.5, 0.5});
    EXPECT_LT(found.iterations, 1000u) << seed;  // with uniform samples alone 11,000 in the mean
  }
}

TEST(StateTree, FindsTheNearestAsABruteForceDoes) {
  std::uint64_t bits = 1;
  const auto number = [&] {
    bits = bits * 6364136223846793005u + 1442695040888963407u;
    return static_cast<double>(bits >> 40) * 0x1p-20 - 8;  // exact in float32
  };
  for (const std::size_t joints : {1, 3, 7}) {
    States root(joints, 0.0);
    StateTree tree(root);
    std::vector<States> all{root};
    for (int i = 0; i < 300; ++i) {
      States next(joints);
      for (double& q : next) q = number();
      std::size_t best = 0;
      double least = std::numeric_limits<double>::infinity();
      for (std::size_t k = 0; k < all.size(); ++k) {
        double square = 0;
        for (std::size_t j = 0; j < joints; ++j) square += (all[k][j] - next[j]) * (all[k][j] - next[j]);
        if (square < least * (1 - 1e-6)) best = k, least = square;
      }
      const std::size_t found = tree.nearest(next);
      double square = 0;
      for (std::size_t j = 0; j < joints; ++j) square += (all[found][j] - next[j]) * (all[found][j] - next[j]);
      EXPECT_NEAR(square, least, 1e-5 * least) << i << " " << best << " " << found;
      EXPECT_EQ(tree.add(next, found), all.size());
      EXPECT_EQ(tree.parent(all.size()), found);
      all.push_back(next);
    }
  }
}

/// The arm of the cell, and its home.
struct Cell {
  Engine engine{Scene::load(CLEARANCE_SOURCE_DIR "/scenes/cell/robot.yaml"), {.backend = "cpu", .threads = 1}};
  Joints joints;
  States start;

  Cell() {
    engine.allow(engine.body("arm/wrist_1"), engine.body("arm/flange"));
    const JointsInfo info = engine.joint_states();
    const Joints all = engine.joints("arm");
    for (std::size_t j = 0; j < all.size(); ++j) {
      if (all.names[j] == "arm/grip") continue;
      joints.names.push_back(all.names[j]);
      joints.ids.push_back(all.ids[j]);
      joints.limits.push_back(all.limits[j]);
      start.push_back(info.joints[all.ids[j]].position);
    }
  }
  States turned(double angle) const {
    States goal = start;
    goal[0] = angle;
    return goal;
  }
};

TEST(Planner, PlansForAnEngine) {
  Cell cell;
  const Query query{.margin = 0.02};
  const States goal = cell.turned(1.5);
  for (const bool with_covers : {false, true}) {
    if (with_covers) {
      ASSERT_TRUE(cell.engine.wait_covers());
    }
    const PathPlan made = plan(cell.engine, cell.joints, cell.start, goal, query, {.seed = 1});
    ASSERT_TRUE(made.found());
    EXPECT_GT(made.iterations, 0u) << "the straight motion is free";
    Query path = query;
    path.joints = cell.joints.ids;
    path.positions = made.path;
    const PathCheck check = cell.engine.check_path(path);
    EXPECT_TRUE(check.ok()) << *check.index;
  }
}

TEST(Planner, SaysWhyThereIsNoPath) {
  Cell cell;
  const Query query{.margin = 0.02};
  const States beyond = cell.turned(9), blocked = cell.turned(0.75), goal = cell.turned(1.5);
  const PathPlan limits = plan(cell.engine, cell.joints, cell.start, beyond, query);
  EXPECT_EQ(limits.outcome, PlanOutcome::kBeyondLimits);
  ASSERT_EQ(limits.blocked->limit_violations.size(), 1u);
  EXPECT_EQ(limits.blocked->limit_violations[0].joint, cell.joints.ids[0]);

  const PathPlan at_goal = plan(cell.engine, cell.joints, cell.start, blocked, query);
  EXPECT_EQ(at_goal.outcome, PlanOutcome::kGoalNotFree);
  EXPECT_TRUE(at_goal.blocked->hit(0));
  EXPECT_NE(at_goal.blocked->pair[0][0], kNone);
  EXPECT_EQ(plan(cell.engine, cell.joints, blocked, goal, query).outcome, PlanOutcome::kStartNotFree);

  const PathPlan few = plan(cell.engine, cell.joints, cell.start, goal, query, {.max_iterations = 1});
  EXPECT_EQ(few.outcome, PlanOutcome::kOutOfIterations);
  EXPECT_TRUE(few.path.empty());
}

TEST(PathReport, BoundsTheLeastDistanceOfAFreePath) {
  Cell cell;
  States path = cell.turned(-0.4);
  const States middle = cell.turned(-0.2), end = cell.turned(0);
  path.insert(path.end(), middle.begin(), middle.end());
  path.insert(path.end(), end.begin(), end.end());
  const PathReport report = explain_path(cell.engine, {.joints = cell.joints.ids, .positions = path, .margin = 0.02});
  ASSERT_TRUE(report.check.free);
  EXPECT_FALSE(report.contact || report.proved_until);
  EXPECT_LT(0.02, report.least->lower);
  EXPECT_LE(report.least->lower, report.least->upper);
  EXPECT_EQ(report.nearest.upper, report.least->upper);
  EXPECT_LE(report.nearest.index, 1u);
  for (int k = 0; k <= 100; ++k) {
    const States state = cell.turned(-0.4 + 0.004 * k);
    const Result at = cell.engine.distances({.joints = cell.joints.ids, .positions = state, .reduce = Reduce::kMin});
    EXPECT_LE(report.least->lower, at.upper()[0]) << k;
  }
  const PathReport of_curve =
      explain_path(cell.engine, {.joints = cell.joints.ids, .positions = path, .margin = 0.02, .control_points = 3});
  EXPECT_NEAR(of_curve.least->upper, report.least->upper, 2e-3) << "the curve with these control points is as straight";
  EXPECT_EQ(of_curve.nearest.index, 0u);
}

TEST(PathReport, FindsTheFirstContactAndTheDepth) {
  Cell cell;
  for (const auto& [from, control_points] : {std::pair{0.0, 2u}, {0.75, 2u}, {0.0, 3u}, {0.75, 3u}}) {
    States path = cell.turned(from);
    const States end = cell.turned(0.9), middle = cell.turned(0.5 * (from + 0.9) + 0.01);
    if (control_points == 3) path.insert(path.end(), middle.begin(), middle.end());
    path.insert(path.end(), end.begin(), end.end());
    const Query query{.joints = cell.joints.ids, .positions = path, .margin = 0.02, .control_points = control_points};
    const PathReport report = explain_path(cell.engine, query);
    ASSERT_TRUE(report.check.hit());
    ASSERT_TRUE(report.contact && report.proved_until);
    EXPECT_LE(report.contact->upper, 0.02);
    EXPECT_LE(report.proved_until->second, report.contact->t);
    EXPECT_LE(report.contact->t, report.nearest.t);
    EXPECT_LT(report.nearest.upper, 0) << "of the depth";
    EXPECT_EQ(from == 0.75, report.contact->t == 0) << "a path that begins in contact";
    Query contact = query;
    contact.pairs = {&report.contact->pair, 1};
    contact.positions = report.contact->positions;
    contact.control_points = 2;
    EXPECT_FALSE(cell.engine.check(contact).free[0]);
  }
}

/// An engine that counts its lists of pairs.
struct CountedLists {
  const Engine& engine;
  int lists = 0;
  SceneInfo scene() const { return engine.scene(); }
  Result distances(const Query& query) const { return engine.distances(query); }
  Result motions(const Query& query) const { return engine.motions(query); }
  PathCheck check_path(const Query& query) const { return engine.check_path(query); }
  std::vector<IdPair> pairs(const Query& query) {
    ++lists;
    return engine.pairs(query);
  }
};

TEST(PathReport, ListsNoPairsInASceneWithoutClouds) {
  Cell cell;
  States path = cell.turned(0);
  const States end = cell.turned(0.9);
  path.insert(path.end(), end.begin(), end.end());
  const Query query{.joints = cell.joints.ids, .positions = path, .margin = 0.02};
  CountedLists counted{cell.engine};
  const PathReport without = explain_path(counted, query);
  EXPECT_EQ(counted.lists, 0);
  EXPECT_LT(without.nearest.upper, 0);
  const std::vector<std::array<float, 3>> points{{9, 9, 9}};
  cell.engine.add_body({.name = "seen", .is_static = true, .points = points});
  const PathReport with = explain_path(counted, query);
  EXPECT_GT(counted.lists, 0);
  EXPECT_EQ(with.nearest.pair, without.nearest.pair);
  EXPECT_EQ(with.nearest.upper, without.nearest.upper);
  EXPECT_EQ(with.contact->t, without.contact->t);
}

TEST(PathReport, APathThatLosesItsPairsHasNoDeepestState) {
  Cell cell;
  States path = cell.turned(0);
  path.insert(path.end(), cell.start.begin(), cell.start.end());
  const Query query{.all_pairs = false, .joints = cell.joints.ids, .positions = path};
  const std::vector<path_report::State> states{{query, 0, 0}};
  const std::vector<double> times{0};
  for (const bool has_cloud : {false, true}) {
    const std::vector<std::array<float, 3>> points{{9, 9, 9}};
    if (has_cloud) cell.engine.add_body({.name = "seen", .is_static = true, .points = points});
    EXPECT_THROW(path_report::deepest(cell.engine, query, 0, states, times), std::runtime_error);
  }
}

TEST(Planner, RejectsWhatIsNoProblem) {
  Cell cell;
  const States goal = cell.turned(1.5), shorter(cell.start.begin(), cell.start.end() - 1);
  States broken = goal;
  broken[1] = std::nan("");
  const auto text = [&](const Joints& joints, const States& from, const States& to, double range) -> std::string {
    try {
      plan(cell.engine, joints, from, to, {}, {.range = range});
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "nothing was thrown";
  };
  EXPECT_EQ(text(cell.joints, shorter, goal, 1), "start: 5 positions for 6 joints");
  EXPECT_EQ(text(cell.joints, cell.start, broken, 1), "goal: a position is not finite");
  EXPECT_EQ(text({}, {}, {}, 1), "joints: expected one or more");
  EXPECT_EQ(text(cell.joints, cell.start, goal, 0), "range: expected a number above 0");
}

}  // namespace
}  // namespace clearance
