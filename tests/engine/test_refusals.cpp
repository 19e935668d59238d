// Requests that the engine rejects: the text of each error, and no allocation before it.
#include <algorithm>
#include <stdexcept>

#include "tests/engine/engine_test.h"

namespace clearance::test {
namespace {

TEST_P(EngineTest, GroupsThatNameMorePairsThanMemoryHoldsAreRejected) {
  engine::Scene scene;
  std::vector<std::string> fixed;
  for (int i = 0; i < 300; ++i) {
    scene.add_sphere("s" + std::to_string(i), 0.1, {.is_static = i >= 100, .pose = Pose{{1.0 * i, 0, 0}}});
    if (i >= 100) fixed.push_back("s" + std::to_string(i));
  }
  scene.add_group("fixed", fixed);
  const engine::Engine engine = make(std::move(scene));
  QueryView q;
  const std::vector<BodyPair> all = engine.pairs(q);
  q.all_pairs = false;
  const auto evaluate_for = [&](BodyPair selector, std::size_t times) {
    const std::vector<BodyPair> selectors(times, selector);
    q.pairs = selectors;
    return engine.pairs(q);
  };
  EXPECT_EQ(evaluate_for({kEveryBody, kEveryBody}, 1), all);
  EXPECT_EQ(evaluate_for({kEveryBody, kEveryBody}, 3).size(), 3 * all.size());
  EXPECT_TRUE(evaluate_for({kGroupBit, kGroupBit}, 20).empty());
  // 0.4 and 0.8 MB of selectors would be 35 GB of pairs, and hours of searching among pairs that do not exist.
  for (const auto& [selector, times] :
       {std::pair{BodyPair{kEveryBody, kEveryBody}, 50'000}, {BodyPair{kGroupBit, kGroupBit}, 100'000}})
    try {
      evaluate_for(selector, static_cast<std::size_t>(times));
      FAIL();
    } catch (const engine::QueryError& error) {
      EXPECT_EQ(error.code, QueryErrorCode::kTooLarge);
      EXPECT_NE(std::string(error.what()).find("more than the 33554432 of one query"), std::string::npos)
          << error.what();
    }
}

struct BadQuery {
  const char* text;
  void (*spoil)(QueryView&);
};

TEST_P(EngineTest, BadQueriesNameTheirFault) {
  static const std::uint32_t kTwice[] = {0, 0}, kFar[] = {9}, kStatic[] = {4};
  static const BodyPair kSelf[] = {{1, 1}}, kGroup[] = {{kGroupBit | 7, 0}};
  static const Pose kOne[1];
  const BadQuery cases[] = {
      {"max_distance: expected metres >= 0, got nan", [](QueryView& q) { q.max_distance = std::nan(""); }},
      {"max_distance: expected metres >= 0, got -1", [](QueryView& q) { q.max_distance = -1; }},
      {"abs_tol: expected metres >= 0", [](QueryView& q) { q.abs_tol = -1; }},
      {"rel_tol: expected a ratio below 1", [](QueryView& q) { q.rel_tol = 1; }},
      {"fields: unknown bits", [](QueryView& q) { q.fields = 1u << kFieldCount; }},
      {"reduce: unknown value 9", [](QueryView& q) { q.reduce = static_cast<Reduce>(9); }},
      {"bodies[1]: 'body0' is named twice", [](QueryView& q) { q.bodies = kTwice; }},
      {"bodies[0]: unknown body 9", [](QueryView& q) { q.bodies = kFar; }},
      {"bodies[0]: 'body4' is static", [](QueryView& q) { q.bodies = kStatic; }},
      {"pairs[0]: body 1 with itself",
       [](QueryView& q) {
         q.all_pairs = false;
         q.pairs = kSelf;
       }},
      {"pairs[0]: unknown group 7",
       [](QueryView& q) {
         q.all_pairs = false;
         q.pairs = kGroup;
       }},
      {"configurations without bodies or joints", [](QueryView& q) { q.configuration_count = 1; }},
      {"expected 3 poses (3 x 1), got 1",
       [](QueryView& q) {
         static const std::uint32_t b[] = {0};
         q.bodies = b;
         q.configuration_count = 3;
         q.configurations = kOne;
       }},
      {"speed_errors: only with configurations",
       [](QueryView& q) {
         static const std::uint32_t b[] = {0};
         static const double errors[] = {0.1, 0.1};
         q.bodies = b;
         q.fields = kFieldRateBounds;
         q.speed_errors = errors;
       }},
      {"the scene is revision", [](QueryView& q) { q.scene_revision = 12345; }},
  };
  const engine::Engine engine = make(mixed_scene(6, 3, 8));
  for (const BadQuery& c : cases) {
    QueryView q;
    c.spoil(q);
    try {
      ReplyView none;
      engine.start(q, none);
      ADD_FAILURE() << "accepted: " << c.text;
    } catch (const engine::QueryError& e) {
      EXPECT_NE(std::string(e.what()).find(c.text), std::string::npos) << e.what();
    }
    EXPECT_EQ(evaluate(engine, {}).info.rows, engine.pairs({}).size()) << "a good query after: " << c.text;
  }
}

TEST_P(EngineTest, AbsurdSizesAreRejectedBeforeAnythingIsAllocated) {
  static const std::uint32_t kBody[] = {0};
  const engine::Engine engine = make(mixed_scene(6, 3, 8));
  QueryView q;
  q.bodies = kBody;
  q.configuration_count = 0xFFFFFFFF;
  try {
    engine.size(q);
    FAIL() << "accepted";
  } catch (const engine::QueryError& e) {
    EXPECT_EQ(e.code, QueryErrorCode::kTooLarge);
    EXPECT_NE(std::string(e.what()).find("4294967295 configurations x 5 rows are more than the limit"),
              std::string::npos)
        << e.what();
  }
}

TEST_P(EngineTest, AnAnswerLargerThanItsBuffersIsRejected) {
  engine::Engine engine = make(mixed_scene(6, 3, 8));
  double lower[4];
  ReplyView room;
  room.rows = 4;
  room.lower = lower;
  EXPECT_THROW(engine.start({}, room), engine::QueryError);
}

TEST(Engine, UnknownBackendsAreRejectedByName) {
  EXPECT_THROW(engine::Engine(mixed_scene(4, 3, 1), {"gpu"}), std::invalid_argument);
  const std::vector<std::string> there = engine::Engine::backends();
  if (std::find(there.begin(), there.end(), "cuda") == there.end()) {
    EXPECT_THROW(engine::Engine(mixed_scene(4, 3, 1), {"cuda"}), std::runtime_error);
  }
  const bool has_device = std::find(there.begin(), there.end(), "cuda") != there.end();
  EXPECT_EQ(engine::Engine(mixed_scene(4, 3, 1)).backend(), has_device ? "auto" : "cpu");
}

}  // namespace
}  // namespace clearance::test
