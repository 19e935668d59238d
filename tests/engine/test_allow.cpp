// Pairs that may touch, changed at run time.
#include <algorithm>
#include <numeric>

#include "tests/engine/engine_test.h"

namespace clearance::test {
namespace {

// Balls 0 to 4 and a static floor, 5; the scene ignores 0 with 1. The group "hand" is 1 and 2.
engine::Scene six(bool with_more = false) {
  engine::Scene scene;
  for (int i = 0; i < 5; ++i) scene.add_sphere("ball" + std::to_string(i), 0.1, {.pose = Pose{{1.0 * i, 0, 0}}});
  scene.add_box("floor", {9, 9, 0.1}, {.is_static = true, .pose = Pose{{0, 0, -1}}});
  if (with_more) scene.add_sphere("more", 0.1, {.pose = Pose{{0, 5, 0}}});
  scene.add_group("hand", std::vector<std::string>{"ball1", "ball2"});
  scene.ignore("ball0", "ball1");
  return scene;
}
constexpr std::uint32_t kHand = kGroupBit, kFloor = 5;

bool is_enabled(const engine::Engine& engine, std::uint32_t a, std::uint32_t b) {
  const std::vector<BodyPair> pairs = engine.pairs({});
  return std::find(pairs.begin(), pairs.end(), BodyPair{a, b}) != pairs.end();
}
bool means_the_same(const engine::Engine& engine, std::vector<BodyPair> pairs, std::uint64_t revision) {
  QueryView q;
  q.all_pairs = pairs.empty();
  q.pairs = pairs;
  q.scene_revision = revision;
  try {
    engine.size(q);
    return true;
  } catch (const engine::QueryError& error) {
    EXPECT_EQ(error.code, QueryErrorCode::kWrongScene);
    return false;
  }
}

TEST(Allow, LeavesPairsOutAndBringsThemBack) {
  engine::Engine engine(six(), {.threads = 1});
  const std::vector<BodyPair> all = engine.pairs({});
  ASSERT_EQ(all.size(), 14u);
  EXPECT_EQ(engine.allow(3, 4).applied, 1u);
  EXPECT_FALSE(is_enabled(engine, 3, 4));
  EXPECT_EQ(engine.allow(4, 3).applied, 0u) << "it is allowed already";
  EXPECT_EQ(engine.allow(kHand, kFloor).applied, 2u);
  EXPECT_FALSE(is_enabled(engine, 1, kFloor));
  EXPECT_EQ(engine.pairs({}).size(), 11u);
  EXPECT_EQ(engine.allow(kEveryBody, kFloor).applied, 3u) << "and none of the floor with itself";
  EXPECT_EQ(engine.allow(kEveryBody, kFloor, false).applied, 5u);
  EXPECT_EQ(engine.allow(3, 4, false).applied, 1u);
  EXPECT_EQ(engine.pairs({}), all);
  EXPECT_EQ(engine.allow(0, 1, false).applied, 1u) << "that the scene ignores";
  EXPECT_TRUE(is_enabled(engine, 0, 1));
  // A pair named by a query is answered, allowed or not.
  engine.allow(3, 4);
  const BodyPair named[] = {{3, 4}};
  QueryView q;
  q.all_pairs = false;
  q.pairs = named;
  EXPECT_EQ(evaluate(engine, q).view.status[0], std::uint8_t(Status::kOk));
}

TEST(Allow, ChangesTheRevisionAndWhatGroupsMean) {
  engine::Engine engine(six(), {.threads = 1});
  const std::uint64_t before = engine.scene_revision();
  engine.allow(2, 3);
  const std::uint64_t after = engine.scene_revision();
  EXPECT_NE(after, before);
  EXPECT_TRUE(means_the_same(engine, {{2, 3}}, before));
  EXPECT_FALSE(means_the_same(engine, {{kHand, 3}}, before)) << "one pair less";
  EXPECT_TRUE(means_the_same(engine, {{kHand, 4}}, before));
  EXPECT_FALSE(means_the_same(engine, {}, before));
  engine.allow(2, 4);
  EXPECT_NE(engine.scene_revision(), after);
  engine.allow(2, 4, false);
  EXPECT_EQ(engine.scene_revision(), after) << "the same pairs are the same scene";
  engine.allow(2, 3, false);
  EXPECT_EQ(engine.scene_revision(), before);
  EXPECT_TRUE(means_the_same(engine, {}, before));
  EXPECT_FALSE(means_the_same(engine, {{kHand, 3}}, after));
}

TEST(Allow, EndsWithTheAttachmentThatItIsFor) {
  engine::Engine engine(six(), {.threads = 1});
  const std::uint32_t fingers[] = {kHand, kFloor};
  const std::uint64_t before = engine.scene_revision();
  engine.attach(4, 3, nullptr, fingers);
  for (const std::uint32_t other : {1u, 2u}) EXPECT_FALSE(is_enabled(engine, other, 4));
  EXPECT_FALSE(is_enabled(engine, 4, kFloor));
  EXPECT_FALSE(is_enabled(engine, 3, 4)) << "its parent";
  EXPECT_FALSE(means_the_same(engine, {{kHand, 4}}, before));
  const std::uint64_t attached = engine.scene_revision();
  engine.attach(4, 3, nullptr, std::span(fingers, 1));
  EXPECT_TRUE(is_enabled(engine, 4, kFloor)) << "attached again, with fewer allowed pairs";
  EXPECT_NE(engine.scene_revision(), attached);
  EXPECT_FALSE(means_the_same(engine, {{4, kEveryBody}}, attached));
  EXPECT_EQ(engine.allow(4, 2).applied, 0u);  // permanently, from here on
  EXPECT_EQ(engine.allow(4, 1, false).applied, 1u);
  EXPECT_TRUE(is_enabled(engine, 1, 4)) << "forbidden, although an attachment allowed it";
  engine.attach(4, kNone);
  EXPECT_FALSE(is_enabled(engine, 2, 4)) << "allowed for good";
  EXPECT_TRUE(is_enabled(engine, 1, 4));
  engine.allow(4, 2, false);
  EXPECT_EQ(engine.scene_revision(), before);
}

TEST(Allow, GoesOverToTheNextScene) {
  engine::Engine old(six(), {.threads = 1});
  old.allow(2, 3);
  old.allow(0, 1, false);
  const std::uint32_t fingers[] = {1};
  old.attach(4, 3, nullptr, fingers);
  engine::Engine next(six(true), {.threads = 1});
  next.take_poses(old);
  EXPECT_FALSE(is_enabled(next, 2, 3));
  EXPECT_TRUE(is_enabled(next, 0, 1));
  EXPECT_FALSE(is_enabled(next, 1, 4));
  next.attach(4, kNone);
  EXPECT_TRUE(is_enabled(next, 1, 4)) << "still the attachment's alone";
}

TEST(Allow, RejectsWhatItCannotKeep) {
  engine::Engine engine(six(), {.threads = 1});
  const std::vector<BodyPair> all = engine.pairs({});
  const auto rejected = [&](auto&& call, QueryErrorCode code, const char* text) {
    try {
      call();
      ADD_FAILURE() << text;
    } catch (const engine::QueryError& error) {
      EXPECT_EQ(error.code, code);
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    }
  };
  const std::uint32_t unknown[] = {88}, one[] = {1};
  rejected([&] { engine.allow(0, 77); }, QueryErrorCode::kBadQuery, "unknown body 77");
  rejected([&] { engine.allow(kGroupBit | 9, 0, false); }, QueryErrorCode::kBadQuery, "unknown group 9");
  rejected([&] { engine.attach(4, 3, nullptr, unknown); }, QueryErrorCode::kBadQuery, "unknown body 88");
  rejected([&] { engine.attach(4, kNone, nullptr, one); }, QueryErrorCode::kBadQuery,
           "allow is only for a body with a parent");
  EXPECT_EQ(engine.pairs({}), all) << "nothing was changed";
  EXPECT_EQ(engine.body_state(4).parent, kNone);

  engine::Scene large;
  for (int i = 0; i < 600; ++i) large.add_sphere("s" + std::to_string(i), 0.1, {.pose = Pose{{1.0 * i, 0, 0}}});
  engine::Engine crowd(std::move(large), {.threads = 1});
  rejected([&] { crowd.allow(kEveryBody, kEveryBody); }, QueryErrorCode::kTooLarge, "more than the 65536");
  std::vector<std::uint32_t> every(200, kEveryBody);
  rejected([&] { crowd.attach(4, 3, nullptr, every); }, QueryErrorCode::kTooLarge, "more than the 65536");
  for (std::uint32_t i = 0; i < 100; ++i) crowd.allow(i, kEveryBody);
  EXPECT_EQ(crowd.pairs({}).size(), 600u * 599 / 2 - (100u * 500 + 100 * 99 / 2));
  EXPECT_EQ(crowd.allow(kEveryBody, kEveryBody, false).applied, 100u * 500 + 100 * 99 / 2);
}

}  // namespace
}  // namespace clearance::test
