// Two daemons on the same channels of one LCM network: a client gets the answers of one of them, or an error.
#include <gtest/gtest.h>

#include <csignal>
#include <memory>

#include "clearance_lcm/pose_update_t.hpp"
#include "client/client.h"
#include "tests/lcm/lcm_fixture.h"
#include "tests/server/daemon_fixture.h"

namespace clearance {
namespace {

constexpr const char* kScene = R"(bodies:
  - {name: wall, box: [0.2, 4, 4], static: true, pose: [0,0,0, 1,0,0,0]}
  - {name: tool, sphere: 0.1, pose: [1.04,0,0, 1,0,0,0]}
)";
constexpr const char* kOtherScene = R"(bodies:
  - {name: post, sphere: 0.1, static: true, pose: [0,0,0, 1,0,0,0]}
  - {name: hand, sphere: 0.1, pose: [3.2,0,0, 1,0,0,0]}
)";
constexpr double kAtLoad = 0.84, kInOne = 0.5, kInTwo = 2;

Pose7 apart(double distance) {
  return {distance + 0.2, 0, 0, 1, 0, 0, 0};
}

class LcmTwoDaemonsTest : public LcmTest {
 protected:
  /// \param name of its socket
  std::unique_ptr<Daemon> start(const std::string& name, const char* scene = kScene) {
    return std::make_unique<Daemon>(std::vector<std::string>{
        "--scene", folder_.write(name + ".yaml", scene), "--threads", "1", "--lcm", url(), "--shm", folder_ / name});
  }
  Client over_shm(const std::string& name) { return patient("shm://" + (folder_ / name)); }
  std::uint64_t epoch_of(const std::string& name) { return over_shm(name).epoch(); }
  void move_tool(const std::string& name, double distance) { over_shm(name).set_poses({{"tool", apart(distance)}}); }
  static double distance_of(Client& client) {
    return patiently(client, [&] { return client.distances().distance()[0]; });
  }
  /// Queries until the result is an error other than a lost packet; fails the test for an answer.
  template <class Error>
  static std::string error_of(Client& client) {
    try {
      ADD_FAILURE() << "answered with " << distance_of(client);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  /// Connects until both daemons were received in time.
  std::string error_of_connect() {
    for (const auto end = std::chrono::steady_clock::now() + kPatience; std::chrono::steady_clock::now() < end;) {
      try {
        EXPECT_NE(connect(url(), kPatience).epoch(), 0u);
      } catch (const ConnectionError& error) {
        return error.what();
      }
    }
    return "";
  }
  TestFolder folder_;
};

TEST_F(LcmTwoDaemonsTest, FromTheStartAreAnErrorThatNamesThem) {
  auto one = start("one"), two = start("two");
  const std::string error = error_of_connect();
  EXPECT_EQ(error.find(url() + ": 2 daemons answer under the same channels (server ids "), 0u) << error;
  EXPECT_NE(error.find("give each a prefix of its own (prefix= in the url)"), std::string::npos) << error;
  two->stop(SIGKILL);
  Client client = connect(url(), kPatience);
  EXPECT_EQ(client.epoch(), epoch_of("one"));
}

TEST_F(LcmTwoDaemonsTest, AClientKeepsTheOneItIsBoundTo) {
  for (const char* scene : {kScene, kOtherScene}) {
    auto one = start("one");
    Client client = connect(url(), kPatience);
    move_tool("one", kInOne);
    std::vector<Pending> under_way;
    for (int i = 0; i < 4; ++i) under_way.push_back(client.submit());
    auto two = start("two", scene);
    if (scene == kScene) move_tool("two", kInTwo);
    for (int i = 0; i < 4; ++i) under_way.push_back(client.submit());
    for (Pending& pending : under_way) EXPECT_NEAR(pending.get().distance()[0], kInOne, 1e-6);
    for (int i = 0; i < 20; ++i) EXPECT_NEAR(distance_of(client), kInOne, 1e-6);
    EXPECT_EQ(client.epoch(), epoch_of("one"));
    EXPECT_EQ(client.acknowledge_epoch(), epoch_of("one")) << "the one that it is bound to is there";
    EXPECT_EQ(client.scene().bodies[1].name, "tool");
    patiently(client, [&] { return client.set_poses({{"tool", apart(kAtLoad)}}); });
    EXPECT_NEAR(distance_of(client), kAtLoad, 1e-6);
    Client other = over_shm("two");
    EXPECT_NEAR(other.distances().distance()[0], scene == kScene ? kInTwo : 3.0, 1e-6)
        << "moved by its own clients alone";
  }
}

TEST_F(LcmTwoDaemonsTest, TheDeathOfTheBoundOneIsANewEpoch) {
  auto one = start("one");
  Client client = connect(url(), kPatience);
  auto two = start("two");
  move_tool("one", kInOne);
  move_tool("two", kInTwo);
  EXPECT_NEAR(distance_of(client), kInOne, 1e-6);
  const std::uint64_t first = client.epoch();
  one->stop(SIGKILL);
  for (int i = 0; i < 3; ++i) {
    const std::string error = error_of<NewEpoch>(client);
    EXPECT_NE(error.find("restarted or replaced"), std::string::npos) << error;
  }
  EXPECT_EQ(client.epoch(), first);
  Pending under_way = client.submit();
  EXPECT_EQ(client.acknowledge_epoch(), epoch_of("two"));
  EXPECT_THROW(under_way.get(), NewEpoch) << "it was for the other daemon";
  EXPECT_NEAR(distance_of(client), kInTwo, 1e-6);

  one = start("one");  // and the client keeps its daemon
  EXPECT_NEAR(distance_of(client), kInTwo, 1e-6);
}

TEST_F(LcmTwoDaemonsTest, ARestartWithAnotherOneIsAnErrorThatNamesBoth) {
  auto one = start("one");
  Client client = connect(url(), kPatience);
  auto two = start("two");
  one->stop(SIGKILL);
  one = start("one");
  error_of<NewEpoch>(client);
  try {
    const std::uint64_t epoch = client.acknowledge_epoch();
    EXPECT_TRUE(epoch == epoch_of("one") || epoch == epoch_of("two")) << "the other one was late";
  } catch (const ConnectionError& error) {
    EXPECT_EQ(std::string(error.what()).find(url() + ": 2 daemons answer"), 0u) << error.what();
  }
  two->stop(SIGKILL);
  EXPECT_EQ(patiently(client, [&] { return client.acknowledge_epoch(); }), epoch_of("one"));
  EXPECT_NEAR(distance_of(client), kAtLoad, 1e-6);
}

TEST_F(LcmTwoDaemonsTest, AHungOneIsNotReplacedByTheOther) {
  auto one = start("one");
  Client client = connect(url(), kPatience);
  auto two = start("two");
  move_tool("one", kInOne);
  move_tool("two", kInTwo);
  EXPECT_NEAR(distance_of(client), kInOne, 1e-6);
  ::kill(one->pid(), SIGSTOP);
  error_of<NewEpoch>(client);
  ::kill(one->pid(), SIGCONT);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  for (bool is_back = false; !is_back && std::chrono::steady_clock::now() < end;) {
    try {
      EXPECT_NEAR(distance_of(client), kInOne, 1e-6);
      is_back = true;
    } catch (const NewEpoch&) {  // until it is received
    }
  }
  EXPECT_NEAR(distance_of(client), kInOne, 1e-6);
}

TEST_F(LcmTwoDaemonsTest, PublishedPosesReachBoth) {
  auto one = start("one");
  Client client = connect(url(), kPatience);
  auto two = start("two");
  LcmBus bus(address_);
  clearance_lcm::pose_update_t update{};
  update.publisher_id = 7;
  update.count = 1;
  update.names = {"tool"};
  const Pose7 pose = apart(kInTwo);
  update.poses = {{pose.begin(), pose.end()}};
  for (const char* name : {"one", "two"}) {
    Client there = over_shm(name);
    do {
      ++update.sequence;
      ASSERT_TRUE(bus.publish_message("CLEARANCE_POSES", update));
    } while (there.distances().snapshot_sequence() == 0);
    EXPECT_NEAR(there.distances().distance()[0], kInTwo, 1e-6);
  }
  EXPECT_NEAR(distance_of(client), kInTwo, 1e-6);
  EXPECT_EQ(client.epoch(), epoch_of("one"));
}

}  // namespace
}  // namespace clearance
