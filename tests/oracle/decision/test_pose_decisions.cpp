// Decisions by covers of bodies whose poses the query gives: the same rows as without covers.
#include "tests/oracle/decision/pose_states.h"

namespace clearance::exact {
namespace {

TEST(PoseDecisions, RowsNearTheMarginHaveTheBitsThatTheyHaveWithout) {
  const Scene scene = made_cell();
  const Engines engines(scene);
  Random random(2);
  Counts all{};
  for (const double margin : {0.0, 0.005, 0.02}) {
    PoseStates states(scene);
    const char* const others[] = {"box", "post", "stone", "rail", "drone", "floor", "pallet", "rock"};
    for (std::size_t mover = 0; mover < states.bodies.size(); ++mover)
      for (const char* other : others) {
        const std::string name = scene.bodies()[states.bodies[mover]].name;
        if (name == other) continue;
        states.add(engines.without, mover, name.c_str(), other, margin, 0.008, 20, random);
        if (mover == 0) states.add(engines.without, mover, "tool", other, margin, 0.008, 20, random);
      }
    QueryView query = states.of();
    query.margin = margin;
    const Counts counts = expect_same(engines, query);
    for (std::size_t s = 0; s < all.size(); ++s) all[s] += counts[s];
  }
  EXPECT_GT(all[static_cast<std::size_t>(Status::kBeyond)], 500u);
  EXPECT_GT(all[static_cast<std::size_t>(Status::kOk)] + all[static_cast<std::size_t>(Status::kOverlap)], 500u);
}

TEST(PoseDecisions, CoversDecideMostStates) {
  const Scene scene = made_cell();
  const Engines engines(scene);
  Random random(3);
  PoseStates states(scene);
  for (const char* other : {"box", "post", "stone"}) states.add(engines.without, 0, "rock", other, 0, 0.3, 200, random);
  QueryView query = states.of();
  query.reduce = Reduce::kAny;
  query.fields = kFieldVerdict;
  const Answer with = test::evaluate(engines.with, query), without = test::evaluate(engines.without, query);
  EXPECT_LT(3 * with.info.pairs_evaluated, without.info.pairs_evaluated);
  EXPECT_GT(without.info.pairs_evaluated, query.configuration_count);
}

TEST(PoseDecisions, LeastDistancesAreThoseWithout) {
  const Scene scene = made_cell();
  const Engines engines(scene);
  Random random(8);
  PoseStates states(scene);
  for (const char* other : {"box", "post", "stone"}) states.add(engines.without, 0, "rock", other, 0, 0.3, 100, random);
  QueryView query = states.of();
  query.reduce = Reduce::kMin;
  query.fields = kRows;
  const Answer exact = test::evaluate(engines.without, query), narrow = test::evaluate(engines.with, query);
  test::expect_same_rows(exact, 0, narrow, query.configuration_count);
  query.fields = kFieldDistance | kFieldLower | kFieldUpper | kFieldStatus;
  query.abs_tol = 0.01;
  const Answer wide = test::evaluate(engines.with, query);
  EXPECT_LT(wide.info.pairs_evaluated, exact.info.pairs_evaluated / 2);
  for (std::uint32_t k = 0; k < query.configuration_count; ++k) {
    EXPECT_LE(wide.view.lower[k], exact.view.upper[k]) << k;
    EXPECT_GE(wide.view.upper[k], exact.view.lower[k]) << k;
    EXPECT_LE(wide.view.upper[k] - wide.view.lower[k], 0.01) << k;
  }
}

// So many obstacles that a tree finds the near ones, and more pairs than a job that is kept may have.
TEST(PoseDecisions, RowsAmongManyObstaclesHaveTheBitsThatTheyHaveWithout) {
  Scene scene = made_cell();
  Random random(10);
  std::vector<std::string> names;
  for (int i = 0; i < 900; ++i) {
    const Options options{.is_static = true, .pose = random.rotation(random.direction() * random.uniform(3, 12))};
    names.push_back("thing" + std::to_string(i));
    if (i % 4 == 0) scene.add_box(names.back(), {0.2, 0.1, random.log_uniform(0.05, 5)}, options);
    if (i % 4 == 1) scene.add_capsule(names.back(), 0.05, random.uniform(0.1, 2), options);
    if (i % 4 == 2) scene.add_cylinder(names.back(), random.uniform(0.05, 0.5), 0.3, options);
    if (i % 4 == 3) scene.add_hull(names.back(), cloud(random, 12, 0.3), options);
  }
  const Engines engines(scene);
  Counts all{};
  for (const double margin : {0.0, 0.02}) {
    PoseStates states(scene);
    for (int i = 0; i < 300; ++i)
      states.add(engines.without, static_cast<std::size_t>(i % 4),
                 scene.bodies()[states.bodies[static_cast<std::size_t>(i % 4)]].name.c_str(),
                 names[static_cast<std::size_t>(random.integer(0, 899))].c_str(), margin, 0.05, 5, random);
    QueryView query = states.of();
    query.margin = margin;
    const Counts counts = expect_same(engines, query);
    for (std::size_t s = 0; s < all.size(); ++s) all[s] += counts[s];
    query.reduce = Reduce::kAny;
    query.fields = kFieldVerdict;
    const std::uint64_t with = test::evaluate(engines.with, query).info.pairs_evaluated;
    EXPECT_LT(with, test::evaluate(engines.without, query).info.pairs_evaluated / 2);
  }
  EXPECT_GT(all[static_cast<std::size_t>(Status::kBeyond)], 300u);
  EXPECT_GT(all[static_cast<std::size_t>(Status::kOk)] + all[static_cast<std::size_t>(Status::kOverlap)], 300u);
}

// A pair just beyond its margin and one just within it: covers leave both open.
TEST(PoseDecisions, EveryOpenPairIsEvaluated) {
  const Scene scene = made_cell();
  const Engines engines(scene);
  Random random(9);
  PoseStates states(scene);
  states.add(engines.without, 0, "rock", "box", 0.01, 0.005, 20, random);
  const std::uint32_t rock = scene.find_body("rock");
  for (std::size_t k = 0; k < 20; ++k)
    for (const bool is_last : {false, true}) {
      std::vector<BodyPair> pairs{{rock, scene.find_body("stone")}, {rock, scene.find_body("box")}};
      if (!is_last) std::swap(pairs[0], pairs[1]);
      QueryView query = states.of();
      query.configurations = query.configurations.subspan(k * states.bodies.size(), states.bodies.size());
      query.configuration_count = 1;
      query.all_pairs = false;
      query.pairs = pairs;
      query.fields = kFieldUpper;
      const Answer distances = test::evaluate(engines.without, query);
      std::vector<double> margins(distances.view.upper, distances.view.upper + 2);
      margins[is_last ? 0 : 1] *= 1 - 1e-5;
      margins[is_last ? 1 : 0] *= 1 + 1e-5;
      query.pair_margins = margins;
      const Counts counts = expect_same(engines, query);
      EXPECT_EQ(counts[static_cast<std::size_t>(Status::kOk)], 1u) << k;
    }
}

// A body on a frame of uncertain rotation, as far as given poses may be and farther: its slack grows with its distance.
TEST(PoseDecisions, SlackIsThatOfTheFarthestPose) {
  const Scene scene = made_cell();
  const Engines engines(scene);
  Random random(4);
  PoseStates states(scene);
  for (const char* other : {"far", "farther", "pallet"})
    states.add(engines.without, 4, "load", other, 0.03, 0.03, 300, random);
  const Counts counts = expect_same(engines, states.of());
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kBeyond)], 20u);
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kUnconverged)], 50u) << "uncertainty leaves states open";
}

TEST(PoseDecisions, PosesThatAreBadOrFarAwayAreReportedAsWithout) {
  const Scene scene = made_cell();
  const Engines engines(scene);
  Random random(5);
  PoseStates states(scene);
  states.add(engines.without, 0, "rock", "box", 0, 0.3, 60, random);
  const double none = std::nan("");
  const Pose bad[] = {{{none, 0, 0}},
                      {{0, 0, 0}, none, 0, 0, 0},
                      {{0, 0, 0}, 0, 0, 0, 0},
                      {{1e70, 0, 0}},
                      {{0, 0, 0}, 1e-9, 0, 0, 0},
                      {{0, 0, 0}, 1e9, 0, 0, 0},
                      {{1e7, 0, 400}},
                      {{15, 15, 15}},
                      {{0, 0, -1e8}}};
  std::size_t at = 0;
  for (std::size_t k = 0; k < 60; k += 2) states.poses[k * states.bodies.size() + k % 5] = bad[at++ % std::size(bad)];
  const Counts counts = expect_same(engines, states.of());
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kBadPose)], 10u);
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kBeyond)], 10u);
}

// Poses that the query does not give are too old: those of the pallet, which carries a body, and of an obstacle.
TEST(PoseDecisions, StalePosesAreReportedAsWithout) {
  const Scene scene = made_cell();
  const Engines engines(scene);
  Random random(7);
  PoseStates states(scene);
  states.add(engines.without, 0, "rock", "box", 0, 0.1, 60, random);
  QueryView query = states.of();
  query.max_pose_age_ns = 1;
  Counts counts = expect_same(engines, query);
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kStalePose)], 10u);
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kOk)] + counts[static_cast<std::size_t>(Status::kOverlap)], 10u);
  const BodyPair pairs[] = {{scene.find_body("rock"), scene.find_body("box")},
                            {scene.find_body("load"), scene.find_body("stone")}};
  query.all_pairs = false;
  query.pairs = pairs;
  counts = expect_same(engines, query);
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kStalePose)], 10u);
}

// A follower of a body without a pose has none, even if the body that carries both has one.
TEST(PoseDecisions, FollowersOfABodyWithoutAPoseHaveNone) {
  Scene scene = made_cell();
  scene.add_box("lost", {0.1, 0.1, 0.1}, {.parent = "rock", .requires_pose = true});
  scene.add_box("handle", {0.1, 0.1, 0.1}, {.parent = "lost", .pose = Pose{{0.1, 0, 0}}});
  const Engines engines(scene);
  Random random(6);
  PoseStates states(scene);
  states.add(engines.without, 0, "rock", "box", 0, 0.3, 40, random);
  const BodyPair pairs[] = {{scene.find_body("handle"), scene.find_body("box")},
                            {scene.find_body("rock"), scene.find_body("box")}};
  QueryView query = states.of();
  query.all_pairs = false;
  query.pairs = pairs;
  const Counts counts = expect_same(engines, query);
  EXPECT_GT(counts[static_cast<std::size_t>(Status::kNoPose)], 10u);
}

}  // namespace
}  // namespace clearance::exact
