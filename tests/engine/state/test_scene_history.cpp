// Queries that remain valid when a scene changes.
#include <gtest/gtest.h>

#include "engine/engine.h"
#include "engine/selection/query.h"

namespace clearance {
namespace {

engine::Scene::BodyOptions at_x(double x) {
  engine::Scene::BodyOptions options;
  options.pose = Pose{{x, 0, 0}};
  return options;
}

/// 0 to 5: balls; groups left (0, 1, 2) and right (3, 4).
engine::Scene six_balls() {
  engine::Scene scene;
  for (int i = 0; i < 6; ++i) scene.add_sphere("ball" + std::to_string(i), 0.1, at_x(i));
  scene.add_group("left", std::vector<std::string>{"ball0", "ball1", "ball2"});
  scene.add_group("right", std::vector<std::string>{"ball3", "ball4"});
  return scene;
}
constexpr std::uint32_t kLeft = kGroupBit | 0, kRight = kGroupBit | 1;

bool answers(const engine::Engine& engine, std::vector<BodyPair> pairs, std::uint64_t revision,
             Reduce reduce = Reduce::kNone) {
  QueryView query;
  query.pairs = pairs;
  query.all_pairs = pairs.empty();
  query.reduce = reduce;
  query.scene_revision = revision;
  try {
    engine.size(query);
    return true;
  } catch (const engine::QueryError& error) {
    EXPECT_EQ(error.code, QueryErrorCode::kWrongScene) << error.what();
    return false;
  }
}

TEST(SceneHistory, AnAttachmentChangesThePairsOfChildAndParent) {
  engine::Engine engine(six_balls(), {.threads = 1});
  const std::uint64_t before = engine.scene_revision();
  engine.attach(1, 4);
  EXPECT_TRUE(answers(engine, {{1, 4}}, before));
  EXPECT_FALSE(answers(engine, {{kLeft, kRight}}, before)) << "one pair less";
  EXPECT_FALSE(answers(engine, {{kRight, kLeft}}, before));
  EXPECT_FALSE(answers(engine, {{kLeft, kEveryBody}}, before));
  EXPECT_FALSE(answers(engine, {{1, kRight}}, before));
  EXPECT_TRUE(answers(engine, {{kLeft, kLeft}}, before));
  EXPECT_TRUE(answers(engine, {{kLeft, 5}, {0, kRight}}, before));
  EXPECT_TRUE(answers(engine, {{0, kEveryBody}}, before));
  EXPECT_FALSE(answers(engine, {{kEveryBody, kEveryBody}}, before));
  EXPECT_FALSE(answers(engine, {}, before));
  // Detaching restores the original scene; another attachment starts from there.
  const std::uint64_t between = engine.scene_revision();
  engine.attach(1, kNone);
  ASSERT_EQ(engine.scene_revision(), before);
  EXPECT_TRUE(answers(engine, {}, before));
  EXPECT_FALSE(answers(engine, {{kLeft, kRight}}, between));
  engine.attach(2, 5);
  EXPECT_TRUE(answers(engine, {{kLeft, kRight}}, before));
  EXPECT_FALSE(answers(engine, {{kLeft, kRight}}, between));
  EXPECT_TRUE(engine.ids_valid_since(before, std::vector<std::uint32_t>{1, kLeft}, true));
  EXPECT_FALSE(engine.ids_valid_since(before, std::vector<std::uint32_t>{1, 2}, true));
  EXPECT_TRUE(engine.ids_valid_since(before, std::vector<std::uint32_t>{1, 2}, false));
}

/// The same parts, as in a scene that is edited.
engine::Scene edited(const engine::Engine& engine, const std::vector<std::string>& without, int with) {
  engine::Scene scene;
  for (const Body& body : engine.scene().bodies())
    if (std::find(without.begin(), without.end(), body.name) == without.end()) scene.add_body(body);
  for (int i = 0; i < with; ++i) scene.add_sphere("new" + std::to_string(i), 0.2, at_x(10 + i));
  scene.add_group("left", std::vector<std::string>{"ball0", "ball1", "ball2"});
  scene.add_group("right", std::vector<std::string>{"ball3", "ball4"});
  return scene;
}

TEST(SceneHistory, BodiesThatComeAndGoChangeTheirIdsAndEveryBody) {
  engine::Engine first(six_balls(), {.threads = 1});
  const std::uint64_t before = first.scene_revision();
  engine::Engine more(edited(first, {}, 2), {.threads = 1});
  more.take_poses(first);
  EXPECT_TRUE(answers(more, {{0, 5}, {kLeft, kRight}}, before));
  EXPECT_FALSE(answers(more, {{0, 6}}, before)) << "unknown then, a body now";
  EXPECT_TRUE(answers(more, {{0, 99}}, before)) << "unknown then and now";
  EXPECT_FALSE(answers(more, {{kLeft, kEveryBody}}, before));
  EXPECT_FALSE(answers(more, {}, before));
  EXPECT_FALSE(answers(more, {{0, 5}}, before, Reduce::kNearest)) << "a row more for each body more";
  EXPECT_TRUE(answers(more, {{0, 5}}, before, Reduce::kMin));
  const std::uint64_t with_two = more.scene_revision();
  engine::Engine fewer(edited(more, {"new0"}, 0), {.threads = 1});
  fewer.take_poses(more);
  ASSERT_EQ(fewer.scene().bodies()[6].name, "new1");
  EXPECT_FALSE(answers(fewer, {{0, 6}}, with_two)) << "another body has this id";
  EXPECT_FALSE(answers(fewer, {{0, 7}}, with_two)) << "and nobody that";
  for (const std::uint64_t revision : {before, with_two})
    EXPECT_TRUE(answers(fewer, {{0, 5}, {kLeft, kRight}}, revision));
  EXPECT_FALSE(answers(fewer, {{0, 5}}, before + 1)) << "a revision that never was";
}

TEST(SceneHistory, ASceneThatWasLoadedAgainIsAnotherOne) {
  engine::Engine first(six_balls(), {.threads = 1});
  engine::Scene changed = six_balls();
  changed.add_sphere("seventh", 0.1, at_x(7));
  engine::Engine second(std::move(changed), {.threads = 1});
  second.take_poses(first);
  EXPECT_FALSE(answers(second, {{0, 1}}, first.scene_revision())) << "its geometry may be another";
}

TEST(SceneHistory, PairsThatAreIgnoredNowAreNotThoseThatWere) {
  engine::Engine first(six_balls(), {.threads = 1});
  engine::Scene scene = edited(first, {}, 0);
  scene.ignore("ball0", "ball3");
  engine::Engine second(std::move(scene), {.threads = 1});
  second.take_poses(first);
  ASSERT_NE(second.scene_revision(), first.scene_revision());
  EXPECT_FALSE(answers(second, {{kLeft, kRight}}, first.scene_revision()));
  EXPECT_TRUE(answers(second, {{kLeft, kLeft}}, first.scene_revision()));
}

TEST(SceneHistory, WhatIsTooOldIsUnknown) {
  engine::Engine engine(six_balls(), {.threads = 1});
  engine.attach(0, 5);
  const std::uint64_t old = engine.scene_revision();
  bool known = true;
  int changes = 0;
  for (; known && changes < 20'000; ++changes) {
    engine.attach(1, 2 + static_cast<std::uint32_t>(changes % 3));
    if (changes == 0) engine.attach(0, kNone);  // prevents the recurrence of `old`
    known = answers(engine, {{3, 4}}, old);
  }
  EXPECT_FALSE(known) << "memory would grow with every change";
  EXPECT_GT(changes, 1000);
  EXPECT_TRUE(answers(engine, {{3, 4}}, engine.scene_revision()));
}

}  // namespace
}  // namespace clearance
