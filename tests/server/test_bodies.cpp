// Bodies that are added and removed while the daemon serves.
#include <random>

#include "engine/bvh/surface.h"
#include "tests/server/bodies_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

TEST_F(Bodies, AnAddedOneIsAnsweredAsIfItHadAlwaysBeenThere) {
  start_editable(small_scene());
  const ConvexPartPtr cup = bodies()[1].parts[0];
  const std::uint64_t before = loop_->engine().scene_revision();
  const BodyPose moved{1, Pose{{0, 0, 0.7}}};
  loop_->on_poses(std::span(&moved, 1), 5);
  const auto added = change(box_frame("crate", 2));  // follows link1
  EXPECT_EQ(added.body, 4u);
  EXPECT_EQ(added.body_count, 5u);
  EXPECT_NE(added.scene_revision, before);
  EXPECT_EQ(added.scene_revision, loop_->engine().scene_revision());
  EXPECT_EQ(bodies()[1].parts[0], cup) << "the others' geometry is shared, not made again";
  EXPECT_EQ(loop_->engine().body_state(1).X_wb.translation.z, 0.7) << "poses stay";
  EXPECT_EQ(loop_->engine().body_state(4).parent, 2u);
  TestQuery every;
  const Result answer = evaluate(b_, every);

  engine::Scene whole = small_scene();
  engine::Scene::BodyOptions options = at(3, 0, 0);
  options.parent = "link1";
  whole.add_box("crate", {0.2, 0.2, 0.2}, options);
  start(std::move(whole));
  loop_->on_poses(std::span(&moved, 1), 5);
  const Result expected = evaluate(b_, every);
  ASSERT_EQ(answer.rows(), expected.rows());
  ASSERT_EQ(answer.rows(), 9u);  // ten pairs, minus that of parent and child
  for (std::size_t i = 0; i < answer.rows(); ++i) {
    EXPECT_EQ(answer.status()[i], expected.status()[i]) << i;
    if (answer.status()[i] == Status::kNoPose) continue;
    EXPECT_EQ(answer.lower()[i], expected.lower()[i]) << i;
    EXPECT_EQ(answer.upper()[i], expected.upper()[i]) << i;
  }
}

TEST_F(Bodies, QueriesUnderWayEndWithTheSceneTheyBeganWith) {
  start_editable(scattered_scene(20), short_slices());
  const std::uint64_t before = loop_->engine().scene_revision();
  hold_ = true;
  transport_->send(b_, large_query(20).frame(1));
  transport_->send(a_, box_frame("crate"));
  while (built_ == 0) loop_->turn();
  ASSERT_TRUE(loop_->is_reloading());
  EXPECT_EQ(evaluate(c_, small_query()).scene_revision(), before) << "answered while the new scene is made";
  transport_->send(b_, large_query(20).frame(2));
  loop_->turn();
  ASSERT_GE(loop_->waiting(), 1u);
  hold_ = false;
  while (a_.replies.empty()) loop_->turn();
  EXPECT_EQ(take(a_)->type(), FrameType::kSceneChanged);
  turn_until_idle();
  for (int i = 0; i < 2; ++i) EXPECT_EQ(result_of(take(b_)).scene_revision(), before) << i;
  EXPECT_NE(evaluate(c_, small_query()).scene_revision(), before);
}

TEST_F(Bodies, OnlyAddedOnesAreRemovedAndNoneThatIsFollowed) {
  start_editable(small_scene());
  const std::uint64_t before = loop_->engine().scene_revision();
  change(box_frame("crate"));
  change(box_frame("lid", 4));
  EXPECT_EQ(rejection(remove_frame("cup")),
            "remove_body: \"cup\" was loaded with the scene: only added bodies can be removed");
  EXPECT_EQ(rejection(remove_frame("cups")), "remove_body: \"cups\" is not in the scene; did you mean \"cup\"?");
  EXPECT_EQ(rejection(remove_frame("crate")), "remove_body: \"lid\" follows \"crate\": detach it first");
  loop_->engine().attach(5, kNone);
  const Pose free = loop_->engine().body_state(5).X_wb;
  EXPECT_EQ(change(remove_frame("crate")).body_count, 5u);
  EXPECT_EQ(bodies()[4].name, "lid");
  EXPECT_EQ(loop_->engine().body_state(4).X_wb.translation.x, free.translation.x) << "where it was set free";
  change(remove_frame("lid"));
  EXPECT_EQ(bodies().size(), 4u);
  EXPECT_EQ(loop_->engine().scene().revision(), before);
}

TEST_F(Bodies, AReplacedOneKeepsItsPlace) {
  start_editable(small_scene());
  const auto replacing = [](const char* name, std::span<const std::byte> content = {}) {
    return box_frame_with(name, 24, content);
  };
  const BodyPose moved{1, Pose{{0, 0, 0.7}}};
  loop_->on_poses(std::span(&moved, 1), 5);
  EXPECT_EQ(change(replacing("cup")).body, 1u);
  EXPECT_EQ(bodies()[1].source, "box");
  EXPECT_EQ(loop_->engine().body_state(1).X_wb.translation.z, 0.7);
  EXPECT_EQ(rejection(replacing("cups")), "there is no body \"cups\"; did you mean \"cup\"?");
  EXPECT_EQ(rejection(replacing("cup", std::as_bytes(std::span("x"))), ErrorCode::kBadFrame),
            "new body: replace (record 24) has 2 bytes, expected 0");
  change(box_frame("crate"));
  a_.rights = kMayQuery | kMayPose;
  EXPECT_EQ(rejection(replacing("cup"), ErrorCode::kForbidden),
            "replacing a body of the scene file needs the right \"admin\"");
  EXPECT_EQ(rejection(replacing("crates")), "replace: \"crates\" is not in the scene; did you mean \"crate\"?");
  EXPECT_EQ(change(replacing("crate")).body, 4u);
  a_.rights = kAllRights;
  change(simple_frame(FrameType::kReload, 3));
  EXPECT_EQ(bodies()[1].source, "box") << "also after a reload";
}

TEST_F(Bodies, WhatIsNotKnownOfAnAddedOneCountsOnce) {
  start_editable(small_scene());
  const wire::BodyUncertaintyRecord uncertainties{0.1, 0.02, 0.3, 0.5};
  EXPECT_EQ(change(uncertain_frame("crate", uncertainties)).body, 4u);
  const Body& crate = bodies()[4];
  EXPECT_EQ(crate.uncertainty.angle, 0.02);
  EXPECT_EQ(crate.max_speed, 0.5);
  EXPECT_NEAR(crate.parts[0]->radius, 0.4, 1e-15) << "grown once: by the padding, and by the ball of its place";
  TestQuery query;
  query.pairs = {{0, 4}};
  const Result answer = evaluate(b_, query);

  engine::Scene whole = small_scene();
  engine::Scene::BodyOptions options = at(3, 0, 0);
  options.uncertainty = {0.1, 0.02};
  options.padding = 0.3;
  options.max_speed = 0.5;
  whole.add_box("crate", {0.2, 0.2, 0.2}, options);
  const engine::Engine engine(std::move(whole), {.threads = 1});
  EXPECT_EQ(loop_->engine().scene().revision(), engine.scene().revision());
  ASSERT_EQ(answer.rows(), 1u);
  const double known = 3 - 1 - 0.1 - 0.4;
  EXPECT_LT(answer.lower()[0], known);
  EXPECT_GT(answer.upper()[0], answer.lower()[0]) << "its turn, and the age of its pose";
  change(simple_frame(FrameType::kReload, 3));
  EXPECT_NEAR(bodies()[4].parts[0]->radius, 0.4, 1e-15) << "also after a reload";
}

TEST_F(Bodies, AnAddedMeshIsWhatItsClientSays) {
  start_editable(small_scene());
  EXPECT_EQ(change(mesh_frame("solid", kTetrahedron, 4)).body, 4u);
  EXPECT_EQ(change(mesh_frame("surface", std::span(kTetrahedron).first(3), 3)).body, 5u);
  EXPECT_EQ(change(mesh_frame("hull", kTetrahedron, std::nullopt)).body, 6u);
  ASSERT_TRUE(surface_of(bodies()[4]) && surface_of(bodies()[5]));
  EXPECT_TRUE(surface_of(bodies()[4])->is_solid());
  EXPECT_EQ(triangle_count(bodies()[5]), 3u);
  EXPECT_FALSE(surface_of(bodies()[6]));
  engine::Scene whole = small_scene();
  const std::vector<Vec3d> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<Triangle> triangles{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  whole.add_mesh("solid", corners, triangles, MeshAs::kSolid, at(3, 0, 0));
  whole.add_mesh("surface", corners, std::span(triangles).first(3), MeshAs::kSurface, at(3, 0, 0));
  whole.add_mesh("hull", corners, triangles, MeshAs::kHull, at(3, 0, 0));
  EXPECT_EQ(loop_->engine().scene().revision(), whole.revision());

  const auto reply = request_scene(a_, simple_frame(FrameType::kDescribe, 9));
  const auto parts = wire::parse_scene(wire::split_payload(reply->header(), reply->payload()).body);
  ASSERT_EQ(parts.bodies.size(), 7u);
  const auto says = [&](std::uint64_t i, std::uint64_t count, bool is_solid) {
    EXPECT_EQ(parts.bodies[i].triangle_count, count);
    EXPECT_EQ(parts.bodies[i].is_solid, is_solid);
  };
  says(0, 0, false);
  says(4, 4, true);
  says(5, 3, false);
  says(6, 0, false);
}

TEST_F(Bodies, StayThroughAReloadIfTheyFit) {
  start_editable(small_scene());
  change(box_frame("crate"));
  const BodyPose moved{4, Pose{{7, 0, 0}}};
  loop_->on_poses(std::span(&moved, 1), 5);
  const auto reloaded = change(simple_frame(FrameType::kReload, 3));
  EXPECT_EQ(reloaded.body_count, 5u);
  EXPECT_EQ(bodies()[4].name, "crate");
  EXPECT_EQ(loop_->engine().body_state(4).X_wb.translation.x, 7);
  change(remove_frame("crate"));
  EXPECT_EQ(bodies().size(), 4u);
}

TEST_F(Bodies, QueriesOfOthersAreAnsweredWhileTheyComeAndGo) {
  start_editable(scattered_scene(8));
  TestQuery pairs, moved, every;
  pairs.pairs = {{0, 5}, {3, 4}};
  moved.pairs = {{3, 4}};
  moved.bodies = {3};
  moved.configurations = {{1, 2, 3, 1, 0, 0, 0}};
  for (TestQuery* query : {&pairs, &moved, &every}) query->scene_revision = loop_->engine().scene_revision();
  const Result first = evaluate(b_, pairs), first_moved = evaluate(b_, moved);
  wire::AttachRecord record;
  record.child = 1;
  const auto attach_to = [&](std::uint32_t parent) {
    record.parent = parent;
    EXPECT_EQ(evaluate(a_, simple_frame(FrameType::kAttach, 1, std::as_bytes(std::span(&record, 1))))->type(),
              FrameType::kPosesDone);
  };
  int rejected = 0;
  const auto look = [&] {
    for (const auto& [query, was] : {std::pair(&pairs, &first), {&moved, &first_moved}}) {
      const Result now = evaluate(c_, *query);
      ASSERT_EQ(now.rows(), was->rows());
      for (std::size_t row = 0; row < now.rows(); ++row) EXPECT_EQ(now.upper()[row], was->upper()[row]);
    }
    const auto frame = evaluate(c_, every.frame(1));
    rejected += frame->type() == FrameType::kError;
  };
  for (int round = 0; round < 10; ++round) {
    change(box_frame("crate" + std::to_string(round)));
    look();
    attach_to(2);
    look();
    attach_to(kNone);
    look();
    if (round % 2) change(remove_frame("crate" + std::to_string(round - 1)));
    look();
  }
  EXPECT_EQ(rejected, 40) << "all pairs were never those of the beginning";
}

}  // namespace
}  // namespace clearance
