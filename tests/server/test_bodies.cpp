// Bodies that are added and removed while the daemon serves.
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <random>
#include <sstream>
#include <thread>

#include "client/client.h"
#include "engine/bvh/surface.h"
#include "tests/patience.h"
#include "tests/server/body_frames.h"
#include "tests/server/core/loop_fixture.h"
#include "tests/server/daemon_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

class Bodies : public LoopTest {
 protected:
  void start_editable(engine::Scene scene, Loop::Options options = {}) {
    start(std::move(scene), options);
    loop_->reload_by([] { return std::make_unique<engine::Engine>(small_scene()); },
                     [this](engine::Scene next) {
                       ++built_;
                       while (hold_) std::this_thread::yield();
                       return std::make_unique<engine::Engine>(std::move(next), engine::Engine::Options{.threads = 1});
                     });
  }
  std::unique_ptr<MemoryFrame> request_scene(MemoryClient& client, std::vector<std::byte> frame) {
    transport_->send(client, std::move(frame));
    while (client.replies.empty()) loop_->turn();
    return take(client);
  }
  wire::SceneChange change(std::vector<std::byte> frame) {
    const auto reply = request_scene(a_, std::move(frame));
    EXPECT_EQ(reply->type(), FrameType::kSceneChanged);
    if (reply->type() != FrameType::kSceneChanged) return {};
    return wire::parse_scene_changed(wire::split_payload(reply->header(), reply->payload()).body);
  }
  /// The rejection's message; checks that the scene is unchanged.
  std::string rejection(std::vector<std::byte> frame, ErrorCode code = ErrorCode::kBadQuery) {
    const std::uint64_t before = loop_->engine().scene_revision();
    const auto error = error_of(request_scene(a_, std::move(frame)));
    EXPECT_EQ(static_cast<ErrorCode>(error.header.code), code) << error.text;
    EXPECT_EQ(loop_->engine().scene_revision(), before);
    return error.text;
  }
  const std::vector<Body>& bodies() { return loop_->engine().scene().bodies(); }

  std::atomic<int> built_{0};
  std::atomic<bool> hold_{false};
};

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

TEST_F(Bodies, WhatCannotBeAddedIsRejectedAndChangesNothing) {
  Loop::Options options;
  options.max_added_bodies = 2;
  options.max_added_vertices = 8;
  start_editable(small_scene(), options);
  EXPECT_NE(rejection(box_frame("cup")).find("is already that of a body"), std::string::npos);
  EXPECT_NE(rejection(box_frame("arm")).find("is already that of a group"), std::string::npos);
  EXPECT_NE(rejection(box_frame("")).find("name is empty"), std::string::npos);
  EXPECT_EQ(rejection(box_frame("x", 99)), "add_body: the parent, body 99, is not in the scene");
  const auto odd = [](auto spoil, std::size_t vertices = 0) {
    wire::NewBodyRecord record;
    wire::set_name(record.name, "odd");
    record.vertex_count = vertices;
    spoil(record);
    std::vector<std::byte> payload;
    wire::append(payload, record);
    payload.resize(payload.size() + vertices * sizeof(wire::VertexRecord));
    return simple_frame(FrameType::kAddBody, 1, payload);
  };
  EXPECT_NE(rejection(odd([](auto&) {})).find("body \"odd\""), std::string::npos) << "the hull of nothing";
  EXPECT_NE(rejection(odd([](auto& r) { r.shape = 2, r.size[0] = -1; })).find("sphere radius: expected"),
            std::string::npos);
  EXPECT_NE(rejection(odd([](auto& r) { r.shape = 2, r.size[0] = NAN; })).find("sphere radius: expected"),
            std::string::npos);
  EXPECT_NE(rejection(odd([](auto& r) { r.shape = 2, r.size[0] = 1, r.has_pose = 1; })).find("pose: expected"),
            std::string::npos)
      << "a quaternion of zeros";
  EXPECT_EQ(rejection(odd([](auto& r) { r.shape = 9; })), "new body: shape 9 is not one of 0 to 8");
  EXPECT_EQ(rejection(odd([](auto& r) { r.shape = 1; }, 1)), "new body: vertices are only for a hull");
  EXPECT_EQ(rejection(odd([](auto&) {}, 9), ErrorCode::kTooLarge),
            "add_body: 9 vertices are more than the 8 that an added body may have (limit max-added-vertices)");
  EXPECT_EQ(change(odd([](auto&) {}, 8)).body, 4u) << "eight times the origin: a point";
  change(box_frame("crate"));
  EXPECT_EQ(rejection(box_frame("one more")),
            "add_body: 2 bodies were added already, the maximum (limit max-added-bodies)");
  change(remove_frame("odd"));
  EXPECT_EQ(change(box_frame("one more")).body, 5u);
  EXPECT_EQ(a_.sinks, 0);
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

TEST_F(Bodies, AMeshThatMakesNoSenseIsRejected) {
  Loop::Options options;
  options.max_added_triangles = 4;
  start_editable(small_scene(), options);
  const auto open = std::span(kTetrahedron).first(3);
  EXPECT_EQ(rejection(mesh_frame("m", open, 4)),
            "body \"m\": mesh_as: solid: the mesh encloses no volume: the edge from (0, 0, 0) to (0, 1, 0) of triangle "
            "0 belongs to no other triangle: the mesh is open there");
  const wire::TriangleRecord beyond[] = {{{0, 1, 4}}};
  for (const std::uint8_t how : {0, 3, 4})
    EXPECT_EQ(rejection(mesh_frame("m", beyond, how)), "body \"m\": triangle 0 names the vertex 4, and there are 4");
  EXPECT_NE(rejection(mesh_frame("m", open, 2)).find("mesh_as: decompose: only for a mesh file"), std::string::npos);
  EXPECT_EQ(rejection(mesh_frame("m", open, 6)), "new body: mesh_as 6 is not one of 0 to 5");
  EXPECT_EQ(rejection(mesh_frame("m", {}, 4)), "new body: mesh_as is for a mesh, and there are no triangles");
  EXPECT_EQ(rejection(mesh_frame("m", open, 3, wire::BodyShape::kBox)), "new body: triangles are only for vertices");
  const std::vector<wire::TriangleRecord> many(5, kTetrahedron[0]);
  EXPECT_EQ(rejection(mesh_frame("m", many, 3), ErrorCode::kTooLarge),
            "add_body: 5 triangles are more than the 4 that an added body may have (limit max-added-triangles)");
  EXPECT_EQ(rejection(uncertain_frame("crate", std::uint64_t{0}, 21), ErrorCode::kBadFrame),
            "new body: triangles (record 21) have 8 bytes, expected 12 for each, and one at least");
  EXPECT_EQ(rejection(uncertain_frame("crate", std::uint16_t{0}, 22), ErrorCode::kBadFrame),
            "new body: mesh_as (record 22) has 2 bytes, expected 1");
  EXPECT_EQ(change(mesh_frame("m", kTetrahedron, 4)).body, 4u);
}

TEST_F(Bodies, ACloudThatMakesNoSenseIsRejected) {
  Loop::Options options;
  options.max_added_points = 2;
  start_editable(small_scene(), options);
  const auto cloud = [](std::span<const float> xyz, wire::BodyShape shape = wire::BodyShape::kCloud, double voxel = 0) {
    wire::NewBodyRecord record;
    wire::set_name(record.name, "cloud");
    record.shape = static_cast<std::uint8_t>(shape);
    record.size[0] = voxel;
    std::vector<std::byte> payload, records;
    wire::append(payload, record);
    wire::append_record(records, 23, wire::kRecordRequired, std::as_bytes(xyz));
    std::vector<std::byte> frame = simple_frame(FrameType::kAddBody, 1, payload);
    wire::FrameHeader header;
    std::memcpy(&header, frame.data(), sizeof header);
    header = wire::with_records(header, records.size());
    std::memcpy(frame.data(), &header, sizeof header);
    frame.insert(frame.end(), records.begin(), records.end());
    return frame;
  };
  const float two[] = {0, 0, 1, 2, 3, 4}, far[] = {0, NAN, 0}, three[9] = {};
  EXPECT_EQ(rejection(cloud(std::span(two).first(2)), ErrorCode::kBadFrame),
            "new body: points (record 23) have 8 bytes, expected 12 for each");
  EXPECT_EQ(rejection(cloud(two, wire::BodyShape::kBox)), "new body: points are only for a cloud");
  EXPECT_EQ(rejection(cloud(three), ErrorCode::kTooLarge),
            "add_body: 3 points are more than the 2 that an added body may have (limit max-added-points)");
  EXPECT_NE(rejection(cloud(far)).find("body \"cloud\""), std::string::npos);
  EXPECT_NE(rejection(cloud(two, wire::BodyShape::kCloud, NAN)).find("voxel"), std::string::npos);
  const std::uint32_t body = change(cloud(two)).body;
  EXPECT_EQ(body, 4u);
  EXPECT_TRUE(is_cloud(loop_->engine().scene().bodies()[body]));
}

TEST_F(Bodies, UncertaintiesThatMakeNoSenseAreRejected) {
  start_editable(small_scene());
  const auto rejected = [&](const wire::BodyUncertaintyRecord& uncertainties, const std::string& text) {
    EXPECT_NE(rejection(uncertain_frame("crate", uncertainties)).find(text), std::string::npos) << text;
  };
  rejected({-1, 0, 0, 0}, "body \"crate\": uncertainty.position: expected a number of metres >= 0, got -1");
  rejected({NAN, 0, 0, 0}, "uncertainty.position: expected a number of metres >= 0, got nan");
  rejected({0, 4, 0, 0}, "uncertainty.angle: expected 0 to 3.2 radians, got 4");
  rejected({0, 0, INFINITY, 0}, "padding: expected a number of metres >= 0, got inf");
  rejected({0, 0, 0, -0.5}, "max_speed: expected a number of metres a second >= 0, got -0.5");
  EXPECT_EQ(rejection(uncertain_frame("crate", 1.0), ErrorCode::kBadFrame),
            "new body: uncertainty (record 20) has 8 bytes, expected 32");
  EXPECT_EQ(rejection(uncertain_frame("crate", wire::BodyUncertaintyRecord{}, 19), ErrorCode::kNotSupported),
            "new body: record 19 is required but unknown to this side");
  EXPECT_EQ(change(uncertain_frame("crate", wire::BodyUncertaintyRecord{})).body, 4u);
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

TEST_F(Bodies, WhereNoneCanBeMadeTheyAreRejected) {
  start(small_scene());
  EXPECT_EQ(rejection(box_frame("crate"), ErrorCode::kNotSupported), "bodies can be neither added nor removed here");
}

TEST(ClearancedBodies, TheirNamesStayWithinTheirLineOfTheLog) {
  const TestFolder folder;
  Daemon daemon(
      {"--scene", folder.write("scene.yaml", kSmallSceneYaml), "--shm", folder / "c.sock", "--log-level", "debug"});
  Client client = connect(daemon.url());
  const std::string name = "x\n\x1b[2J\" event=reloaded";
  EXPECT_THROW(client.remove_body(name), RequestError);
  EXPECT_THROW(client.remove_body(name + "\r"), RequestError);
  const std::string log = daemon.log();
  int failures = 0;
  std::istringstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_EQ(line.rfind("time=", 0), 0u) << line;
    failures +=
        line.find(R"(x\n\x1b[2J)") != std::string::npos && line.find(R"(\" event=reloaded)") != std::string::npos;
  }
  EXPECT_GE(failures, 2) << log;
  EXPECT_EQ(log.find('\x1b'), std::string::npos);
}

// A client that continues after a rejection with its old ids gets no answer about other bodies.
TEST(ClearancedBodies, OldIdsAreNeverAnsweredForOtherBodies) {
  const TestFolder folder;
  Daemon daemon({"--scene", folder.write("scene.yaml", kSmallSceneYaml), "--shm", folder / "c.sock", "--zmq",
                 "ipc://" + (folder / "c.ipc")});
  Client other = patient(daemon.url());
  const auto ball = [](const char* name, double x) {
    return NewBody{.name = name, .sphere = 0.1, .pose = Pose7{x, 0, 2, 1, 0, 0, 0}};
  };
  other.add_body(ball("near", 0));
  other.add_body(ball("far", 50));
  for (const std::string& url : daemon.urls()) {
    Client client = patient(url);
    const IdPair pair{client.body("near"), client.body("far")};
    Query query;
    query.pairs = std::span(&pair, 1);
    EXPECT_NEAR(client.distances(query).distance()[0], 49.8, 1e-4);
    other.remove_body("near");
    other.add_body(ball("near", 0));
    ASSERT_EQ(other.body("near"), pair[1]) << "the ids have changed places";
    other.remove_body("far");
    other.add_body(ball("third", 7));
    const auto rejected = [&](const auto& call) {
      try {
        call();
      } catch (const RequestError& error) {
        return error.code == static_cast<std::uint16_t>(ErrorCode::kWrongScene);
      }
      return false;
    };
    const Pose7 elsewhere{0, 0, 9, 1, 0, 0, 0};
    EXPECT_EQ(client.set_poses(std::array{std::pair{1u, elsewhere}}).applied, 1u) << "the cup is the cup still";
    for (int i = 0; i < 3; ++i) {
      EXPECT_TRUE(rejected([&] { client.distances(query); })) << url << ", time " << i;
      EXPECT_TRUE(rejected([&] { client.submit(query).get(); })) << url << ", time " << i;
      EXPECT_TRUE(rejected([&] { client.pairs(query); })) << url << ", time " << i;
      EXPECT_TRUE(rejected([&] { client.attach(pair[0], pair[1]); })) << url << ", time " << i;
      EXPECT_TRUE(rejected([&] {
        client.set_poses(std::array{std::pair{pair[1], elsewhere}});
      })) << url
          << ", time " << i;
    }
    EXPECT_EQ(client.scene().bodies[pair[1]].name, "third");
    EXPECT_NEAR(client.distances(query).distance()[0], 6.8, 1e-5) << "now it knows";
    other.remove_body("near");
    other.remove_body("third");
    other.add_body(ball("near", 0));
    other.add_body(ball("far", 50));
  }
}

TEST(ClearancedBodies, WhatAClientChangesItselfItNeedNotLookAt) {
  const TestFolder folder;
  Daemon daemon({"--scene", folder.write("scene.yaml", kSmallSceneYaml), "--shm", folder / "c.sock"});
  Client client = patient(daemon.url());
  const IdPair pair{client.body("table"), client.body("cup")};
  Query query;
  query.pairs = std::span(&pair, 1);
  for (const char* name : {"one", "two"}) {
    client.add_body({.name = name, .sphere = 0.1, .pose = Pose7{5, 0, 2, 1, 0, 0, 0}});
    EXPECT_EQ(client.distances(query).rows(), 1u);
  }
  const std::uint32_t two = client.body("two");
  client.attach(two, pair[1]);
  const IdPair with_two{0, two};
  query.pairs = std::span(&with_two, 1);
  EXPECT_EQ(client.distances(query).rows(), 1u);
  client.attach(two, kNone);
  client.remove_body("one");  // `two` now has its id
  EXPECT_THROW(client.distances(query), RequestError);
  EXPECT_EQ(client.body("two"), two - 1);
  EXPECT_EQ(client.distances(query).status()[0], Status::kUnknownBody);
  client.remove_body("two");
  EXPECT_EQ(client.distances(query).status()[0], Status::kUnknownBody) << "nobody else has its id";
}

TEST(ClearancedBodies, AreQueriedByEveryClient) {
  const TestFolder folder;
  Daemon daemon({"--scene", folder.write("scene.yaml", kSmallSceneYaml), "--shm", folder / "c.sock", "--zmq",
                 "ipc://" + (folder / "c.ipc")});
  Client one = patient(daemon.urls()[0]), other = patient(daemon.urls()[1]);
  other.scene();
  NewBody ball{.name = "ball", .sphere = 0.25, .pose = Pose7{0, 0, 2, 1, 0, 0, 0}};
  const SceneChanged added = one.add_body(ball);
  EXPECT_EQ(added.body, one.body("ball"));
  const IdPair pair{0, added.body};
  Query query;
  query.pairs = std::span(&pair, 1);
  EXPECT_NEAR(one.distances(query).distance()[0], 2 - 0.05 - 0.25, 2e-6);
  EXPECT_THROW(other.distances(query), RequestError) << "the scene that it knows is gone";
  other.scene();
  EXPECT_EQ(other.distances(query).rows(), 1u);

  const std::array<double, 3> corners[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  one.add_body({.name = "wedge", .vertices = corners, .parent = one.body("ball"), .pose = Pose7{0, 0, 1, 1, 0, 0, 0}});
  EXPECT_EQ(one.scene().bodies[5].parent, 4u);
  const std::array<std::uint32_t, 3> faces[] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  one.add_body({.name = "solid", .vertices = corners, .triangles = faces, .mesh_as = MeshAs::kSolid});
  EXPECT_EQ(one.scene().bodies[6].triangle_count, 4u);
  EXPECT_TRUE(one.scene().bodies[6].is_solid);
  EXPECT_EQ(one.scene().bodies[5].triangle_count, 0u);
  one.remove_body("solid");
  EXPECT_THROW(one.add_body({.name = "m", .vertices = corners, .mesh_as = MeshAs::kSolid}), std::invalid_argument);
  EXPECT_THROW(one.add_body({.name = "m", .sphere = 1.0, .triangles = faces}), std::invalid_argument);
  EXPECT_THROW(one.add_body({.name = "nothing"}), std::invalid_argument);
  EXPECT_THROW(one.add_body({.name = std::string(64, 'x'), .sphere = 1.0}), std::invalid_argument);
  EXPECT_THROW(one.remove_body("table"), RequestError);
  one.remove_body("wedge");
  EXPECT_EQ(one.remove_body("ball").body_count, 4u);
  EXPECT_EQ(daemon.stop(SIGTERM), 0);
}

}  // namespace
}  // namespace clearance
