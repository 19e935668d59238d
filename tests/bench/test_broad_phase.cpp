// The tree finds the same pairs as brute force, for any positions and motions; boxes enclose their bodies.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "bench/broad/broad_phase.h"
#include "engine/broad/box_tree.h"
#include "engine/evaluate/evaluate.h"
#include "tests/engine/engine_test_util.h"

namespace clearance::test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Boxes that move, jump, disappear and return, of sizes from a speck to the whole volume.
class MovingBoxes {
 public:
  MovingBoxes(std::uint64_t seed, std::size_t count, double room) : random_(seed), room_(room), boxes_(count) {
    for (std::size_t i = 0; i < count; ++i) jump(i);
  }
  const std::vector<Aabb>& boxes() const { return boxes_; }
  void move(double step, std::uint64_t jumps_in) {
    for (std::size_t i = 0; i < boxes_.size(); ++i) {
      const Vec3d d{step * random_.normal(), step * random_.normal(), step * random_.normal()};
      boxes_[i] = {boxes_[i].low + d, boxes_[i].high + d};
      if (jumps_in > 0 && random_.below(jumps_in) == 0) jump(i);
    }
  }

 private:
  void jump(std::size_t i) {
    const Vec3d low{random_.uniform(0, room_), random_.uniform(0, room_), random_.uniform(0, room_)};
    const double size = random_.below(50) == 0 ? 0.3 * room_ : random_.below(10) == 0 ? 1e-9 : 1;
    boxes_[i] = {low, low + Vec3d{random_.uniform(0, size), random_.uniform(0, size), random_.uniform(0, size)}};
    if (random_.below(20) == 0) boxes_[i] = {{kInf, kInf, kInf}, {-kInf, -kInf, -kInf}};  // a body without a pose
    if (random_.below(20) == 0) boxes_[i] = boxes_[random_.below(boxes_.size())];
  }
  Random random_;
  double room_;
  std::vector<Aabb> boxes_;
};

std::vector<BodyPair> pairs_by_brute_force(const std::vector<Aabb>& boxes, double margin) {
  std::vector<BodyPair> pairs;
  for (std::uint32_t a = 0; a < boxes.size(); ++a)
    for (std::uint32_t b = a + 1; b < boxes.size(); ++b)
      if (const double gap = certify_box_gap(boxes[a], boxes[b]); gap < kInf && gap <= margin) pairs.push_back({a, b});
  return pairs;
}

TEST(BroadPhase, AllThreeFindTheSamePairsInTheSameOrder) {
  const auto brute = make_brute_force_broad_phase(2), anew = make_tree_broad_phase(),
             kept = make_tree_broad_phase(2, true);
  MovingBoxes moving(3, 400, 20);
  std::size_t found = 0;
  for (int step = 0; step < 8; ++step, moving.move(0.1, 40))
    for (const double margin : {0.0, 0.7, kInf}) {
      const std::vector<BodyPair> expected = pairs_by_brute_force(moving.boxes(), margin);
      for (const auto* method : {brute.get(), anew.get(), kept.get()}) {
        std::vector<BodyPair> pairs;
        method->candidates(moving.boxes(), margin, pairs);
        EXPECT_EQ(pairs, expected) << method->name() << ", margin " << margin;
      }
      found += expected.size();
    }
  EXPECT_GT(found, 1000u);
}

std::vector<BodyPair> pairs_by_tree(const BoxTree& tree, double margin) {
  std::vector<BodyPair> pairs;
  for (std::uint32_t block = 0; block < tree.blocks(); block += 3)
    tree.pairs_within(block, std::min(tree.blocks(), block + 3), margin, pairs);
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

TEST(BoxTree, FindsThePairsOfBruteForceAsBodiesMove) {
  std::uint64_t found = 0, possible = 0, fits = 0, builds = 0;
  for (const std::size_t count : {0, 1, 2, 7, 8, 9, 63, 64, 65, 200, 513, 900}) {
    MovingBoxes moving(count, count, 3 * std::cbrt(count));
    std::vector<std::uint32_t> ids(count);
    std::iota(ids.begin(), ids.end(), 0u);
    BoxTree tree;
    for (int step = 0; step < 12; ++step, ++fits) {
      tree.fit(ids, moving.boxes());
      for (const double margin : {0.0, 0.4, 3.0, kInf}) {
        if (margin == kInf && count > 100) continue;
        const std::vector<BodyPair> expected = pairs_by_brute_force(moving.boxes(), margin);
        ASSERT_EQ(pairs_by_tree(tree, margin), expected) << count << " bodies, step " << step << ", margin " << margin;
        found += expected.size();
        possible += count * (count - 1) / 2;
      }
      moving.move(step < 6 ? 0.02 : 0.5, step % 4 == 3 ? 3 : 50);
    }
    builds += tree.builds();
  }
  EXPECT_GT(found, 10000u);
  EXPECT_LT(found, possible / 2);
  EXPECT_GT(builds, fits / 10) << "nothing ever wore a tree out";
  EXPECT_LT(builds, fits / 2) << "no order was ever kept";
}

TEST(BoxTree, FindsTheNearestOfBruteForce) {
  std::uint64_t touching = 0, apart = 0, none = 0;
  for (const std::size_t count : {1, 5, 30, 300}) {
    MovingBoxes moving(count + 7, count, 4 * std::cbrt(count));
    std::vector<std::uint32_t> ids(count);
    std::iota(ids.begin(), ids.end(), 0u);
    BoxTree tree;
    for (int step = 0; step < 6; ++step) {
      tree.fit(ids, moving.boxes());
      for (std::uint32_t a = 0; a < count; ++a) {
        double least = kInf;
        for (std::uint32_t b = 0; b < count; ++b)
          if (b != a) least = std::min(least, certify_box_gap(moving.boxes()[a], moving.boxes()[b]));
        double nearest = kInf;
        tree.nearest(moving.boxes()[a], kInf, [&](double gap, std::uint32_t b) {
          if (b != a) nearest = std::min(nearest, gap);
          return nearest;
        });
        ASSERT_EQ(nearest, least);
        (least == kInf ? none : least > 0 ? apart : touching) += 1;
      }
      moving.move(0.1, 30);
    }
  }
  EXPECT_GT(touching, 100u);
  EXPECT_GT(apart, 100u);
  EXPECT_GT(none, 10u);
}

TEST(BoxTree, CoherentMotionKeepsItsOrderAndATeleportMakesANewOne) {
  MovingBoxes moving(1, 2000, 40);
  std::vector<std::uint32_t> ids(2000);
  std::iota(ids.begin(), ids.end(), 0u);
  BoxTree tree;
  for (int step = 0; step < 20; ++step) {
    tree.fit(ids, moving.boxes());
    moving.move(0.01, 0);
  }
  EXPECT_EQ(tree.builds(), 1u);
  moving.move(0.01, 1);
  tree.fit(ids, moving.boxes());
  EXPECT_EQ(tree.builds(), 2u);
  ids.pop_back();
  tree.fit(ids, moving.boxes());
  EXPECT_EQ(tree.builds(), 3u) << "other bodies need another order";
}

// ---- whole answers

void expect_same_rows(const Answer& a, const Answer& b, const std::string& what) {
  ASSERT_EQ(a.info.rows, b.info.rows) << what;
  ASSERT_EQ(a.info.total, b.info.total) << what;
  ASSERT_EQ(a.info.pairs_evaluated, b.info.pairs_evaluated) << what;
  ASSERT_EQ(a.memory.size(), b.memory.size());
  const auto same = [&](const char* name, const auto* x, const auto* y, std::uint64_t width) {
    for (std::uint64_t i = 0; x && i < a.info.rows * width; ++i) {
      if constexpr (std::is_floating_point_v<std::remove_cvref_t<decltype(*x)>>)
        if (std::isnan(x[i]) && std::isnan(y[i])) continue;
      ASSERT_EQ(std::memcmp(&x[i], &y[i], sizeof *x), 0) << what << ", " << name << " of row " << i / width;
    }
  };
  const ReplyView &v = a.view, &w = b.view;
  same("distance", v.distance, w.distance, 1), same("lower", v.lower, w.lower, 1), same("upper", v.upper, w.upper, 1);
  same("status", v.status, w.status, 1), same("flags", v.flags, w.flags, 1), same("pair", v.pair, w.pair, 1);
  same("point_a", v.point_a, w.point_a, 3), same("point_b", v.point_b, w.point_b, 3),
      same("normal", v.normal, w.normal, 3);
  same("configuration", v.configuration, w.configuration, 1), same("pieces", v.parts, w.parts, 2);
}

struct Engines {
  engine::Engine brute, tree;
  explicit Engines(const engine::Scene& scene) : brute(scene, options("brute")), tree(scene, options("tree")) {}
  void set_poses(std::span<const BodyPose> poses) { brute.set_poses(poses), tree.set_poses(poses); }
  static engine::Engine::Options options(const char* by) {
    engine::Engine::Options o;
    o.broad_phase = by;
    o.threads = 2;
    return o;
  }
};

std::uint64_t counter(const engine::Engine& engine, const std::string& name) {
  for (const auto& [key, value] : engine.stats())
    if (key == name) return value;
  ADD_FAILURE() << "no counter " << name;
  return 0;
}

struct Met {
  std::uint64_t rows = 0, incomplete = 0, beyond = 0, bad = 0, overlap = 0;
};

void compare(const Engines& engines, QueryView query, const std::string& what, Met& met) {
  for (const Reduce reduce : {Reduce::kWithin, Reduce::kNearest, Reduce::kMin})
    for (const double max_distance : {0.0, 0.5, 4.0, kInf}) {
      query.reduce = reduce;
      query.max_distance = max_distance;
      query.fields = kAllFields & ~kFieldGradient;
      const Answer a = evaluate(engines.brute, query),
                   b = evaluate(engines.tree, query, std::chrono::microseconds(300));
      expect_same_rows(a, b,
                       what + ", reduce " + std::to_string(int(reduce)) + ", within " + std::to_string(max_distance));
      if (::testing::Test::HasFatalFailure()) return;
      met.rows += a.info.rows;
      for (std::uint64_t i = 0; i < a.info.rows; ++i) {
        const auto status = static_cast<Status>(a.view.status[i]);
        met.incomplete += (a.view.flags[i] & kFlagIncomplete) != 0;
        met.beyond += status == Status::kBeyond;
        met.bad += status == Status::kBadPose || status == Status::kNoPose;
        met.overlap += status == Status::kOverlap;
      }
    }
}

TEST(BroadPhase, ReductionsByTreeHaveTheBitsOfBruteForce) {
  Random random(9);
  Met met;
  for (const int count : {2, 10, 60, 170}) {
    const double room = 1.2 * std::cbrt(count);
    engine::Scene scene = mixed_scene(count, room, static_cast<std::uint64_t>(count));
    if (count > 10) {
      scene.ignore("body2", "*");
      scene.ignore("body3", "body5");
      scene.set_parent("body1", "body0");
      const std::vector<std::string> arm{"body6", "body7", "body8"};
      scene.add_group("arm", arm);
    }
    Engines engines(scene);
    for (int step = 0; step < 6; ++step) {
      const std::string what = std::to_string(count) + " bodies, step " + std::to_string(step);
      compare(engines, {}, what, met);
      if (HasFatalFailure()) return;
      std::vector<BodyPose> poses;
      for (std::uint32_t b = 0; b < scene.bodies().size(); ++b) {
        if (scene.bodies()[b].is_static || random.below(3) == 0) continue;
        BodyPose p{b, engines.tree.body_state(b).X_wb};
        p.pose.translation =
            p.pose.translation + Vec3d{0.05 * random.normal(), 0.05 * random.normal(), 0.05 * random.normal()};
        if (step % 2 == 1 && random.below(8) == 0) p.pose = random.pose(room);  // somewhere else
        if (step == 3 && random.below(6) == 0) p.pose.translation.x = kNan;     // nowhere
        if (step == 4 && random.below(20) == 0) p.pose.translation.y = 1e30;    // far from everything
        poses.push_back(p);
      }
      engines.set_poses(poses);
    }
    if (count <= 10) continue;
    // A sorted list, an unsorted list, a group against everything, and configurations of a few bodies or of all.
    std::vector<BodyPair> some;
    for (const BodyPair pair : engines.tree.pairs({}))
      if (random.below(3) == 0) some.push_back(pair);
    QueryView query;
    query.all_pairs = false;
    query.pairs = some;
    compare(engines, query, "list", met);
    if (HasFatalFailure()) return;
    std::swap(some.front(), some.back());
    some.push_back(some.front());
    some.push_back({1, 5000});
    compare(engines, query, "list out of order", met);
    if (HasFatalFailure()) return;
    const BodyPair arm_to_all[] = {{kGroupBit, kEveryBody}};
    query.pairs = arm_to_all;
    compare(engines, query, "group", met);
    if (HasFatalFailure()) return;
    for (const bool group : {false, true})
      for (const std::uint32_t moved : {1u, 5u, 100u}) {
        std::vector<std::uint32_t> bodies;
        for (std::uint32_t b = 0; b < scene.bodies().size() && bodies.size() < moved; ++b)
          if (!scene.bodies()[b].is_static) bodies.push_back(b);
        std::vector<Pose> configurations;
        for (std::size_t i = 0; i < 3 * bodies.size(); ++i) configurations.push_back(random.pose(room));
        if (moved > 1) configurations[bodies.size() + 1].qw = kNan;
        QueryView moving;
        moving.all_pairs = !group;
        moving.pairs = arm_to_all;
        moving.configuration_count = 3;
        moving.bodies = bodies;
        moving.configurations = configurations;
        compare(engines, moving, std::to_string(moved) + " moved", met);
        if (HasFatalFailure()) return;
      }
    EXPECT_EQ(counter(engines.brute, "engine.box_trees"), 0u);
    EXPECT_GT(counter(engines.tree, "engine.box_trees"), 0u);
  }
  EXPECT_GT(met.rows, 10000u);
  EXPECT_GT(met.incomplete, 100u);
  EXPECT_GT(met.beyond, 100u);
  EXPECT_GT(met.bad, 100u);
  EXPECT_GT(met.overlap, 100u);
}

TEST(BroadPhase, ASceneWithoutAnyPoseIsAnsweredByTreeToo) {
  engine::Scene scene;
  for (int i = 0; i < 150; ++i) scene.add_sphere("s" + std::to_string(i), 0.1, {});
  Engines engines(scene);
  Met met;
  compare(engines, {}, "no poses", met);
  EXPECT_GT(met.bad, 100u);
}

TEST(BroadPhase, ATreeStaysWithTheEngineWhileMotionIsCoherent) {
  const engine::Scene scene = mixed_scene(400, 10, 5);
  engine::Engine engine(scene);
  QueryView query;
  query.reduce = Reduce::kWithin;
  query.max_distance = 0.1;
  for (int step = 0; step < 20; ++step) {
    evaluate(engine, query);
    const BodyPose nudge[] = {{0, engine.body_state(0).X_wb}};
    engine.set_poses(nudge);
  }
  EXPECT_EQ(counter(engine, "engine.box_trees"), 1u);
  EXPECT_LT(counter(engine, "engine.box_tree_bytes"), 400u * 200u);
}

TEST(Boxes, HoldEveryVertexAtAnyPose) {
  Random random(4);
  for (int round = 0; round < 500; ++round) {
    const double size = std::pow(10, random.uniform(-9, 9)), place = std::pow(10, random.uniform(-9, 9));
    const ConvexPartPtr part = make_convex_part(random.cloud(10, {size, size, size}), random.below(2) ? size : 0.0);
    const Pose X = random.pose(place);
    const Mat3<DoubleDouble> R = rotation_of_double_double(X);
    const Aabb box = certify_box(*part, rotation_of(X), X.translation);
    for (const Vec3d& v : part->vertices) {
      const Vec3<DoubleDouble> p = R * cast<DoubleDouble>(v) + cast<DoubleDouble>(X.translation);
      for (int k = 0; k < 3; ++k) {
        EXPECT_TRUE(DoubleDouble(box.low[k]) <= p[k] - DoubleDouble(part->radius));
        EXPECT_TRUE(DoubleDouble(box.high[k]) >= p[k] + DoubleDouble(part->radius));
      }
    }
  }
}

}  // namespace
}  // namespace clearance::test
