// A daemon that is killed and restarted, one that hangs, and clients with several daemons: the next answer must neither
// be about other poses than the caller expects, nor be late.
#include <gtest/gtest.h>
#include <signal.h>

#include "client/channel/channel.h"
#include "client/client.h"
#include "client/requests.h"
#include "tests/client/scripted_server.h"
#include "tests/patience.h"
#include "tests/server/daemon_fixture.h"
#ifdef CLEARANCE_HAVE_LCM
#include "tests/lcm/lcm_network.h"
#endif

namespace clearance {
namespace {

using namespace std::chrono_literals;

constexpr const char* kScene = R"(bodies:
  - {name: wall, box: [0.2, 4, 4], static: true, pose: [0,0,0, 1,0,0,0]}
  - {name: tool, sphere: 0.1, pose: [1.04,0,0, 1,0,0,0]}
)";
constexpr const char* kLiveScene = R"(bodies:
  - {name: wall, box: [0.2, 4, 4], static: true, pose: [0,0,0, 1,0,0,0]}
  - {name: tool, sphere: 0.1, pose: [1.04,0,0, 1,0,0,0]}
  - {name: hand, sphere: 0.1, pose: [2.04,0,0, 1,0,0,0], requires_pose: true}
groups: {arm: {bodies: [tool], requires_pose: true}}
)";
constexpr double kAtLoad = 0.84, kSet = 8.2;

/// Daemons of one scene, on every transport, always at the same endpoints.
class Site {
 public:
  Site() : scene_(folder_.write("scene.yaml", kScene)) {
    options_ = {"--scene", scene_, "--threads", "1", "--shm", folder_ / "s", "--zmq", "ipc://" + (folder_ / "z")};
#ifdef CLEARANCE_HAVE_LCM
    if (const std::optional<LcmAddress> address = own_lcm_address("restarts")) {
      lcm_ = address->url();
      options_.insert(options_.end(), {"--lcm", lcm_});
    }
#endif
    start();
  }
  void start() { daemon_.emplace(options_); }
  void kill() { daemon_->stop(SIGKILL); }
  void signal(int number) { ::kill(daemon_->pid(), number); }
  std::string url(const std::string& scheme) const {
    return scheme == "shm" ? "shm://" + (folder_ / "s") : scheme == "ipc" ? "ipc://" + (folder_ / "z") : lcm_;
  }
  /// Continues a stopped daemon, which could not end otherwise.
  ~Site() {
    if (daemon_->pid() > 0) signal(SIGCONT);
  }

 private:
  TestFolder folder_;
  std::string scene_, lcm_;
  std::vector<std::string> options_;
  std::optional<Daemon> daemon_;
};

/// Repeats a call until there is an answer: packets may be lost, and on a busy machine a daemon may seem dead.
template <class Call>
auto surely(Call call) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  for (;;) try {
      return call();
    } catch (const ConnectionError&) {
      if (std::chrono::steady_clock::now() > deadline) throw;
    }
}
double distance_of(Client& client) {
  return surely([&] { return client.distances().distance()[0]; });
}
void move_tool(Client& client) {
  surely([&] { return client.set_poses({{"tool", {kSet + 0.2, 0, 0, 1, 0, 0, 0}}}); });
}

/// How the calls after a restart end, until one is answered or rejected by name.
enum class Ending { kAnswered, kNewEpoch };
Ending request_until_someone_is_there(Client& client) {
  return surely([&] {
    try {
      client.distances();
      return Ending::kAnswered;
    } catch (const NewEpoch&) {
      return Ending::kNewEpoch;
    }
  });
}

class Restarts : public testing::TestWithParam<const char*> {};

TEST_P(Restarts, AreNeverPassedOverInSilence) {
  Site site;
  if (site.url(GetParam()).empty()) GTEST_SKIP() << "no multicast here";
  Client client = connect(site.url(GetParam()), {.timeout = kPatience});
  if (GetParam() == std::string("udpm")) client.set_timeout(5s);  // it may lose an answer
  move_tool(client);
  EXPECT_NEAR(distance_of(client), kSet, 1e-6);
  const std::uint64_t first = client.epoch();
  EXPECT_NE(first, 0u);

  site.kill();
  site.start();
  EXPECT_EQ(request_until_someone_is_there(client), Ending::kNewEpoch);
  EXPECT_THROW(distance_of(client), NewEpoch) << "and so it stays";
  EXPECT_THROW(move_tool(client), NewEpoch);
  EXPECT_THROW(surely([&] { return client.body_states(); }), NewEpoch);
  EXPECT_EQ(client.epoch(), first);

  const std::uint64_t second = client.acknowledge_epoch();
  EXPECT_NE(second, first);
  EXPECT_EQ(client.epoch(), second);
  EXPECT_NEAR(distance_of(client), kAtLoad, 1e-6) << "the caller knows now";
  move_tool(client);
  EXPECT_NEAR(distance_of(client), kSet, 1e-6);
}

TEST_P(Restarts, AReloadIsNone) {
  Site site;
  if (site.url(GetParam()).empty()) GTEST_SKIP() << "no multicast here";
  Client client = patient(site.url(GetParam()));
  move_tool(client);
  const std::uint64_t epoch = client.epoch();
  patient(site.url("shm")).reload(kPatience);
  EXPECT_NEAR(distance_of(client), kSet, 1e-6);
  EXPECT_EQ(client.distances().epoch(), epoch);
}

TEST_P(Restarts, AHungDaemonIsNoticedLongBeforeTheTimeout) {
  Site site;
  if (site.url(GetParam()).empty()) GTEST_SKIP() << "no multicast here";
  Client client = connect(site.url(GetParam()), {.timeout = kPatience, .hang = 300ms});
  client.set_timeout(kPatience);
  move_tool(client);
  site.signal(SIGSTOP);
  EXPECT_THROW(client.distances(), DaemonHung);
  site.signal(SIGCONT);
  EXPECT_NEAR(distance_of(client), kSet, 1e-6) << "the same daemon as before";
}

TEST(Hangs, AreNoticedWhereARequestNeedsALargerSegment) {
  Site site;
  Client client = connect(site.url("shm"), {.timeout = kPatience, .hang = 300ms});
  client.set_timeout(kPatience);
  const std::vector<IdPair> pairs(100'000, {0, 1});  // 800 KB, while a slot has 256
  Query query;
  query.pairs = pairs;
  site.signal(SIGSTOP);
  EXPECT_THROW(client.distances(query), DaemonHung);
  site.signal(SIGCONT);
  EXPECT_EQ(client.distances(query).rows(), pairs.size()) << "over another connection";
}

TEST(Hangs, AreNoticedWhereARequestNeedsTheSlotOfOneThatWasGivenUp) {
  Site site;
  Client client = connect(site.url("shm"), {.timeout = kPatience, .hang = 300ms});
  client.set_timeout(1us);
  site.signal(SIGSTOP);
  constexpr int kSlots = 16;
  int given_up = 0;
  const auto request_until_hung = [&] {
    for (; given_up <= kSlots; ++given_up) try {
        client.distances();
      } catch (const TimeoutError&) {
      }
  };
  EXPECT_THROW(request_until_hung(), DaemonHung);
  site.signal(SIGCONT);
  client.set_timeout(kPatience);
  EXPECT_NEAR(distance_of(client), kAtLoad, 1e-6);
}

TEST(LiveBodies, HaveNoPoseUntilOneIsReceivedAlsoAfterAReload) {
  const TestFolder folder;
  Daemon daemon({"--scene", folder.write("scene.yaml", kLiveScene), "--threads", "1", "--shm", folder / "s"});
  Client client = patient(daemon.url());
  const auto statuses = [&] {
    const Result reply = client.distances();
    return std::vector<Status>(reply.status().begin(), reply.status().end());
  };
  EXPECT_EQ(statuses(), std::vector<Status>(3, Status::kNoPose));
  client.set_poses({{"tool", {1, 0, 0, 1, 0, 0, 0}}});
  EXPECT_EQ(statuses(), (std::vector<Status>{Status::kOk, Status::kNoPose, Status::kNoPose}));
  client.reload(kPatience);
  EXPECT_EQ(statuses(), (std::vector<Status>{Status::kOk, Status::kNoPose, Status::kNoPose}));
  client.set_poses({{"hand", {2, 0, 0, 1, 0, 0, 0}}});
  EXPECT_EQ(statuses(), std::vector<Status>(3, Status::kOk));
  Query query;
  query.max_pose_age_ns = 1;
  const Result reply = client.distances(query);
  EXPECT_EQ(std::vector<Status>(reply.status().begin(), reply.status().end()),
            std::vector<Status>(3, Status::kStalePose));
}

INSTANTIATE_TEST_SUITE_P(Over, Restarts, testing::Values("shm", "ipc", "udpm"),
                         [](const auto& transport) { return std::string(transport.param); });

/// Returns whether the channel shows two successive signs of life.
bool lives(Channel& channel) {
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  std::uint64_t first = channel.sign_of_life();
  while (std::chrono::steady_clock::now() < deadline) {
    (void)channel.receive(1, std::chrono::steady_clock::now() + 10ms);
    const std::uint64_t sign = channel.sign_of_life();
    if (first && sign != first) return true;
    first = sign;
  }
  return false;
}

TEST(Hangs, ALoopThatSleepsIsNone) {
  const Site site;
  for (const char* scheme : {"shm", "ipc"}) {
    SCOPED_TRACE(scheme);
    const auto channel = open_channel(site.url(scheme), {}, std::chrono::steady_clock::now() + kPatience);
    Query query;
    query.min_pose_stamp_ns = 1000;
    query.deadline_ns = 10'000'000'000;  // meanwhile there is nothing to do
    const auto q = header_of(query);
    const auto header = wire::make_header(wire::FrameType::kQuery, 1, sizeof q);
    wire::write_query(channel->begin(sizeof header + sizeof q, 0), header, q, nullptr, nullptr, nullptr);
    channel->send();
    EXPECT_TRUE(lives(*channel));
    EXPECT_EQ(channel->receive(1, std::chrono::steady_clock::now()), nullptr) << "it still waits";
  }
}

TEST(Hangs, OfTheLoopAloneAreSeenThroughZeroMqWhoseThreadGoesOn) {
  std::atomic<bool> over = false;
  ScriptedServer server([&](const auto&...) {
    while (!over) std::this_thread::sleep_for(1ms);  // the loop; libzmq's thread answers the connection
    return std::vector<ScriptedServer::Bytes>{};
  });
  Client client = connect(server.url(), {.timeout = kPatience, .hang = 100ms});
  client.set_timeout(kPatience);
  EXPECT_THROW(client.distances(), DaemonHung);
  over = true;
}

TEST(Hangs, ALateAnswerIsNone) {
  ScriptedServer server([](const auto&...) { return std::vector<ScriptedServer::Bytes>{}; });
  const auto channel = open_channel(server.url(), {}, std::chrono::steady_clock::now() + kPatience);
  const auto header = wire::make_header(wire::FrameType::kDescribe, 1, 0);
  std::memcpy(channel->begin(sizeof header, 0), &header, sizeof header);
  channel->send();
  EXPECT_TRUE(lives(*channel));
}

TEST(Hangs, ThePatienceIsWithinReason) {
  EXPECT_THROW(connect("ipc:///nowhere", {.hang = 1ms}), std::invalid_argument);
}

TEST(Endpoints, TheNextOneIsAnotherDaemon) {
  Site one, two;
  const std::string urls[] = {one.url("shm"), two.url("ipc")};
  Client client = connect(urls, {.timeout = kPatience, .hang = 2s});
  client.set_timeout(kPatience);
  EXPECT_EQ(client.url(), urls[0]);
  move_tool(client);
  for (int round = 0; round < 2; ++round) {
    if (round == 0)
      one.signal(SIGSTOP);  // hung
    else
      two.kill();  // gone
    if (round == 1) one.signal(SIGCONT);
    EXPECT_THROW(client.distances(), ConnectionError);
    EXPECT_EQ(request_until_someone_is_there(client), Ending::kNewEpoch);
    EXPECT_EQ(client.url(), urls[1 - round]);
    client.acknowledge_epoch();
    EXPECT_NEAR(distance_of(client), round == 0 ? kAtLoad : kSet, 1e-6) << "nothing was carried over";
  }
}

TEST(Endpoints, AnyOfThemWillDoAtFirst) {
  const Site site;
  const TestFolder folder;
  const std::string urls[] = {"shm://" + (folder / "s"), "ipc://" + (folder / "z"), site.url("ipc")};
  EXPECT_EQ(connect(urls, {}).url(), site.url("ipc"));
  try {
    connect(std::span(urls).first(2), {});
    ADD_FAILURE() << "nobody is there";
  } catch (const ConnectionError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find(urls[0]), std::string::npos) << text;
    EXPECT_NE(text.find(urls[1]), std::string::npos) << text;
  }
  const std::string bad[] = {site.url("ipc"), "http://here"};
  EXPECT_THROW(connect(bad, {}), std::invalid_argument) << "said at once, not when its turn comes";
  EXPECT_THROW(connect(std::span<const std::string>(), {}), std::invalid_argument);
}

}  // namespace
}  // namespace clearance
