// Bodies that are added, removed and replaced while an engine runs: the state of the others stays, no update is lost,
// and the answers have the bits of a scene that was loaded with the same content.
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "engine/editor/scene_editor.h"
#include "tests/engine/same_rows.h"

namespace clearance::test {
namespace {

using wire::BodyShape;

engine::Scene::BodyOptions at(double x, double y = 0, double z = 0) {
  engine::Scene::BodyOptions options;
  options.pose = Pose{{x, y, z}};
  return options;
}

/// A floor, a gripper with two fingers, a cup, and a cloud.
engine::Scene cell() {
  engine::Scene scene;
  engine::Scene::BodyOptions fixed = at(0, 0, -1);
  fixed.is_static = true;
  scene.add_box("floor", {10, 10, 0.1}, fixed);
  scene.add_box("gripper", {0.2, 0.2, 0.2}, at(0, 0, 1));
  for (const char* finger : {"left", "right"}) {
    engine::Scene::BodyOptions options = at(*finger == 'l' ? -0.1 : 0.1, 0, -0.2);
    options.parent = "gripper";
    scene.add_capsule(finger, 0.02, 0.1, options);
  }
  scene.add_cylinder("cup", 0.05, 0.1, at(1, 0, 0));
  scene.add_points("cloud", std::vector<CloudPoint>{{0, 0, 0}, {0.1f, 0, 0}}, 0, at(-2));
  scene.add_group("hand", std::vector<std::string>{"gripper", "left", "right"});
  scene.ignore("left", "right");
  return scene;
}
constexpr std::uint32_t kGripper = 1, kLeft = 2, kCup = 4, kPoints = 5;

NewShape box(double edge) {
  return {BodyShape::kBox, {edge, edge, edge}};
}

class SceneEdits : public testing::Test {
 protected:
  SceneEditor::Change add(const std::string& name, engine::Scene::BodyOptions options = at(0, 3), double edge = 0.2) {
    return editor_.add([&](const engine::Engine&) { return make_body(name, box(edge), options); });
  }
  engine::Engine& engine() {
    held_ = editor_.engine();
    return *held_;
  }
  std::string rejection(const std::function<void()>& call) {
    const std::shared_ptr<engine::Engine> before = editor_.engine();
    try {
      call();
    } catch (const engine::QueryError& error) {
      EXPECT_EQ(error.code, QueryErrorCode::kBadQuery);
      EXPECT_EQ(editor_.engine(), before);
      return error.what();
    }
    return "accepted";
  }
  /// Expects the answers and the revision of a scene that was loaded whole, with the same received poses.
  void expect_as_loaded(engine::Scene whole) {
    engine::Engine loaded(std::move(whole), {.threads = 1});
    loaded.take_poses(engine());
    EXPECT_EQ(engine().scene().revision(), loaded.scene().revision());
    EXPECT_EQ(engine().scene_revision(), loaded.scene_revision());
    const Answer is = evaluate(engine(), QueryView{}), expected = evaluate(loaded, QueryView{});
    ASSERT_EQ(is.info.rows, expected.info.rows);
    expect_same_rows(is, 0, expected, expected.info.rows);
  }

  SceneEditor editor_{cell(), {.threads = 1}};

 private:
  std::shared_ptr<engine::Engine> held_;
};

TEST_F(SceneEdits, GiveTheBitsOfASceneLoadedWhole) {
  const BodyPose poses[] = {{kCup, Pose{{0.3, 0.2, 0.1}, 0.9, 0.1, 0, 0.3}}, {kGripper, Pose{{0, 0.5, 1}}}};
  engine().set_poses(poses, 5);
  engine::Scene::BodyOptions lid = at(0, 0, 0.1);
  lid.parent = "cup";
  lid.padding = 0.01;
  lid.uncertainty = {0.02, 0.03};
  EXPECT_EQ(add("crate").body, 6u);
  EXPECT_EQ(add("lid", lid).body, 7u);
  EXPECT_EQ(add("ball", at(2)).body, 8u);
  EXPECT_EQ(editor_.remove("crate").body, kNone);
  EXPECT_EQ(editor_.reshape("cup", box(0.3), 0.01).body, kCup);
  EXPECT_EQ(editor_.reshape("lid", {BodyShape::kCapsule, {0.05, 0.2, 0}}, 0).body, 6u);
  engine::Scene whole = cell();
  whole.add_capsule("lid", 0.05, 0.2, lid);
  whole.add_box("ball", {0.2, 0.2, 0.2}, at(2));
  engine::Scene with_box;
  engine::Scene::BodyOptions grown;
  grown.radius = 0.01;
  with_box.add_box("cup", {0.3, 0.3, 0.3}, grown);
  whole.replace_shape("cup", with_box.bodies()[0]);
  expect_as_loaded(std::move(whole));
}

TEST_F(SceneEdits, ThatAreUndoneGiveTheFirstRevision) {
  const std::uint64_t before = engine().scene_revision();
  add("crate");
  EXPECT_NE(engine().scene_revision(), before);
  editor_.reshape("cup", box(0.3), 0);
  editor_.remove("crate");
  EXPECT_NE(engine().scene_revision(), before);
  editor_.reshape("cup", {BodyShape::kCylinder, {0.05, 0.1, 0}}, 0);
  EXPECT_EQ(engine().scene_revision(), before);
}

TEST_F(SceneEdits, KeepTheStateOfTheOthers) {
  engine().set_poses(std::vector<BodyPose>{{kCup, Pose{{3, 0, 0}}}}, 77, 9);
  const Pose held{{0, 0, 0.2}};
  const std::uint32_t fingers[] = {kLeft, 3};
  engine().attach(kCup, kGripper, &held, fingers);
  engine().allow(kPoints, 0);
  engine().set_points(kPoints, std::vector<CloudPoint>{{0, 0, 1}}, 0.25);
  const std::vector<BodyPair> pairs = engine().pairs({});
  const std::uint64_t poses = engine().pose_revision();
  const std::vector<ConvexPartPtr> parts = engine().scene().bodies()[kGripper].parts;
  add("crate");
  EXPECT_EQ(engine().scene().bodies()[kGripper].parts, parts) << "shared, not made again";
  EXPECT_EQ(engine().body_state(kCup).parent, kGripper);
  EXPECT_EQ(engine().body_state(kCup).X_wb.translation.z, 1.2);
  EXPECT_EQ(engine().body_state(kCup).stamp_ns, 77);
  EXPECT_GT(engine().pose_revision(), poses);
  editor_.remove("crate");
  EXPECT_EQ(engine().pairs({}), pairs);
  const BodyPair of_cloud{kGripper, kPoints};
  QueryView query;
  query.all_pairs = false;
  query.pairs = {&of_cloud, 1};
  const double near = evaluate(engine(), query).view.upper[0];
  EXPECT_NEAR(near, 1.9 - 0.25, 1e-6) << "the points that were received";
  editor_.reshape("cloud", {.kind = BodyShape::kCloud, .points = {{0.5f, 0, 1}}}, 0);
  EXPECT_NEAR(evaluate(engine(), query).view.upper[0], 1.4, 1e-6) << "the points of the new shape";
  engine().set_points(kPoints, std::vector<CloudPoint>{{0, 0, 1}});
  EXPECT_NEAR(evaluate(engine(), query).view.upper[0], 1.9, 1e-6);
  EXPECT_THROW(engine().set_poses(std::vector<BodyPose>{{kCup, held}}, 76), engine::QueryError)
      << "late for its publisher";
}

TEST_F(SceneEdits, KeepAttachmentsThatExchangedTheirLeaders) {
  engine::Scene::BodyOptions follows = at(0, 0, 1);
  follows.parent = "cup";
  add("lid", follows);
  engine().attach(6, kNone);
  engine().attach(kCup, 6);  // the one that led follows
  const Pose before = engine().body_state(kCup).X_wb;
  add("crate");
  EXPECT_EQ(engine().body_state(kCup).parent, 6u);
  EXPECT_EQ(engine().body_state(6).parent, kNone);
  EXPECT_EQ(engine().body_state(kCup).X_wb.translation.z, before.translation.z);
}

TEST_F(SceneEdits, ChangeTheMeaningOfIdsAsTheyDo) {
  const std::uint64_t before = engine().scene_revision();
  const std::uint32_t hand = kGroupBit, cup[] = {kCup, hand}, crate[] = {6};
  add("crate");
  const std::uint64_t with_crate = engine().scene_revision();
  add("lid");
  EXPECT_TRUE(engine().ids_valid_since(before, cup, true));
  EXPECT_FALSE(engine().ids_valid_since(before, crate, false)) << "unknown then, a body now";
  EXPECT_TRUE(engine().ids_valid_since(with_crate, crate, false));
  editor_.remove("crate");
  EXPECT_FALSE(engine().ids_valid_since(with_crate, crate, false)) << "the lid has it";
  EXPECT_TRUE(engine().ids_valid_since(before, cup, true));
  editor_.reshape("left", box(0.1), 0);
  const std::uint32_t of_hand[] = {hand}, left[] = {kLeft}, gripper[] = {kGripper};
  EXPECT_FALSE(engine().ids_valid_since(before, left, false)) << "another shape";
  EXPECT_FALSE(engine().ids_valid_since(before, of_hand, false));
  EXPECT_TRUE(engine().ids_valid_since(before, gripper, false));
}

TEST_F(SceneEdits, ThatMakeNoSenseAreRejected) {
  add("crate");
  engine::Scene::BodyOptions follows;
  follows.parent = "crate";
  add("lid", follows);
  EXPECT_EQ(rejection([&] { editor_.remove("crate"); }), "remove_body: \"lid\" follows \"crate\": detach it first");
  EXPECT_EQ(engine().set_poses(std::vector<BodyPose>{{kCup, Pose{}}}).applied, 1u) << "updates are accepted again";
  EXPECT_EQ(rejection([&] { editor_.remove("cup"); }),
            "remove_body: \"cup\" was loaded with the scene: only added bodies can be removed");
  EXPECT_EQ(rejection([&] { editor_.remove("ghost"); }), "remove_body: \"ghost\" is not in the scene");
  EXPECT_NE(rejection([&] { add("cup"); }).find("is already that of a body"), std::string::npos);
  EXPECT_NE(rejection([&] { add("hand"); }).find("is already that of a group"), std::string::npos);
  EXPECT_NE(rejection([&] { add("odd", at(0), -1); }).find("box edge: expected"), std::string::npos);
  follows.parent = "ghost";
  EXPECT_NE(rejection([&] { add("odd", follows); }).find("there is no body \"ghost\""), std::string::npos);
  EXPECT_EQ(rejection([&] { editor_.reshape("ghost", box(1), 0); }), "there is no body \"ghost\"");
  EXPECT_EQ(rejection([&] { editor_.remove("crate "); }),
            "remove_body: \"crate \" is not in the scene; did you mean \"crate\"?");
  EXPECT_EQ(rejection([&] { editor_.reshape("cup ", box(1), 0); }), "there is no body \"cup \"; did you mean \"cup\"?");
  EXPECT_NE(rejection([&] { editor_.reshape("cup", {BodyShape::kHalfSpace}, 0); }).find("a half_space is static"),
            std::string::npos);
  editor_.reshape("floor", {BodyShape::kHalfSpace}, 0);
  EXPECT_EQ(engine().body_state(0).X_wb.translation.z, -1);
  engine().attach(7, kNone);
  editor_.remove("crate");
  EXPECT_EQ(engine().scene().bodies()[6].name, "lid");
  EXPECT_EQ(engine().body_state(6).parent, kNone);
}

TEST_F(SceneEdits, LetJobsFinishOnTheirScene) {
  const Answer expected = evaluate(engine(), QueryView{});
  PreparedQuery prepared = engine().prepare({});
  const std::shared_ptr<engine::Engine> old = editor_.engine();
  add("crate", at(0, 0, 0.5));
  editor_.reshape("gripper", box(1), 0);
  EXPECT_EQ(prepared.size().rows, expected.info.rows);
  const Answer answer = evaluate(*old, QueryView{});
  expect_same_rows(answer, 0, expected, expected.info.rows);
  EXPECT_THROW(old->set_poses(std::vector<BodyPose>{{kCup, Pose{}}}), UpdatesStopped) << "they would be lost";
}

// Each thread owns a body: each of its updates must be there as soon as the call returns, and stay.
TEST_F(SceneEdits, LoseNoUpdateOfOtherThreads) {
  constexpr int kThreads = 3;
  for (int i = 0; i < kThreads; ++i) add("own" + std::to_string(i), at(10 + i));
  std::atomic<bool> ends{false};
  std::atomic<std::uint64_t> updates{0}, lost{0}, queried{0};
  std::vector<std::thread> threads;
  for (std::uint32_t i = 0; i < kThreads; ++i)
    threads.emplace_back([&, body = 6 + i] {
      for (int k = 1; !ends; ++k) {
        const BodyPose pose{body, Pose{{double(k), 0, 0}}};
        editor_.update([&](engine::Engine& now) { return now.set_poses({&pose, 1}, k, 0, body); });
        if (k % 50 == 0)
          editor_.update([&](engine::Engine& now) { return now.attach(body, k % 100 == 0 ? kNone : kGripper); });
        const BodyState state = editor_.engine()->body_state(body);
        if (state.stamp_ns != k || (k % 50 == 0 && state.parent != (k % 100 == 0 ? kNone : kGripper))) ++lost;
        ++updates;
      }
    });
  threads.emplace_back([&] {
    while (!ends) {
      const std::shared_ptr<engine::Engine> now = editor_.engine();
      try {
        queried += evaluate(*now, QueryView{}).info.rows > 0;
      } catch (const engine::QueryError& error) {  // an attachment since the size of the answer was queried
        if (error.code != QueryErrorCode::kWrongScene) throw;
      }
    }
  });
  for (int i = 0; i < 200; ++i) {
    const std::string name = "part" + std::to_string(i % 7);
    if (i % 14 < 7)
      EXPECT_EQ(add(name).engine->scene().bodies().size(), 9u + static_cast<unsigned>(i % 14) + 1);
    else
      editor_.remove(name);
    if (i % 10 == 0) editor_.reshape("cup", box(0.1 + 0.001 * i), 0);
  }
  ends = true;
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(lost, 0u) << "of " << updates;
  EXPECT_GT(updates, 0u);
  EXPECT_GT(queried, 0u);
}

}  // namespace
}  // namespace clearance::test
