// A scene that is reloaded while the daemon serves: in the background, as a whole or not at all, with the known poses.
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "client/client.h"
#include "tests/patience.h"
#include "tests/server/core/loop_fixture.h"
#include "tests/server/daemon_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

class Reload : public LoopTest {
 protected:
  /// Runs the loop until the reloader has delivered `count` results.
  void turn_until(const char* counter, std::uint64_t count) {
    while (loop_->counter(counter) < count) {
      loop_->turn();
      std::this_thread::yield();
    }
  }
  std::uint64_t revision() { return loop_->engine().scene_revision(); }
};

TEST_F(Reload, QueriesGoOnWhileItLoadsAndThoseUnderWayEndWithTheOldScene) {
  start(scattered_scene(20), short_slices());
  const std::uint64_t before = revision();
  std::atomic<bool> may_end{false};
  loop_->reload_by([&] {
    while (!may_end) std::this_thread::yield();
    return std::make_unique<engine::Engine>(small_scene());
  });
  TestQuery large = large_query(20);
  transport_->send(a_, large.frame(1));
  loop_->turn();
  ASSERT_EQ(loop_->waiting(), 1u);
  loop_->reload();
  loop_->turn();
  EXPECT_TRUE(loop_->is_reloading());
  transport_->send(b_, small_query().frame(2));
  while (b_.replies.empty()) loop_->turn();
  EXPECT_EQ(take(b_)->header().scene_revision, before);
  ASSERT_EQ(loop_->waiting(), 1u) << "the large query is to be under way still";

  may_end = true;
  turn_until("reloads", 1);
  EXPECT_FALSE(loop_->is_reloading());
  EXPECT_NE(revision(), before);
  EXPECT_EQ(loop_->engine().scene().bodies()[1].name, "cup");
  const Result fresh = evaluate(c_, small_query());
  EXPECT_EQ(fresh.scene_revision(), revision());
  turn_until_idle();
  const Result old = result_of(take(a_));
  EXPECT_EQ(old.scene_revision(), before);

  // Answers equal those of an engine that has only the old scene.
  start(scattered_scene(20));
  const Result expected = evaluate(a_, large);
  ASSERT_EQ(old.rows(), expected.rows());
  for (std::uint64_t i = 0; i < old.rows(); ++i) ASSERT_EQ(old.distance()[i], expected.distance()[i]) << i;
}

TEST_F(Reload, ThatFailsLeavesTheOldScene) {
  start(small_scene());
  const std::uint64_t before = revision();
  int calls = 0;
  loop_->reload_by([&]() -> std::unique_ptr<engine::Engine> {
    ++calls;
    throw engine::SceneError("scene.yaml:3: no such thing");
  });
  loop_->reload();
  turn_until("reloads.failed", 1);
  EXPECT_EQ(calls, 1);
  EXPECT_EQ(revision(), before);
  EXPECT_EQ(loop_->counter("reloads"), 0u);
  EXPECT_EQ(evaluate(a_, small_query()).scene_revision(), before);
}

TEST_F(Reload, RequestedWhileOneIsUnderWayFollowsIt) {
  start(small_scene());
  std::atomic<int> begun{0};
  std::atomic<bool> may_end{false};
  loop_->reload_by([&] {
    ++begun;
    while (!may_end) std::this_thread::yield();
    return std::make_unique<engine::Engine>(small_scene());
  });
  loop_->reload();
  while (begun < 1) loop_->turn();
  for (int i = 0; i < 3; ++i) loop_->reload();
  loop_->turn();
  EXPECT_EQ(begun, 1);
  may_end = true;
  turn_until("reloads", 2);
  turn_until_idle();
  EXPECT_FALSE(loop_->is_reloading());
  EXPECT_EQ(begun, 2);
}

TEST_F(Reload, ARequestForTheOldSceneIsRejected) {
  start(small_scene());
  const std::uint64_t before = revision();
  loop_->reload_by([] {
    engine::Scene scene = small_scene();
    scene.add_box("crate", {1, 1, 1}, at(5, 0, 0));
    return std::make_unique<engine::Engine>(std::move(scene));
  });
  loop_->reload();
  turn_until("reloads", 1);
  TestQuery query;
  query.scene_revision = before;
  const auto error = error_of(evaluate(a_, query.frame(1, FrameType::kPairs)));
  EXPECT_EQ(static_cast<ErrorCode>(error.header.code), ErrorCode::kWrongScene);
}

TEST_F(Reload, QueriesThatWaitForPosesAreHeldToTheSceneTheyName) {
  start(small_scene());
  loop_->reload_by([] {
    engine::Scene scene = small_scene();
    scene.add_box("crate", {1, 1, 1}, at(5, 0, 0));
    return std::make_unique<engine::Engine>(std::move(scene));
  });
  TestQuery query = small_query();
  query.header.min_pose_stamp_ns = 100;
  query.header.deadline_ns = std::chrono::nanoseconds(10s).count();
  transport_->send(a_, query.frame(1));  // refers to no revision
  query.scene_revision = revision();
  transport_->send(b_, query.frame(2));
  turn_until_idle();
  ASSERT_EQ(loop_->held(), 2u);
  loop_->reload();
  turn_until("reloads", 1);
  const BodyPose pose{1, Pose{{0, 0, 0.5}}};
  ASSERT_EQ(loop_->on_poses(std::span(&pose, 1), 100).applied, 1u);
  turn_until_idle();
  EXPECT_EQ(result_of(take(a_)).scene_revision(), revision());
  EXPECT_EQ(static_cast<ErrorCode>(error_of(take(b_)).header.code), ErrorCode::kWrongScene);
}

TEST_F(Reload, ARequestIsAnsweredWhenTheNewSceneIsIn) {
  start(small_scene());
  std::atomic<int> begun{0}, may_end{0};
  loop_->reload_by([&] {
    const int own = ++begun;
    while (may_end < own) std::this_thread::yield();
    engine::Scene scene = small_scene();
    for (int i = 0; i < own; ++i) scene.add_box("crate" + std::to_string(i), {1, 1, 1}, at(5, 0, 0));
    return std::make_unique<engine::Engine>(std::move(scene));
  });
  const auto change_of = [this](MemoryClient& client) {
    const auto frame = take(client);
    EXPECT_EQ(frame->type(), FrameType::kSceneChanged);
    return wire::parse_scene_changed(frame->body());
  };
  transport_->send(a_, simple_frame(FrameType::kReload, 7));
  while (begun < 1) loop_->turn();
  EXPECT_TRUE(a_.replies.empty());
  // It may have been sent after a change of a file that the first load had already read.
  transport_->send(b_, simple_frame(FrameType::kReload, 8));
  loop_->turn();
  may_end = 1;
  while (a_.replies.empty()) loop_->turn();
  EXPECT_EQ(a_.replies.front()->header().request_id, 7u);
  const auto first = change_of(a_);
  EXPECT_EQ(first.scene_revision, revision());
  EXPECT_EQ(first.body_count, 5u);
  EXPECT_TRUE(b_.replies.empty());
  may_end = 2;
  while (b_.replies.empty()) loop_->turn();
  EXPECT_EQ(change_of(b_).body_count, 6u);
  EXPECT_EQ(begun, 2);
  EXPECT_EQ(a_.sinks + b_.sinks, 0);
}

TEST_F(Reload, ARequestThatFailsGetsTheLoadersError) {
  start(small_scene());
  loop_->reload_by(
      []() -> std::unique_ptr<engine::Engine> { throw engine::SceneError("scene.yaml:3: no such thing"); });
  transport_->send(a_, simple_frame(FrameType::kReload, 1));
  while (a_.replies.empty()) loop_->turn();
  const auto error = error_of(take(a_));
  EXPECT_EQ(static_cast<ErrorCode>(error.header.code), ErrorCode::kReloadFailed);
  EXPECT_EQ(error.text, "scene.yaml:3: no such thing");
  EXPECT_EQ(loop_->counter("errors.reload_failed"), 1u);
}

TEST_F(Reload, RequestsAreCountedAmongThoseUnderWay) {
  Loop::Options options;
  options.max_waiting_per_client = 2;
  options.tick = std::chrono::nanoseconds(0);
  start(small_scene(), options);
  EXPECT_EQ(static_cast<ErrorCode>(error_of(evaluate(a_, simple_frame(FrameType::kReload, 1))).header.code),
            ErrorCode::kNotSupported)
      << "a loop that was given no way to reload";
  std::atomic<bool> may_end{false};
  loop_->reload_by([&] {
    while (!may_end) std::this_thread::yield();
    return std::make_unique<engine::Engine>(small_scene());
  });
  for (const std::uint64_t id : {2, 3, 4}) transport_->send(a_, simple_frame(FrameType::kReload, id));
  loop_->turn();
  EXPECT_EQ(static_cast<ErrorCode>(error_of(take(a_)).header.code), ErrorCode::kBusy);
  EXPECT_EQ(a_.sinks, 2);
  a_.alive = false;  // disconnected: its pending request is dropped
  loop_->turn();
  EXPECT_EQ(a_.sinks, 0);
  may_end = true;
  turn_until("reloads", 1);
  a_.alive = true;
  EXPECT_EQ(evaluate(a_, small_query()).rows(), 1u);
}

TEST(TakePoses, OfBodiesThatBothScenesKnow) {
  engine::Engine old(small_scene());
  const Pose moved{{1, 2, 3}, 0, 1, 0, 0}, held{{0, 0, 0.2}};
  const BodyPose poses[] = {{1, moved}, {3, {{4, 5, 6}}}};
  old.set_poses(poses, 77);
  old.attach(2, 1, &held);  // link1 follows the cup

  engine::Scene scene;
  scene.add_box("crate", {1, 1, 1}, at(7, 0, 0));
  scene.add_capsule("link1", 0.05, 0.4, at(0.5, 0, 0.5));
  scene.add_sphere("cup", 0.2, at(0, 0, 0.3));
  engine::Scene::BodyOptions fixed = at(9, 9, 9);
  fixed.is_static = true;
  scene.add_capsule("link2", 0.05, 0.4, fixed);  // now static
  engine::Engine engine(std::move(scene));
  engine.take_poses(old);
  EXPECT_EQ(engine.body_state(0).X_wb.translation.x, 7);
  EXPECT_EQ(engine.body_state(2).X_wb.translation.z, 3);
  EXPECT_EQ(engine.body_state(2).X_wb.qx, 1);
  EXPECT_EQ(engine.body_state(2).stamp_ns, 77);
  EXPECT_EQ(engine.body_state(1).parent, 2u);
  EXPECT_EQ(engine.body_state(1).X_wb.translation.z, old.body_state(2).X_wb.translation.z);
  EXPECT_EQ(engine.body_state(3).X_wb.translation.x, 9);
  EXPECT_GT(engine.pose_revision(), old.pose_revision());

  // The leader is gone: its followers take the new scene's poses.
  engine::Scene alone;
  alone.add_capsule("link1", 0.05, 0.4, at(0.5, 0, 0.5));
  engine::Engine without(std::move(alone));
  without.take_poses(old);
  EXPECT_EQ(without.body_state(0).parent, kNone);
  EXPECT_EQ(without.body_state(0).X_wb.translation.x, 0.5);

  // Reversed in the new scene: an attachment that would close a cycle is left out.
  engine::Scene turned;
  turned.add_capsule("link1", 0.05, 0.4, at(0.5, 0, 0.5));
  engine::Scene::BodyOptions follows = at(0, 0, 1);
  follows.parent = "link1";
  turned.add_sphere("cup", 0.1, follows);
  engine::Engine circle(std::move(turned));
  circle.take_poses(old);
  EXPECT_EQ(circle.body_state(1).parent, kNone) << "the cup was free when it was told where it is";
  EXPECT_EQ(circle.body_state(0).parent, 1u);
}

TEST(ClearancedReload, ByASignal) {
  TestFolder folder;
  const std::string scene = folder.write("scene.yaml", kSmallSceneYaml);
  Daemon daemon({"--scene", scene, "--zmq", "ipc://" + (folder / "c.ipc")});
  const auto ended = [&](const char* counter, std::uint64_t count) {
    for (Client client = patient(daemon.url());;) {
      for (const auto& [name, value] : client.stats())
        if (name == counter && value >= count) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  };
  std::string more(kSmallSceneYaml);
  more.insert(more.find("groups:"), "  - {name: crate, box: [1, 1, 1], pose: [5,0,0, 1,0,0,0]}\n");
  folder.write("scene.yaml", more);
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  ended("reloads", 1);
  EXPECT_EQ(patient(daemon.url()).scene().bodies.size(), 5u);
  EXPECT_NE(daemon.log().find("event=reloaded bodies=5"), std::string::npos) << daemon.log();

  folder.write("scene.yaml", "bodies: [{name: x, box: [1, -1, 1]}]\n");
  ASSERT_EQ(kill(daemon.pid(), SIGHUP), 0);
  ended("reloads.failed", 1);
  EXPECT_EQ(patient(daemon.url()).scene().bodies.size(), 5u);
  EXPECT_NE(daemon.log().find("event=reload_failed"), std::string::npos) << daemon.log();
  EXPECT_NE(daemon.log().find("scene.yaml:1"), std::string::npos) << daemon.log();
  EXPECT_EQ(daemon.stop(SIGTERM), 0);
}

TEST(ClearancedReload, ByACommand) {
  TestFolder folder;
  const std::string scene = folder.write("scene.yaml", kSmallSceneYaml);
  Daemon daemon({"--scene", scene, "--zmq", "ipc://" + (folder / "c.ipc"), "--shm", folder / "c.sock"});
  Client other = patient(daemon.url());
  const std::uint64_t before = other.scene().revision;
  std::string more(kSmallSceneYaml);
  more.insert(more.find("groups:"), "  - {name: crate, box: [1, 1, 1], pose: [5,0,0, 1,0,0,0]}\n");
  folder.write("scene.yaml", more);
  for (const std::string& url : daemon.urls()) {
    const Finished good = run({program("clearance"), "scene", "reload", "--connect", url});
    EXPECT_EQ(good.code, 0) << good.err;
    EXPECT_NE(good.out.find(", 5 bodies, loaded in "), std::string::npos) << good.out;
  }
  try {
    other.distances();
    FAIL() << "the scene that this client knows is gone";
  } catch (const RequestError& error) {
    EXPECT_EQ(error.code, static_cast<std::uint16_t>(ErrorCode::kWrongScene)) << error.what();
  }
  EXPECT_EQ(other.scene().bodies.size(), 5u);
  const std::uint64_t after = other.scene().revision;
  EXPECT_NE(after, before);

  folder.write("scene.yaml", "bodies: [{name: x, box: [1, -1, 1]}]\n");
  const Finished bad = run({program("clearance"), "scene", "reload", "--connect", daemon.url()});
  EXPECT_EQ(bad.code, 1);
  EXPECT_EQ(bad.out, "");
  EXPECT_NE(bad.err.find("scene.yaml:1: bodies[0]"), std::string::npos) << bad.err;
  EXPECT_EQ(other.distances().scene_revision(), after);
  try {
    other.reload();
    FAIL();
  } catch (const RequestError& error) {
    EXPECT_EQ(error.code, static_cast<std::uint16_t>(ErrorCode::kReloadFailed)) << error.what();
  }
  folder.write("scene.yaml", kSmallSceneYaml);
  EXPECT_EQ(other.reload().scene_revision, before);
  EXPECT_EQ(other.scene().bodies.size(), 4u);
}

}  // namespace
}  // namespace clearance
