// Free bodies along lines and curves that turn or grow, which come up to their margin at one time.
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <vector>

#include "tests/engine/motion/motion_test.h"
#include "tests/temporary_folder.h"

namespace clearance::test {
namespace {

/// A ball that stays, a ball around its origin and one off it, which moves when its body turns.
struct Balls {
  static constexpr double kRadius = 0.1, kOffset = 0.25;

  engine::Scene scene;
  Motions motion;
  std::vector<std::array<double, 3>> centre{{0, 0, 0}, {0, 0, 0}, {kOffset, 0, 0}};

  Balls() {
    scene.add_sphere("still", kRadius, {.is_static = true, .pose = Pose{}});
    motion.bodies = {scene.add_sphere("ball", kRadius, {.pose = Pose{{3, 0, 0}}})};
    const Vec3d offset{kOffset, 0, 0};
    engine::Scene::BodyOptions options;
    options.pose = Pose{{0, 3, 0}};
    options.radius = kRadius;
    motion.bodies.push_back(scene.add_hull("offset", std::span(&offset, 1), options));
  }

  double curve(const double* points, std::size_t stride, double t) const {
    double q[8];
    for (std::uint32_t p = 0; p < motion.points; ++p) q[p] = points[p * stride];
    for (std::uint32_t left = motion.points - 1; left > 0; --left)
      for (std::uint32_t i = 0; i < left; ++i) q[i] += t * (q[i + 1] - q[i]);
    return q[0];
  }
  /// Of a moving body's ball; bodies turn about z.
  Vec3d at(std::size_t body, double t) const {
    const Pose* const X = motion.poses.data() + body;
    Vec3d p{0, 0, 0};
    for (int k = 0; k < 3; ++k) p[k] = curve(&X->translation.x + k, 14, t);
    if (body == 0) return p;
    const Pose& end = X[motion.points == 2 ? 2 : 0];
    const double first = 2 * std::atan2(X->qz, X->qw), by = 2 * std::atan2(end.qz, end.qw) - first;
    return p + Vec3d{std::cos(first + t * by), std::sin(first + t * by), 0} * kOffset;
  }
  double distance(BodyPair pair, double t) const {
    double grown = 0;
    Vec3d apart{0, 0, 0};
    for (const std::uint32_t body : {pair.a, pair.b}) {
      if (body == 0) continue;
      if (!motion.growths.empty()) grown += curve(motion.growths.data() + body - 1, 2, t);
      apart = at(body - 1, t) - apart;
    }
    return norm(apart) - 2 * kRadius - grown;
  }
  double least(BodyPair pair) const {
    constexpr int kTimes = 600;
    int best = 0;
    for (int i = 1; i <= kTimes; ++i)
      if (distance(pair, 1.0 * i / kTimes) < distance(pair, 1.0 * best / kTimes)) best = i;
    double low = std::max(best - 1, 0) / 600.0, high = std::min(best + 1, kTimes) / 600.0;
    for (int i = 0; i < 80; ++i) {
      const double a = low + (high - low) / 3, b = high - (high - low) / 3;
      (distance(pair, a) < distance(pair, b) ? high : low) = distance(pair, a) < distance(pair, b) ? b : a;
    }
    return std::min({distance(pair, low), distance(pair, 0), distance(pair, 1)});
  }
};

// A motion whose bodies pass each other and the ball that stays.
void make_motion(Random& random, Balls& balls) {
  Motions& motion = balls.motion;
  motion.points = random.below(3) ? 2 + static_cast<std::uint32_t>(random.below(7)) : 2;
  motion.poses.assign(2 * std::size_t{motion.points}, {});
  const bool grows = random.below(2) != 0, moves[2] = {random.below(4) != 0, random.below(4) != 0};
  for (std::size_t b = 0; b < 2; ++b) {
    const double start = random.uniform(-1, 1), end = motion.points == 2 ? start + random.uniform(-3, 3) : start;
    Vec3d from{0, 0, 0};
    for (int k = 0; k < 3; ++k) from[k] = random.uniform(-1.2, 1.2);
    for (std::uint32_t p = 0; p < motion.points; ++p) {
      Pose& X = motion.poses[p * 2 + b];
      X.translation = from;
      for (int k = 0; k < 3 && p > 0 && moves[b]; ++k) X.translation[k] += random.uniform(-1, 1);
      const double angle = p == 0 ? start : end;
      X.qw = std::cos(angle / 2), X.qz = std::sin(angle / 2);
    }
  }
  motion.growths.clear();
  for (std::size_t i = 0; grows && i < motion.poses.size(); ++i)
    motion.growths.push_back(random.below(3) ? random.uniform(0, 0.3) : 0);
}

struct Counts {
  int near = 0, beyond = 0, free = 0, hit = 0;
};
/// Motions with margins near their least distance.
/// \param is_free answers one
Counts check(std::uint64_t seed, int count, double far, const std::function<bool(const Balls&, QueryView)>& is_free) {
  Random random(seed);
  Balls balls;
  Counts counts;
  for (int i = 0; i < count; ++i) {
    make_motion(random, balls);
    const BodyPair pairs[] = {{0, 1}, {0, 2}, {1, 2}};
    const BodyPair pair = pairs[random.below(3)];
    const double least = balls.least(pair), graze = std::pow(10, random.uniform(-7, -4));
    if (least < 0.05) continue;
    balls.motion.pairs = {pair};
    QueryView query = balls.motion.view(Reduce::kAny, 4096);
    query.fields = kFieldVerdict;
    query.margin = least + graze;
    EXPECT_FALSE(is_free(balls, query)) << i << " beyond " << least << " by " << graze;
    ++counts.near;
    query.margin = std::max(least - (far > 0 ? far : graze), 0.0);
    counts.free += is_free(balls, query);
    ++counts.beyond;
  }
  return counts;
}

TEST(Meanwhile, BodiesThatComeUpToTheirMarginAreDecided) {
  const engine::Engine engine = engine_of(Balls().scene);
  const Counts counts = check(1, 1500, 0, [&](const Balls&, QueryView query) {
    return static_cast<Status>(evaluate(engine, query).view.verdict[0]) == Status::kBeyond;
  });
  EXPECT_GT(counts.near, 700);
  EXPECT_GT(counts.free, counts.beyond - counts.beyond / 20) << "few are undecided";
}

TEST(Meanwhile, CoversNeverProveThemFree) {
  const engine::Engine engine(Balls().scene, {.backend = "cpu", .threads = 1});
  ASSERT_TRUE(engine.wait_covers(std::chrono::seconds(60)));
  int by_covers = 0;
  const Counts counts = check(2, 3000, 0.05, [&](const Balls&, QueryView query) {
    query.max_evaluations = 1;  // so that the exact engine proves little
    const Answer answer = evaluate(engine, query);
    by_covers += answer.info.pairs_evaluated == 0;
    return static_cast<Status>(answer.view.verdict[0]) == Status::kBeyond;
  });
  std::printf("%d of %d free by covers or one evaluation, %d by covers alone\n", counts.free, counts.beyond, by_covers);
  EXPECT_GT(counts.near, 1400);
  EXPECT_GT(counts.free, counts.beyond - counts.beyond / 20);
  EXPECT_GT(by_covers, counts.beyond);
}

// Motions that come near, with margins a little more and a little less than their least distance; hits that growth alone
// makes are counted.
TEST(Meanwhile, CoversFindHitsOfGrowth) {
  const engine::Engine engine(Balls().scene, {.backend = "cpu", .threads = 1});
  ASSERT_TRUE(engine.wait_covers(std::chrono::seconds(60)));
  Random random(5);
  Balls balls, still;
  int near[2] = {0, 0}, by_growth[2] = {0, 0}, by_covers[2] = {0, 0};
  for (int i = 0; i < 6000; ++i) {
    make_motion(random, balls);
    const BodyPair pairs[] = {{0, 1}, {0, 2}, {1, 2}};
    const BodyPair pair = pairs[random.below(3)];
    const double least = balls.least(pair);
    if (balls.motion.growths.empty() || least < 0.05) continue;
    balls.motion.pairs = {pair};
    QueryView query = balls.motion.view(Reduce::kAny, 1);  // so that the exact engine proves little
    query.fields = kFieldVerdict;
    const auto is_hit = [&] {
      const Answer answer = evaluate(engine, query);
      const auto verdict = static_cast<Status>(answer.view.verdict[0]);
      const bool hits = verdict == Status::kOk || verdict == Status::kOverlap;
      by_covers[pair.a] += hits && answer.info.pairs_evaluated == 0;
      return hits;
    };
    query.margin = least - std::pow(10, random.uniform(-7, -4));
    EXPECT_FALSE(is_hit()) << i << " within " << query.margin << ", but never nearer than " << least;
    ++near[pair.a];
    query.margin = least + 0.02;
    still.motion = balls.motion;
    still.motion.growths.clear();
    if (still.least(pair) < query.margin) continue;
    is_hit();
    ++by_growth[pair.a];
  }
  std::printf("%d and %d of %d and %d hits of growth alone by covers\n", by_covers[0], by_covers[1], by_growth[0],
              by_growth[1]);
  for (const int moved : {0, 1}) {
    EXPECT_GT(near[moved], 300);
    EXPECT_GT(by_growth[moved], 150);
    EXPECT_GT(by_covers[moved], by_growth[moved] * 3 / 4);
  }
}

// Two arms of 1 m, which turn about z, with balls as tips.
TEST(Meanwhile, CoversDecideTwoRobots) {
  const TemporaryFolder folder;
  engine::RobotOptions options;
  options.urdf = folder.write(
      "r.urdf",
      "<robot name='r'><link name='base'/><link name='tip'><collision><origin xyz='1 0 0'/><geometry><sphere "
      "radius='0.1'/></geometry></collision></link><joint name='turn' type='continuous'><parent link='base'/><child "
      "link='tip'/><axis xyz='0 0 1'/></joint></robot>");
  options.home.emplace();
  engine::Scene scene;
  scene.add_robot("a", options);
  const double turn = 2.5;
  options.base = Pose{{1.2, 0.4, 0.15}};
  options.base.qw = std::cos(turn / 2), options.base.qz = std::sin(turn / 2);
  scene.add_robot("b", options);
  Motions motion;
  motion.joints = {0, 1};
  motion.pairs = {{scene.find_body("a/tip"), scene.find_body("b/tip")}};
  const engine::Engine engine(std::move(scene), {.backend = "cpu", .threads = 1});
  ASSERT_TRUE(engine.wait_covers(std::chrono::seconds(60)));
  Random random(4);
  int free = 0, apart = 0;
  for (int i = 0; i < 400; ++i) {
    motion.positions.clear();
    for (int k = 0; k < 4; ++k) motion.positions.push_back(random.uniform(-2, 2));
    const auto tip = [&](int arm, double t) {
      const double q = motion.positions[arm] + t * (motion.positions[2 + arm] - motion.positions[arm]) + arm * turn;
      return Vec3d{std::cos(q), std::sin(q), 0} + (arm ? options.base.translation : Vec3d{0, 0, 0});
    };
    double least = 10;
    for (int k = 0; k <= 2000; ++k) least = std::min(least, norm(tip(0, k / 2000.0) - tip(1, k / 2000.0)) - 0.2);
    if (least < 0.1) continue;
    QueryView query = motion.view(Reduce::kAny);
    query.fields = kFieldVerdict;
    query.margin = least + 1e-7;
    EXPECT_NE(static_cast<Status>(evaluate(engine, query).view.verdict[0]), Status::kBeyond) << i;
    query.margin = least - 0.05;
    const Answer answer = evaluate(engine, query);
    ++apart;
    free += answer.info.pairs_evaluated == 0 && static_cast<Status>(answer.view.verdict[0]) == Status::kBeyond;
  }
  EXPECT_GT(apart, 100);
  EXPECT_GT(free, apart / 2) << "covers decide most of them";
}

TEST(Meanwhile, WrongGrowthsAndTurnsAreRejectedByName) {
  Random random(3);
  const engine::Engine engine = engine_of(Balls().scene);
  const auto error_of = [&](std::uint32_t points, const std::function<void(Motions&)>& change) -> std::string {
    Balls balls;
    do make_motion(random, balls);
    while (balls.motion.points != points);
    balls.motion.growths.assign(balls.motion.poses.size(), 0.1);
    change(balls.motion);
    try {
      evaluate(engine, balls.motion.view(Reduce::kAny));
    } catch (const engine::QueryError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(error_of(3, [](Motions&) {}), "");
  EXPECT_EQ(error_of(3, [](Motions& m) { m.growths[4] = -1; }),
            "growths[4]: expected metres from 0 to 1000, got -1.000000");
  EXPECT_EQ(error_of(2, [](Motions& m) { m.growths.pop_back(); }), "growths: expected 4 numbers (2 x 2), got 3");
  EXPECT_EQ(error_of(3, [](Motions& m) { m.poses[5].qx = 1; }),
            "configurations: bodies[1] turns in motion 0; with more than 2 control_points bodies keep their rotation");
}

}  // namespace
}  // namespace clearance::test
