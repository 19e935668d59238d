// Covers of an engine's bodies: which ones it makes, and that engines of a changed scene share them.
#include <gtest/gtest.h>

#include <cstdlib>
#include <set>

#include "engine/cover/cover_store.h"
#include "engine/editor/scene_editor.h"
#include "tests/engine/arm_scene.h"
#include "tests/engine/engine_test_util.h"

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
