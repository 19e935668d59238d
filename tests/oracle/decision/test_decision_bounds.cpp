// Bounds of decisions by covers: states at their margins. Bodies are balls, whose exact distances are known.
#include "engine/cover/cover_record.h"
#include "tests/engine/engine_test_util.h"
#include "tests/oracle/decision/pair_query.h"
#define CLEARANCE_ISA decision_bounds_test
#include "engine/decision/kernel/placed_balls.h"

namespace clearance::exact {
namespace {

constexpr double kFloatUnit = 0x1p-24;

// Distance of a placed centre from its place, over the error that the plan's radii have for it.
double worst_centre(const BallScene& made, std::uint32_t link, std::uint32_t obstacle, Random& random) {
  double worst = 0;
  for (int n = 0; n < 200; ++n) {
    const std::vector<double> q = random_positions(made, random);
    PairQuery query(made, {{link, obstacle}}, q, 0);
    const std::vector<Pose> poses = query.poses();
    decision_bounds_test::PlacedBalls placed(query.view());
    EXPECT_TRUE(placed.place(poses.data()));
    const decision_bounds_test::Centres& c = *placed.children_of_root<false>(query.index_of(link));
    const BallPacket& packet = query.view().bodies[query.index_of(link)].packets[0];
    const std::vector<test::RealFrame> frames = made.frames(q);
    const test::RealFrame in_base = test::real_inverse(frames[made.link(0)]) * frames[link];
    const double sizes = double{packet.outer[0]} + std::abs(packet.inner[0]);
    const double allowed = query.grow(link) - query.view().obstacles[0].error - 4 * kFloatUnit * sizes;
    for (std::uint32_t i = 0; i < packet.count; ++i) {
      const test::RealVec is = point_of(in_base, {packet.x[i], packet.y[i], packet.z[i]});
      worst = std::max(worst, distance_of(is, {{c.x[i], c.y[i], c.z[i]}}) / allowed);
    }
  }
  return worst;
}

TEST(DecisionBounds, CentresOfBallsAreWithinTheirError) {
  Random random(1);
  // Far from its link's origin, which stays; and near the origin of a link far away.
  BallScene turned({{}, {{{{1.5, 0.25, 0.125}, 0.03125}}, 0, turning({0, 0, 0}, {0.5, 0.25, 1})}});
  BallScene carried({{}, {{}, 0, turning({0, 0, 0}, {0, 0.25, 1})}, {kPebble, 1, turning({3, 1, 2}, {0, 1, 0})}});
  BallScene held = turned;
  const std::uint32_t handle = held.add_tool(kPebble, "r/l1", random.rotation({0.5, 1, 0}));
  const std::uint32_t tool =
      held.add_tool({{{0, 0, 0.5}, 0.0625}}, held.scene().bodies()[handle].name, random.rotation({0.25, 0, 0}));
  for (BallScene* made : {&turned, &carried, &held}) {
    const std::uint32_t link = made == &turned ? made->link(1) : made == &carried ? made->link(2) : tool;
    const std::uint32_t obstacle = made->add_obstacle(kPebble, Pose{{0.25, 0.5, 0.75}});
    const double worst = worst_centre(*made, link, obstacle, random);
    std::printf("centres: %.3f of their error\n", worst);
    EXPECT_LT(worst, 1);
    EXPECT_GT(worst, 0.02);
  }
}

// An obstacle's place is rounded in the world, which is far away.
TEST(DecisionBounds, ObstaclesAreWithinTheirError) {
  Random random(2);
  double worst = 0;
  for (int n = 0; n < 100; ++n) {
    engine::RobotOptions options;
    options.base = random.rotation(random.direction() * 1e10);
    BallScene made({{}, {kPebble, 0, turning({0, 0, 0}, {0, 0, 1})}}, options);
    const std::uint32_t obstacle =
        made.add_obstacle(kPebble, random.rotation(options.base.translation + random.direction() * 0.125));
    PairQuery query(made, {{made.link(1), obstacle}}, {0.0}, 0);
    const std::vector<test::RealFrame> frames = made.frames(std::vector{0.0});
    const test::RealVec is = (test::real_inverse(frames[made.link(0)]) * frames[obstacle]).t;
    const Obstacle& seen = query.view().obstacles[0];
    worst = std::max(worst, distance_of(is, {{seen.at[0], seen.at[1], seen.at[2]}}) / seen.error);
  }
  std::printf("obstacles: %.3f of their error\n", worst);
  EXPECT_LT(worst, 1);
  EXPECT_GT(worst, 0.002);
}

// Decides a pair at random states, and expects no wrong verdict, for margins that are its distance, give or take a little.
// \param width metres by which margins differ from the distance at most, or 0 for three times the plan's error
// \param tables may be null
void decide_near_margin(const BallScene& made, BodyPair pair, double width, int count, Random& random,
                        Verdicts& verdicts, const JointTableStore* tables = nullptr) {
  const double slack = made.uncertainty(pair);
  const std::uint32_t moved = made.scene().bodies()[pair.a].is_static ? pair.b : pair.a;
  for (int n = 0; n < count; ++n) {
    const std::vector<double> q = random_positions(made, random);
    const double d = made.distance(pair, made.frames(q));
    const double at = random.chance(0.5) ? d - slack : d;  // free below, hit above
    if (at < 0.001) continue;
    const double error = std::max(PairQuery(made, {pair}, q, at).grow(moved) - at - slack, 1e-9);
    const double by = random.uniform(-1, 1) * (width > 0 ? width : 3 * error);
    if (at + by < 0) continue;
    PairQuery query(made, {pair}, q, at + by, false, tables);
    const Verdict verdict = query.state();
    verdicts.free += verdict == Verdict::kFree;
    verdicts.hit += verdict == Verdict::kHit;
    verdicts.open += verdict == Verdict::kUnresolved;
    if (verdict == Verdict::kFree) {
      EXPECT_GT(d - slack, at + by);
    }
    if (verdict == Verdict::kHit) {
      EXPECT_LE(d, at + by);
    }
    const bool is_clear = at + by < d - slack - 2.5 * error || at + by > d + 2.5 * error;
    verdicts.late += verdict == Verdict::kUnresolved && is_clear;
  }
}

TEST(DecisionBounds, StatesAtTheirMarginAreNeverDecidedWrongly) {
  Random random(3);
  Verdicts one, many;
  const BallScene single = made_arm(1, 0.0625, with_slack()), several = made_arm(60, 0.015625, with_slack());
  for (const BodyPair pair : pairs_of(single)) decide_near_margin(single, pair, 0, 100, random, one);
  for (const BodyPair pair : pairs_of(several)) decide_near_margin(several, pair, 0.03, 60, random, many);
  std::printf("one ball: %d free, %d hit, %d open; 60: %d, %d, %d\n", one.free, one.hit, one.open, many.free, many.hit,
              many.open);
  EXPECT_EQ(one.late, 0) << "balls against balls leave nothing open but their errors";
  EXPECT_GT(std::min(one.free, one.hit), 50);
  EXPECT_GT(std::min(many.free, many.hit), 50);
}

TEST(DecisionBounds, TablesAtTheirMarginAreNeverWrong) {
  Random random(4);
  const BallScene made = made_folding();
  const auto tables = tables_of(made);
  Verdicts found;
  const BodyPair pair{made.link(1), made.link(3)};
  EXPECT_EQ(PairQuery(made, {pair}, random_positions(made, random), 0, false, tables.get()).view().tabled_count, 1u);
  decide_near_margin(made, pair, 0.006, 600, random, found, tables.get());
  EXPECT_GT(std::min(found.free, found.hit), 100);
}

// A link of too many parts has no cover: the exact engine decides its pairs, and those that covers leave open.
TEST(DecisionBounds, PairsWithoutCoversAreDecidedByTheExactEngine) {
  Random random(7);
  BallScene made({{},
                  {random_balls(random, 40, 0.25, 0.015625), 0, turning({0, 0, 0.25}, {0.25, 0, 1})},
                  {random_balls(random, 100, 0.25, 0.015625), 1, turning({0.5, 0, 0}, {0, 1, 0})},
                  {random_balls(random, 40, 0.25, 0.015625), 2, turning({0.5, 0, 0}, {0, 1, 0.25})}});
  for (int i = 0; i < 4; ++i)
    made.add_obstacle(random_balls(random, 3, 0.125, 0.015625),
                      random.rotation(random.direction() * random.uniform(0.2, 1)));
  for (const std::size_t a : {1u, 2u, 3u}) EXPECT_EQ(may_have_cover(made.scene().bodies()[made.link(a)].parts), a != 2);
  const engine::Engine with(engine::Scene(made.scene()), {.backend = "cpu", .threads = 1}),
      without(engine::Scene(made.scene()), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  ASSERT_TRUE(with.wait_covers(std::chrono::minutes(10)));
  std::vector<double> positions;
  constexpr std::uint32_t kStates = 400;
  for (std::uint32_t k = 0; k < kStates; ++k)
    for (const double q : random_positions(made, random)) positions.push_back(q);
  QueryView query;
  const std::uint32_t joints[] = {0, 1, 2};
  query.joints = joints;
  query.positions = positions;
  query.configuration_count = kStates;
  query.reduce = Reduce::kAny;
  query.fields = kFieldVerdict;
  int free = 0;
  for (const double margin : {0.0, 0.01, 0.02}) {
    query.margin = margin;
    const test::Answer expected = test::evaluate(without, query), found = test::evaluate(with, query);
    EXPECT_LT(found.info.pairs_evaluated, expected.info.pairs_evaluated);
    for (std::uint32_t k = 0; k < kStates; ++k) {
      EXPECT_EQ(found.view.verdict[k], expected.view.verdict[k]) << k << ", margin " << margin;
      free += found.view.verdict[k] == static_cast<std::uint8_t>(Status::kBeyond);
    }
  }
  std::printf("%d free\n", free);
  EXPECT_GT(free, 50);
  EXPECT_LT(free, 3 * static_cast<int>(kStates) - 50);
}

}  // namespace
}  // namespace clearance::exact
