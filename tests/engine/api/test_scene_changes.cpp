// Changes of the scene of an engine by its installed interface.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "engine/api/engine.h"
#include "wire/api/query_names.h"

namespace clearance {
namespace {

constexpr Pose7 pose_at(double x) {
  return {x, 0, 0, 1, 0, 0, 0};
}

Engine two_boxes() {
  Scene scene;
  scene.add_box("a", {1, 1, 1}, {.is_static = true, .X_parent_body = pose_at(0)});
  scene.add_box("b", {1, 1, 1}, {.X_parent_body = pose_at(2)});
  return Engine(std::move(scene));
}

TEST(SceneChanges, BodiesAreAddedReshapedAndRemoved) {
  Engine engine = two_boxes();
  Prepared every = engine.prepare({.reduce = Reduce::kMin});
  EXPECT_NEAR(every.run().distance()[0], 1, 1e-6);
  const SceneChanged added = engine.add_body({.name = "ball", .sphere = 0.25, .pose = pose_at(1)});
  EXPECT_EQ(added.body, 2u);
  EXPECT_EQ(added.body_count, 3u);
  EXPECT_EQ(engine.body("ball"), 2u);
  EXPECT_NEAR(every.run().distance()[0], 0.25, 1e-6);  // a query of all pairs has no ids
  engine.replace({.name = "ball", .sphere = 0.125});
  EXPECT_NEAR(every.run().distance()[0], 0.375, 1e-6);

  const std::vector<IdPair> of_ball{{0, 2}};
  Prepared ball = engine.prepare({.pairs = of_ball});
  EXPECT_EQ(ball.run().rows(), 1u);
  engine.remove_body("ball");
  EXPECT_NEAR(every.run().distance()[0], 1, 1e-6);
  EXPECT_TRUE(ball.is_stale());
  EXPECT_THROW(ball.run(), StaleQuery);
  engine.add_body({.name = "ball", .sphere = 0.125, .parent = 1, .pose = pose_at(-1)});
  EXPECT_FALSE(ball.is_stale());  // the id has its meaning again
  EXPECT_NEAR(ball.run().distance()[0], 0.375, 1e-6);
}

TEST(SceneChanges, ANameShowsEveryDigitOfItsLimits) {
  const std::vector<std::uint32_t> ids{0};
  const Query query{.joints = ids};
  const SceneInfo scene;
  const auto up_to = [](double upper) {
    JointsInfo joints;
    joints.joints.emplace_back();
    joints.joints[0].name = "r/x";
    joints.joints[0].lower = -0.1;
    joints.joints[0].upper = upper;
    return joints;
  };
  const QueryNames names = names_in(query, scene, up_to(1));
  EXPECT_EQ(changed_name(names, query, scene, up_to(1)), "");
  EXPECT_EQ(changed_name(names, query, scene, up_to(std::nextafter(1, 2))),
            "the joint \"r/x from -0.1 to 1\" is now \"r/x from -0.1 to 1.0000000000000002\": prepare it again");
}

TEST(SceneChanges, ErrorsNameTheirCauseAndChangeNothing) {
  Engine engine = two_boxes();
  const std::uint64_t before = engine.scene().revision;
  EXPECT_THROW(engine.add_body({.name = "b", .sphere = 0.25}), QueryError);
  EXPECT_THROW(engine.add_body({.name = "c", .sphere = -1}), QueryError);
  EXPECT_THROW(engine.add_body({.name = "c", .sphere = 1, .parent = 7}), QueryError);
  EXPECT_THROW(engine.add_body({.name = "c"}), std::invalid_argument);
  EXPECT_THROW(engine.remove_body("b"), QueryError);  // was loaded
  EXPECT_EQ(engine.scene().revision, before);
}

TEST(SceneChanges, QueriesUnderWayFinishOnTheirScene) {
  Engine engine = two_boxes();
  engine.add_body({.name = "ball", .sphere = 0.25, .pose = pose_at(1)});
  Pending pending = engine.submit({.reduce = Reduce::kMin});
  engine.remove_body("ball");
  EXPECT_NEAR(pending.get().distance()[0], 0.25, 1e-6);
}

}  // namespace
}  // namespace clearance
