// Clients of a daemon whose bodies come and go.
#include <gtest/gtest.h>
#include <signal.h>

#include <sstream>

#include "client/client.h"
#include "tests/patience.h"
#include "tests/server/daemon_fixture.h"
#include "wire/protocol.h"

namespace clearance {
namespace {

using wire::ErrorCode;

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
      EXPECT_TRUE(rejected([&] { client.set_poses(std::array{std::pair{pair[1], elsewhere}}); }))
          << url << ", time " << i;
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
  EXPECT_EQ(client.distances(query).status()[0], Status::kUnknownBody) << "no other body has its id";
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
