// Bounds of decisions by covers: motions that come up to their margin. Bodies are balls, whose exact distances are known.
#include "tests/oracle/decision/pair_query.h"

namespace clearance::exact {
namespace {

/// A motion, by its control points, and where it is at a time.
struct Motion {
  std::vector<std::vector<double>> points;

  std::vector<double> at(double t) const {
    std::vector<std::vector<double>> q = points;
    for (std::size_t left = q.size() - 1; left > 0; --left)
      for (std::size_t i = 0; i < left; ++i)
        for (std::size_t j = 0; j < q[i].size(); ++j) q[i][j] += t * (q[i + 1][j] - q[i][j]);
    return q[0];
  }
  std::vector<double> all() const {
    std::vector<double> q;
    for (const std::vector<double>& p : points) q.insert(q.end(), p.begin(), p.end());
    return q;
  }
};
Motion random_motion(const BallScene& made, Random& random) {
  std::vector<double> from = random_positions(made, random), to = random_positions(made, random);
  const double total = random.chance(0.7) ? random.uniform(0.1, 0.6) : random.uniform(0.6, 3);
  double sum = 0;
  for (std::size_t j = 0; j < from.size(); ++j) {
    if (random.chance(0.4)) to[j] = from[j];
    sum += std::abs(to[j] - from[j]);
  }
  for (std::size_t j = 0; j < from.size() && sum > total; ++j) to[j] = from[j] + (to[j] - from[j]) * (total / sum);
  return {{from, to}};
}
// With control points of which some lie beyond the ends, so that it turns back.
Motion random_curve(const BallScene& made, Random& random) {
  Motion m = random_motion(made, random);
  const auto points = static_cast<std::size_t>(random.integer(3, 8));
  m.points.resize(points, m.points[0]);
  if (random.chance(0.5)) m.points.back() = m.points[0];  // back to the start
  const double size = random.uniform(0.05, 0.4);
  for (std::size_t p = 1; p + 1 < points; ++p)
    for (std::size_t j = 0; j < m.points[p].size(); ++j)
      if (made.scene().joints()[j].upper - m.points[0][j] > size &&
          m.points[0][j] - made.scene().joints()[j].lower > size)
        m.points[p][j] += random.uniform(-size, size);
  return m;
}

// Motions that touch their margin at one time, mostly an end of a span, where bounds on the movement have least to spare.
// A pebble lies where a ball gets to, straight ahead as seen from the middle of the span, or far away towards where the
// ball's path bends.
void decide_motions_to_pebbles(Motion (*make)(const BallScene&, Random&), std::uint64_t seed) {
  Random random(seed);
  const BallScene arm = made_arm(1, 0.0625);
  const std::uint32_t bodies = static_cast<std::uint32_t>(arm.scene().bodies().size()), tool = bodies - 3;
  int free = 0, clear = 0;
  for (int n = 0; n < 900; ++n) {
    const Motion m = make(arm, random);
    const double ends[] = {0, 1, 0.5, 0.25, 0.75, random.uniform(0, 1)};
    const double time = ends[random.integer(0, 5)], middle = time < 0.5 ? time + 0.25 : time > 0.5 ? time - 0.25 : 0.5;
    const double seen = random.chance(0.5) && (time == 0 || time == 1) ? 0.5 : middle;
    const std::uint32_t body = random.chance(0.3) ? tool : arm.link(static_cast<std::size_t>(random.integer(1, 4)));
    const auto there = arm.frames(m.at(time)), before = arm.frames(m.at(seen));
    const OneBall& ball = arm.balls(body)[0];
    const test::RealVec p = point_of(there[body], ball.centre), q = point_of(before[body], ball.centre);
    const bool bends = random.chance(0.4);
    test::RealVec from = q;
    if (bends) {  // the mirror image of the other end
      const test::RealVec other = point_of(arm.frames(m.at(2 * seen - time))[body], ball.centre);
      for (int k = 0; k < 3; ++k) from.x[k] = 2 * q.x[k] - other.x[k];
    }
    const double way = distance_of(p, from), beyond = bends ? random.uniform(0.5, 4) : random.uniform(0.002, 0.02);
    if (way < 1e-4) continue;
    const double ahead = ball.radius + kPebble[0].radius + beyond;
    Vec3d at;
    for (int k = 0; k < 3; ++k) at[k] = static_cast<double>(p.x[k] + (p.x[k] - from.x[k]) * (ahead / way));
    BallScene made = arm;
    const BodyPair pair{body, made.add_obstacle(kPebble, Pose{at})};
    const double d = made.distance(pair, made.frames(m.at(time)));
    const Verdict touching = PairQuery(made, {pair}, m.all(), d * (1 + 1e-9), true).motion();
    EXPECT_NE(touching, Verdict::kFree);
    if (n % 2 == 0) continue;
    const auto least_of = [&](int times) {
      double least = d;
      for (int s = 0; s <= times; ++s) least = std::min(least, made.distance(pair, made.frames(m.at(s * 1.0 / times))));
      return least;
    };
    const double least = least_of(8);
    if (least < 0.001) continue;
    const Verdict apart = PairQuery(made, {pair}, m.all(), 0.5 * least, true).motion();
    ++clear;
    free += apart == Verdict::kFree;
    EXPECT_FALSE(apart == Verdict::kHit && least_of(256) > 0.5 * least);  // times of hits are multiples of 2^-8 at most
  }
  std::printf("motions: %d of %d free\n", free, clear);
  EXPECT_GT(free, clear / 2);
  EXPECT_GT(clear, 100);
}

TEST(MotionDecisions, MotionsThatReachTheirMarginAreNeverFree) {
  decide_motions_to_pebbles(&random_motion, 5);
}
TEST(MotionDecisions, CurvesThatReachTheirMarginAreNeverFree) {
  decide_motions_to_pebbles(&random_curve, 9);
}

// Motions of moved bodies, of which one pair is as near as the margin at one time.
// \param tables may be null
void decide_touching_pairs(Motion (*make)(const BallScene&, Random&), const BallScene& made,
                           const std::vector<BodyPair>& pairs, int count, Random& random, const JointTableStore* tables,
                           Verdicts& verdicts) {
  for (int n = 0; n < count; ++n) {
    std::vector<BodyPair> chosen = pairs;  // one or all, in any order
    std::swap(chosen[0], chosen[static_cast<std::size_t>(random.integer(0, static_cast<int>(pairs.size()) - 1))]);
    if (random.chance(0.5)) chosen.resize(1);
    const Motion m = make(made, random);
    const double times[] = {0, 1, 0.5, 0.25, 0.75, random.uniform(0, 1)};
    const auto there = made.frames(m.at(times[random.integer(0, 5)]));
    double d = HUGE_VAL;
    for (const BodyPair pair : chosen) d = std::min(d, made.distance(pair, there));
    if (d < 0.001) continue;
    EXPECT_NE(PairQuery(made, chosen, m.all(), d * (1 + 1e-9), true, tables).motion(), Verdict::kFree);
    const Verdict verdict = PairQuery(made, chosen, m.all(), std::max(d - 0.15, 0.0), true, tables).motion();
    verdicts.free += verdict == Verdict::kFree;
    verdicts.hit += verdict == Verdict::kHit;
    verdicts.open += verdict == Verdict::kUnresolved;
  }
}

// In the middle the velocities of two joints cancel, and acceleration alone brings a ball near another.
TEST(MotionDecisions, MovedPairsThatTurnBackAreNeverFree) {
  Random random(8);
  const BallScene made({{},
                        {{}, 0, turning({0, 0, 0}, {0, 0, 1})},
                        {{{{0.25, 0, 0}, 0.03125}}, 1, turning({0.5, 0, 0}, {0, 0, 1})},
                        {kPebble, 0, turning({0.375, 0, 0}, {0, 0, 1})}});
  const BodyPair pair{made.link(2), made.link(3)};
  int free = 0;
  for (int n = 0; n < 20; ++n) {
    const double turn = random.sign() * random.uniform(0.02, 0.14);
    const Motion m{{{-turn / 2, 1.5 * turn, 0}, {turn / 2, -1.5 * turn, 0}}};
    const double middle = made.distance(pair, made.frames(m.at(0.5))), d = made.distance(pair, made.frames(m.at(1)));
    EXPECT_LT(d, middle - 2e-5);
    EXPECT_NE(PairQuery(made, {pair}, m.all(), d * (1 + 1e-9), true).motion(), Verdict::kFree);
    free += PairQuery(made, {pair}, m.all(), 0.9 * d, true).motion() == Verdict::kFree;
  }
  EXPECT_EQ(free, 20);
}

void decide_moved_pairs(Motion (*make)(const BallScene&, Random&), std::uint64_t seed) {
  Random random(seed);
  const BallScene one = made_arm(1, 0.0625), many = made_arm(60, 0.015625), folding = made_folding();
  std::vector<BodyPair> pairs = pairs_of(one);
  pairs.erase(pairs.begin(), pairs.begin() + 4);  // those with obstacles
  Verdicts found;
  decide_touching_pairs(make, folding, {{folding.link(1), folding.link(3)}}, 400, random, tables_of(folding).get(),
                        found);
  decide_touching_pairs(make, one, pairs, 1500, random, nullptr, found);
  decide_touching_pairs(make, many, pairs, 100, random, nullptr, found);
  std::printf("moved pairs: %d free, %d hit, %d open\n", found.free, found.hit, found.open);
  EXPECT_GT(found.free, 300);
}

TEST(MotionDecisions, MovedPairsThatReachTheirMarginAreNeverFree) {
  decide_moved_pairs(&random_motion, 6);
}
TEST(MotionDecisions, MovedPairsOnCurvesThatReachTheirMarginAreNeverFree) {
  decide_moved_pairs(&random_curve, 10);
}

}  // namespace
}  // namespace clearance::exact
