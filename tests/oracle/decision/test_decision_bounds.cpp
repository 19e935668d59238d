// Bounds of decisions by covers, of states at their margins and of motions that come up to them. Bodies are balls, whose
// exact distances are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/decision/cover_plan.h"
#include "engine/decision/motion_decider.h"
#include "engine/selection/body_poses.h"
#include "engine/selection/configuration_poses.h"
#include "engine/state/pose_store.h"
#include "tests/oracle/cases/cases.h"
#include "tests/oracle/decision/ball_scene.h"
#define CLEARANCE_ISA decision_bounds_test
#include "engine/decision/placed_balls.h"

namespace clearance::exact {
namespace {

constexpr double kFloatUnit = 0x1p-24;

/// Covers of every scene, made when they are needed.
CoverStore& covers() {
  static CoverStore store;
  return store;
}

/// A query of one pair for one state, or for one motion of two.
class PairQuery {
 public:
  /// \param tables may be null
  PairQuery(const BallScene& made, BodyPair pair, std::vector<double> positions, double margin, bool is_motion = false,
            const JointTableStore* tables = nullptr)
      : pair_{pair}, positions_(std::move(positions)), poses_(made.scene(), std::chrono::seconds(60)) {
    for (const std::uint32_t body : {pair.a, pair.b})
      if (const Body& b = made.scene().bodies()[body]; !b.is_static || b.robot != kNone) covers().request({b.parts});
    if (!covers().wait(std::chrono::minutes(10))) throw std::runtime_error("covers are not made in time");
    for (std::uint32_t j = 0; j < made.scene().joints().size(); ++j) joints_.push_back(j);
    QueryView query;
    query.joints = joints_;
    query.positions = positions_;
    query.configuration_count = is_motion ? 2 : 1;
    query.max_evaluations = is_motion ? 100 : 0;
    query.reduce = Reduce::kAny;
    query.fields = kFieldVerdict;
    query.margin = margin;
    query.all_pairs = false;
    query.pairs = pair_;
    plan_ = make_plan(query, made.scene(), poses_.snapshot(), 1u << 20, true);
    plan_.uncertainties = uncertainties_of(made.scene(), *plan_.snapshot, plan_.begun_ns);
    covers_ = CoverPlan::make(made.scene(), plan_, covers(), tables);
    if (!covers_)
      throw std::runtime_error("covers cannot decide " + made.scene().bodies()[pair.a].name + ", " +
                               made.scene().bodies()[pair.b].name);
  }

  const DecisionView& view() const { return covers_->view(); }
  /// Index of a body in the view.
  std::uint32_t index_of(std::uint32_t body) const {
    return static_cast<std::uint32_t>(std::find(plan_.moved.begin(), plan_.moved.end(), body) - plan_.moved.begin());
  }
  std::vector<Pose> poses() {
    ConfigurationPoses all(plan_);
    const auto block = all.at(0, 1);
    return {block.poses.begin(), block.poses.end()};
  }
  /// What is added to the radii of a moved body, against an obstacle or another one.
  double grow(std::uint32_t body) const {
    return view().moved_pair_count ? view().moved_pairs[0].grow : view().grow[index_of(body)];
  }
  Verdict state() {
    const std::uint8_t usable = 1;
    Decision decision;
    std::uint64_t open[8];
    const std::vector<Pose> at = poses();
    decision_kernels()[0].run(
        {&view(), at.data(), plan_.bodies.size(), 1, &usable, true, positions_.data(), joints_.size()},
        {&decision, open, 8});
    return decision.verdict;
  }
  Verdict motion() { return MotionDecider(*covers_, plan_).decide(0); }

 private:
  BodyPair pair_[1];
  std::vector<double> positions_;
  std::vector<std::uint32_t> joints_;
  PoseStore poses_;
  Plan plan_;
  std::unique_ptr<const CoverPlan> covers_;
};

Balls random_balls(Random& random, int count, double far, double radius) {
  Balls balls;
  for (int i = 0; i < count; ++i) balls.push_back({random.direction() * (far * random.uniform(0.3, 1)), radius});
  return balls;
}
const Balls kPebble{{{0, 0, 0}, 0.015625}};

std::vector<double> random_positions(const BallScene& made, Random& random) {
  std::vector<double> q;
  for (const SceneJoint& joint : made.scene().joints())
    q.push_back(random.uniform(std::max(joint.lower, -3.0), std::min(joint.upper, 3.0)));
  return q;
}

// Distance of a placed centre from its place, over the error that the plan's radii have for it.
double worst_centre(const BallScene& made, std::uint32_t link, std::uint32_t obstacle, Random& random) {
  double worst = 0;
  for (int n = 0; n < 200; ++n) {
    const std::vector<double> q = random_positions(made, random);
    PairQuery query(made, {link, obstacle}, q, 0);
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
  const std::uint32_t tool = held.add_tool({{{0, 0, 0.5}, 0.0625}}, "r/l1", random.rotation({0.5, 1, 0}));
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
    PairQuery query(made, {made.link(1), obstacle}, {0.0}, 0);
    const std::vector<test::RealFrame> frames = made.frames(std::vector{0.0});
    const test::RealVec is = (test::real_inverse(frames[made.link(0)]) * frames[obstacle]).t;
    const Obstacle& seen = query.view().obstacles[0];
    worst = std::max(worst, distance_of(is, {{seen.at[0], seen.at[1], seen.at[2]}}) / seen.error);
  }
  std::printf("obstacles: %.3f of their error\n", worst);
  EXPECT_LT(worst, 1);
  EXPECT_GT(worst, 0.002);
}

/// Verdicts near a margin.
struct Verdicts {
  int free = 0, hit = 0, open = 0;
  int untrue = 0;  ///< free within the margin, or within it and proved beyond
  int late = 0;    ///< open, though farther from the margin than the errors allow
};

// Decides a pair at random states for margins that are its distance, give or take a little.
// \param width metres by which margins differ from the distance at most; 0: three times the plan's error
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
    const double error = std::max(PairQuery(made, pair, q, at).grow(moved) - at - slack, 1e-9);
    const double by = random.uniform(-1, 1) * (width > 0 ? width : 3 * error);
    if (at + by < 0) continue;
    PairQuery query(made, pair, q, at + by, false, tables);
    const Verdict verdict = query.state();
    verdicts.free += verdict == Verdict::kFree;
    verdicts.hit += verdict == Verdict::kHit;
    verdicts.open += verdict == Verdict::kUnresolved;
    verdicts.untrue +=
        (verdict == Verdict::kFree && !(d - slack > at + by)) || (verdict == Verdict::kHit && !(d <= at + by));
    const bool is_clear = at + by < d - slack - 2.5 * error || at + by > d + 2.5 * error;
    verdicts.late += verdict == Verdict::kUnresolved && is_clear;
  }
}

// Three links, one of which slides, and a body that is held.
BallScene made_arm(int balls, double radius, const engine::RobotOptions& options = {}) {
  Random random(static_cast<std::uint64_t>(balls));
  const auto shape = [&] {
    return balls == 1 ? Balls{{{0.25, 0.0625, 0}, radius}} : random_balls(random, balls, 0.25, radius);
  };
  BallScene made({{},
                  {shape(), 0, turning({0, 0, 0.25}, {0.25, 0, 1})},
                  {shape(), 1, sliding({0.5, 0, 0}, {1, 0.25, 0}, -0.25, 0.5)},
                  {shape(), 2, turning({0.25, 0, 0}, {0, 1, 0.25})},
                  {shape(), 3, turning({0.375, 0, 0.125}, {1, 0.5, 0})}},
                 options);
  made.add_tool(shape(), "r/l4", random.rotation({0.125, 0, 0.25}));
  made.add_obstacle(shape(), random.rotation({0.5, -0.5, 0.75}));
  made.add_obstacle(kPebble, random.rotation({1.5, 0.5, 0.25}),
                    {0.015625, 0});  // its uncertain position is part of its radius
  return made;
}
std::vector<BodyPair> pairs_of(const BallScene& made) {
  const auto bodies = static_cast<std::uint32_t>(made.scene().bodies().size());
  const std::uint32_t tool = bodies - 3, wall = bodies - 2, pebble = bodies - 1;
  return {{made.link(1), wall},         {made.link(3), wall},         {made.link(4), pebble}, {tool, wall},
          {made.link(1), made.link(3)}, {made.link(2), made.link(4)}, {made.link(1), tool}};
}
engine::RobotOptions with_slack() {
  engine::RobotOptions options;
  options.base = Pose{{1, 2, 0.5}, 0.5, 0.5, -0.5, 0.5};
  options.link_padding = {{"l3", 0.0078125}};
  options.link_uncertainty = {{"l4", {0.00390625, 0}}};
  return options;
}

TEST(DecisionBounds, StatesAtTheirMarginAreNeverDecidedWrongly) {
  Random random(3);
  Verdicts one, many;
  const BallScene single = made_arm(1, 0.0625, with_slack()), several = made_arm(60, 0.015625, with_slack());
  for (const BodyPair pair : pairs_of(single)) decide_near_margin(single, pair, 0, 100, random, one);
  for (const BodyPair pair : pairs_of(several)) decide_near_margin(several, pair, 0.03, 60, random, many);
  std::printf("one ball: %d free, %d hit, %d open; 60: %d, %d, %d\n", one.free, one.hit, one.open, many.free, many.hit,
              many.open);
  EXPECT_EQ(one.untrue, 0);
  EXPECT_EQ(one.late, 0) << "balls against balls leave nothing open but their errors";
  EXPECT_GT(std::min(one.free, one.hit), 50);
  EXPECT_EQ(many.untrue, 0);
  EXPECT_GT(std::min(many.free, many.hit), 50);
}

TEST(DecisionBounds, TablesAtTheirMarginAreNeverWrong) {
  Random random(4);
  const BallScene made = made_arm(1, 0.0625, with_slack());
  JointTableStore tables;
  tables.request(made.scene());
  ASSERT_TRUE(tables.wait(std::chrono::minutes(10)));
  Verdicts found;
  for (const BodyPair pair : {BodyPair{made.link(1), made.link(3)}, BodyPair{made.link(2), made.link(4)}}) {
    EXPECT_EQ(PairQuery(made, pair, random_positions(made, random), 0, false, &tables).view().tabled_count, 1u);
    decide_near_margin(made, pair, 0.004, 400, random, found, &tables);
  }
  EXPECT_EQ(found.untrue, 0);
  EXPECT_GT(std::min(found.free, found.hit), 100);
}

/// A motion, and where it is at a time.
struct Motion {
  std::vector<double> from, to;

  std::vector<double> at(double t) const {
    std::vector<double> q;
    for (std::size_t j = 0; j < from.size(); ++j) q.push_back(from[j] + t * (to[j] - from[j]));
    return q;
  }
  std::vector<double> both() const {
    std::vector<double> q = from;
    q.insert(q.end(), to.begin(), to.end());
    return q;
  }
};
Motion random_motion(const BallScene& made, Random& random) {
  Motion m{random_positions(made, random), random_positions(made, random)};
  const double total = random.chance(0.7) ? random.uniform(0.1, 0.6) : random.uniform(0.6, 3);
  double sum = 0;
  for (std::size_t j = 0; j < m.from.size(); ++j) {
    if (random.chance(0.4)) m.to[j] = m.from[j];
    sum += std::abs(m.to[j] - m.from[j]);
  }
  for (std::size_t j = 0; j < m.from.size() && sum > total; ++j)
    m.to[j] = m.from[j] + (m.to[j] - m.from[j]) * (total / sum);
  return m;
}

// Motions that touch their margin at one time, mostly an end of a span, where bounds on the movement have least to spare.
// A pebble lies where a ball gets to, straight ahead as seen from the middle of the span.
TEST(DecisionBounds, MotionsThatReachTheirMarginAreNeverFree) {
  Random random(5);
  const BallScene arm = made_arm(1, 0.0625);
  const std::uint32_t bodies = static_cast<std::uint32_t>(arm.scene().bodies().size()), tool = bodies - 3;
  int untrue = 0, free = 0, clear = 0;
  for (int n = 0; n < 1500; ++n) {
    const Motion m = random_motion(arm, random);
    const double ends[] = {0, 1, 0.5, 0.25, 0.75, random.uniform(0, 1)};
    const double time = ends[random.integer(0, 5)], middle = time < 0.5 ? time + 0.25 : time > 0.5 ? time - 0.25 : 0.5;
    const double seen = random.chance(0.5) && (time == 0 || time == 1) ? 0.5 : middle;
    const std::uint32_t body = random.chance(0.3) ? tool : arm.link(static_cast<std::size_t>(random.integer(1, 4)));
    const auto there = arm.frames(m.at(time)), before = arm.frames(m.at(seen));
    const OneBall& ball = arm.balls(body)[0];
    const test::RealVec p = point_of(there[body], ball.centre), q = point_of(before[body], ball.centre);
    const double way = distance_of(p, q), ahead = ball.radius + kPebble[0].radius + random.uniform(0.002, 0.02);
    if (way < 1e-4) continue;
    Vec3d at;
    for (int k = 0; k < 3; ++k) at[k] = static_cast<double>(p.x[k] + (p.x[k] - q.x[k]) * (ahead / way));
    BallScene made = arm;
    const BodyPair pair{body, made.add_obstacle(kPebble, Pose{at})};
    const double d = made.distance(pair, made.frames(m.at(time)));
    const Verdict touching = PairQuery(made, pair, m.both(), d * (1 + 1e-9), true).motion();
    untrue += touching == Verdict::kFree;
    const auto least_of = [&](int times) {
      double least = d;
      for (int s = 0; s <= times; ++s) least = std::min(least, made.distance(pair, made.frames(m.at(s * 1.0 / times))));
      return least;
    };
    const double least = least_of(16);
    if (least < 0.001) continue;
    const Verdict apart = PairQuery(made, pair, m.both(), 0.5 * least, true).motion();
    ++clear;
    free += apart == Verdict::kFree;
    untrue += apart == Verdict::kHit && least_of(256) > 0.5 * least;  // times of hits are multiples of 2^-8 at most
  }
  std::printf("motions: %d of %d free\n", free, clear);
  EXPECT_EQ(untrue, 0);
  EXPECT_GT(free, clear / 2);
  EXPECT_GT(clear, 500);
}

// Two moved bodies, which are as near as their margin at one time.
// \param tables may be null
void decide_touching_pairs(const BallScene& made, const std::vector<BodyPair>& pairs, int count, Random& random,
                           const JointTableStore* tables, Verdicts& verdicts) {
  for (int n = 0; n < count; ++n) {
    const BodyPair pair = pairs[static_cast<std::size_t>(random.integer(0, static_cast<int>(pairs.size()) - 1))];
    const Motion m = random_motion(made, random);
    const double times[] = {0, 1, 0.5, 0.25, 0.75, random.uniform(0, 1)};
    const double d = made.distance(pair, made.frames(m.at(times[random.integer(0, 5)])));
    if (d < 0.001) continue;
    verdicts.untrue += PairQuery(made, pair, m.both(), d * (1 + 1e-9), true, tables).motion() == Verdict::kFree;
    const double less = std::max(d - 0.15, 0.0);
    const Verdict verdict = PairQuery(made, pair, m.both(), less, true, tables).motion();
    verdicts.free += verdict == Verdict::kFree;
    verdicts.hit += verdict == Verdict::kHit;
    verdicts.open += verdict == Verdict::kUnresolved;
  }
}

TEST(DecisionBounds, MovedPairsThatReachTheirMarginAreNeverFree) {
  Random random(6);
  const BallScene one = made_arm(1, 0.0625), many = made_arm(60, 0.015625);
  std::vector<BodyPair> pairs = pairs_of(one);
  pairs.erase(pairs.begin(), pairs.begin() + 4);
  JointTableStore tables;
  tables.request(one.scene());
  ASSERT_TRUE(tables.wait(std::chrono::minutes(10)));
  Verdicts found;
  decide_touching_pairs(one, pairs, 1000, random, nullptr, found);
  decide_touching_pairs(one, pairs, 400, random, &tables, found);
  decide_touching_pairs(many, pairs, 100, random, nullptr, found);
  std::printf("moved pairs: %d free, %d hit, %d open\n", found.free, found.hit, found.open);
  EXPECT_EQ(found.untrue, 0);
  EXPECT_GT(found.free, 300);
}

}  // namespace
}  // namespace clearance::exact
