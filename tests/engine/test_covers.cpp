// Covers of an engine's bodies: which ones it makes, and that engines of a changed scene share them.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <set>
#include <thread>
#include <vector>

#include "engine/cover/cover_store.h"
#include "engine/editor/scene_editor.h"
#include "tests/engine/crowded_arm.h"
#include "tests/engine/engine_test_util.h"
#include "tests/engine/evaluate_query.h"

namespace clearance::test {
namespace {

constexpr std::chrono::minutes kPatience{10};

class CoversTest : public testing::Test {
 protected:
  void SetUp() override { ::setenv("CLEARANCE_CACHE", "off", 1); }
};

std::optional<std::uint64_t> counter(const engine::Engine& engine, const std::string& name) {
  for (const auto& [known, value] : engine.stats())
    if (known == name) return value;
  return {};
}

TEST_F(CoversTest, AreMadeForBodiesThatMayMove) {
  const engine::Engine engine(arm_scene(at_home()), {.backend = "cpu", .threads = 1});
  ASSERT_TRUE(engine.wait_covers(kPatience));
  std::set<const Cover*> covers;
  std::uint64_t bytes = 0;
  for (const Body& body : engine.scene().bodies()) {
    const auto cover = engine.cover_store()->find(body.parts);
    EXPECT_EQ(cover != nullptr, body.name != "table" && !body.parts.empty()) << body.name;
    if (cover && covers.insert(cover.get()).second) bytes += cover->resident_bytes();
  }
  EXPECT_GT(covers.size(), 2);
  EXPECT_EQ(counter(engine, "engine.covers"), covers.size());
  EXPECT_EQ(counter(engine, "engine.covers_pending"), 0);
  EXPECT_EQ(counter(engine, "engine.covers_impossible"), 0);
  EXPECT_EQ(counter(engine, "engine.cover_bytes"), bytes);
}

TEST_F(CoversTest, CanBeOff) {
  const engine::Engine engine(arm_scene(at_home()), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  EXPECT_EQ(engine.cover_store(), nullptr);
  EXPECT_TRUE(engine.wait_covers(std::chrono::nanoseconds(0)));
  EXPECT_FALSE(counter(engine, "engine.covers"));
  EXPECT_EQ(engine::covers_named("off"), engine::Covers::kOff);
  EXPECT_EQ(engine::covers_named("background"), engine::Covers::kBackground);
  EXPECT_THROW(engine::covers_named("on"), std::invalid_argument);
}

TEST_F(CoversTest, LinksComeFirstAndOtherShapesAreLimited) {
  Random random(7);
  engine::Scene scene;
  for (int i = 0; i < 200; ++i)
    scene.add_hull("loose" + std::to_string(i), random.cloud(5, {0.1, 0.1, 0.1}), {.pose = Pose{{0.0 + i, 3, 0}}});
  scene.add_box("fixed", {1, 1, 1}, {.is_static = true});
  scene.add_half_space("floor", {});
  scene.add_points("cloud", std::vector<CloudPoint>(3), 0, {.pose = Pose{}});
  scene.add_robot("arm", at_home());
  std::size_t links = 0;
  std::vector<std::string> names;
  for (const std::uint32_t id : engine::bodies_to_cover(scene)) {
    const Body& body = scene.bodies()[id];
    links += body.robot != kNone;
    EXPECT_TRUE(body.robot == kNone || links == names.size() + 1) << body.name << " comes late";
    EXPECT_TRUE(body.robot != kNone || body.name.starts_with("loose")) << body.name;
    names.push_back(body.name);
  }
  EXPECT_GT(links, 2);
  EXPECT_EQ(names.size(), links + 64);
}

TEST_F(CoversTest, AreMadeForCloudsThatMayMove) {
  engine::Scene scene(arm_scene(at_home()));
  Random random(9);
  std::vector<CloudPoint> points;
  for (const Vec3d& p : random.cloud(200, {0.1, 0.1, 0.1}))
    points.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
  scene.add_points("seen", points, 0, {.radius = 0.01, .parent = "arm/palm", .pose = Pose{}});
  scene.add_points("scan", points, 0, {.radius = 0.02, .is_static = true, .pose = Pose{{2, 0, 0}}});
  scene.add_points("empty", {}, 0, {.parent = "arm/palm", .pose = Pose{}});
  const engine::Engine engine(std::move(scene), {.backend = "cpu", .threads = 1});
  ASSERT_TRUE(engine.wait_covers(kPatience));
  for (const Body& body : engine.scene().bodies())
    if (is_cloud(body)) {
      EXPECT_EQ(engine.cover_store()->find(body.parts) != nullptr, body.name == "seen") << body.name;
    }
}

/// Points in a cube of 0.2 m.
std::vector<CloudPoint> some_points(std::uint64_t seed) {
  Random random(seed);
  std::vector<CloudPoint> points;
  for (const Vec3d& p : random.cloud(200, {0.1, 0.1, 0.1}))
    points.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
  return points;
}
/// The crowded scene, in which the palm carries a cloud.
engine::Scene with_carried_cloud() {
  engine::Scene scene = crowded_scene(false);
  scene.add_points("seen", some_points(9), 0, {.radius = 0.01, .parent = "arm/palm", .pose = Pose{{0, 0, 0.25}}});
  scene.add_points("scan", {}, 0, {.is_static = true, .pose = Pose{{2, 0, 0}}});
  for (const char* link :
       {"arm/fore", "arm/wrist", "arm/palm", "arm/flange", "arm/left_finger", "arm/right_finger", "held"})
    scene.ignore("seen", link);
  return scene;
}
/// Verdicts about the carried cloud and obstacles.
Answer verdicts_of_seen(const engine::Engine& engine) {
  ArmStates s(engine.scene(), 300);
  std::vector<BodyPair> pairs;
  const std::uint32_t seen = engine.scene().find_body("seen");
  for (const char* name : {"rod", "post", "cone", "rock", "table"}) {
    const std::uint32_t b = engine.scene().find_body(name);
    pairs.push_back({std::min(b, seen), std::max(b, seen)});
  }
  s.query.all_pairs = false;
  s.query.pairs = pairs;
  s.query.fields = kFieldVerdict | kFieldPair;
  return evaluate(engine, s.query);
}
/// Returns the number of states that are hit.
int expect_same_verdicts(const Answer& without, const Answer& with) {
  int hits = 0;
  for (std::uint64_t k = 0; k < without.size.rows; ++k) {
    EXPECT_EQ(without.view.verdict[k], with.view.verdict[k]) << k;
    EXPECT_EQ(without.view.pair[k].a, with.view.pair[k].a) << k;
    hits += without.view.verdict[k] == static_cast<std::uint8_t>(Status::kOk);
  }
  return hits;
}

void points_that_are_set_get_one(engine::Engine& with) {
  engine::Engine without(with_carried_cloud(), {.backend = "cpu", .threads = 1, .covers = engine::Covers::kOff});
  const std::uint64_t covers = counter(with, "engine.covers").value();
  const std::uint32_t seen = with.scene().find_body("seen");
  for (const std::uint64_t seed : {31, 32}) {
    for (engine::Engine* engine : {&with, &without}) engine->set_points(seen, some_points(seed), 0.02);
    const Answer expected = verdicts_of_seen(without);
    expect_same_verdicts(expected, verdicts_of_seen(with));  // with or without its cover
    ASSERT_TRUE(with.wait_covers(kPatience));
    EXPECT_EQ(counter(with, "engine.covers"), covers + 1) << "that of earlier points is dropped";
    const Answer decided = verdicts_of_seen(with);
    const int hits = expect_same_verdicts(expected, decided);
    EXPECT_GT(hits, 20);
    EXPECT_LT(hits, 280);
    EXPECT_LT(decided.info.pairs_evaluated, expected.info.pairs_evaluated / 4) << "covers decide most pairs";
  }
  with.set_points(with.scene().find_body("scan"), some_points(33));
  EXPECT_EQ(counter(with, "engine.covers_pending"), 0) << "a cloud that stays needs none";
  with.set_points(seen, {});
  EXPECT_EQ(counter(with, "engine.covers_pending"), 0);
  EXPECT_EQ(counter(with, "engine.covers"), covers);
}

void points_that_are_replaced_soon_get_none(engine::Engine& engine) {
  constexpr std::chrono::milliseconds kGrace{100};
  const std::uint64_t revision = engine.cover_store()->revision();
  const std::uint32_t seen = engine.scene().find_body("seen");
  const auto begin = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0; i < 200; ++i) {
    engine.set_points(seen, some_points(i));
    ASSERT_LE(counter(engine, "engine.covers_pending"), 3) << "earlier ones are dropped";
  }
  const std::uint64_t made = engine.cover_store()->revision() - revision;
  EXPECT_LE(made, (std::chrono::steady_clock::now() - begin) / kGrace);
  ASSERT_TRUE(engine.wait_covers(kPatience));
  EXPECT_GT(engine.cover_store()->revision(), revision) << "the last ones get one";
}

void a_changed_scene_keeps_those_of_points(SceneEditor& editor, std::uint64_t covers) {
  // The thread that made a cover of earlier points holds it for a moment longer.
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (counter(*editor.engine(), "engine.covers") != covers && std::chrono::steady_clock::now() < end)
    std::this_thread::yield();
  ASSERT_EQ(counter(*editor.engine(), "engine.covers"), covers);
  const auto add = [](const engine::Engine&) {
    return make_body("ground", {wire::BodyShape::kHalfSpace, {0, 0, 0}}, {.is_static = true, .pose = Pose{{0, 0, -3}}});
  };
  const std::shared_ptr<engine::Engine> next = editor.add(add).engine;
  EXPECT_EQ(counter(*next, "engine.covers_pending"), 0);
  EXPECT_EQ(counter(*next, "engine.covers"), covers);
}

// In one process: the covers take seconds.
TEST_F(CoversTest, AreMadeForPointsThatAreSet) {
  SceneEditor editor(with_carried_cloud(), {.backend = "cpu", .threads = 1});
  ASSERT_TRUE(editor.engine()->wait_covers(kPatience));
  const std::uint64_t covers = counter(*editor.engine(), "engine.covers").value();
  points_that_are_set_get_one(*editor.engine());
  points_that_are_replaced_soon_get_none(*editor.engine());
  a_changed_scene_keeps_those_of_points(editor, covers + 1);
}

TEST_F(CoversTest, OneShapeHasOneCover) {
  engine::Scene scene;
  for (int i = 0; i < 5000; ++i) scene.add_box("box" + std::to_string(i), {1, 1, 1}, {.pose = Pose{{2.0 * i, 0, 0}}});
  EXPECT_EQ(engine::bodies_to_cover(scene), std::vector<std::uint32_t>{0});
}

TEST_F(CoversTest, AChangedSceneSharesThem) {
  engine::Scene scene;
  scene.add_sphere("ball", 0.1, {.pose = Pose{}});
  SceneEditor editor(scene, {.backend = "cpu", .threads = 1});
  ASSERT_TRUE(editor.engine()->wait_covers(kPatience));
  const auto add = [](const engine::Engine&) {
    return make_body("other", {wire::BodyShape::kSphere, {0.2, 0, 0}}, {.pose = Pose{{1, 0, 0}}});
  };
  const std::shared_ptr<engine::Engine> next = editor.add(add).engine;
  EXPECT_TRUE(next->cover_store()->find(next->scene().bodies()[0].parts)) << "there from the start";
  ASSERT_TRUE(next->wait_covers(kPatience));
  EXPECT_EQ(counter(*next, "engine.covers"), 2);
  EXPECT_TRUE(next->cover_store()->find(next->scene().bodies()[1].parts));
}

}  // namespace
}  // namespace clearance::test
