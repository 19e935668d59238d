// Shared memory with a real clearanced: replies have the engine's own bits, and neither side's death harms the other.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>

#include "client/channel/channel.h"
#include "client/client.h"
#include "engine/engine.h"
#include "tests/engine/engine_test_util.h"
#include "tests/patience.h"
#include "tests/prepared_calls.h"
#include "tests/server/daemon_fixture.h"
#include "tests/source_file.h"

namespace clearance {
namespace {

using namespace std::chrono_literals;

const std::string kScene = source_file("scenes/random_100/scene.yaml");

Deadline soon() {
  return std::chrono::steady_clock::now() + kPatience;
}

template <class T, class U>
bool same_bits(std::span<const T> a, const U* b) {
  static_assert(sizeof(T) == sizeof(U) || sizeof(T) % sizeof(U) == 0);
  return std::memcmp(a.data(), b, a.size_bytes()) == 0;
}

class ShmDaemon : public testing::Test {
 protected:
  std::vector<std::string> options() const { return {"--scene", kScene, "--shm", path_, "--threads", "1"}; }

  TestFolder folder_;
  std::string path_ = folder_ / "c.sock";
};

TEST_F(ShmDaemon, TheEnginesOwnBitsComeBack) {
  Daemon daemon(options());
  Client client = patient(daemon.url());
  engine::Engine engine(engine::Scene::load(kScene), {.threads = 1});
  ASSERT_EQ(client.scene().revision, engine.scene_revision());

  // Configurations of three bodies, with enough rows for the reply to exceed the first segment.
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::vector<std::uint32_t> bodies{3, 50, 77};
  std::vector<Pose7> poses;
  for (int i = 0; i < 40 * 3; ++i)
    poses.push_back({20 * normal(random), 20 * normal(random), 20 * normal(random), normal(random), normal(random),
                     normal(random), normal(random)});
  Query query;
  query.bodies = bodies;
  query.configurations = poses;
  query.fields = kDefaultFields | kFieldFlags | kFieldPoints | kFieldNormal | kFieldPair;
  QueryView view;
  view.bodies = bodies;
  view.configurations = {reinterpret_cast<const Pose*>(poses.data()), poses.size()};
  view.configuration_count = 40;
  view.fields = query.fields;

  const test::Answer own = test::evaluate(engine, view);
  ASSERT_GT(own.memory.size(), std::size_t{1} << 20) << "the reply should not fit a client's first segment";
  for (int round = 0; round < 2; ++round) {
    const Result reply = client.distances(query);
    ASSERT_EQ(reply.rows(), own.size.rows);
    EXPECT_TRUE(same_bits(reply.distance(), own.view.distance));
    EXPECT_TRUE(same_bits(reply.lower(), own.view.lower));
    EXPECT_TRUE(same_bits(reply.upper(), own.view.upper));
    EXPECT_TRUE(same_bits(reply.status(), own.view.status));
    EXPECT_TRUE(same_bits(reply.flags(), own.view.flags));
    EXPECT_TRUE(same_bits(reply.point_a(), own.view.point_a));
    EXPECT_TRUE(same_bits(reply.point_b(), own.view.point_b));
    EXPECT_TRUE(same_bits(reply.normal(), own.view.normal));
    EXPECT_TRUE(same_bits(reply.pair(), own.view.pair));
    std::set<Status> statuses(reply.status().begin(), reply.status().end());
    EXPECT_TRUE(statuses.contains(Status::kOk));
  }

  // Reductions, which reserve more memory than they return.
  for (const Reduce reduce : {Reduce::kWithin, Reduce::kNearest, Reduce::kMin}) {
    query.reduce = view.reduce = reduce;
    query.max_distance = view.max_distance = 3;
    const test::Answer reduced = test::evaluate(engine, view);
    const Result reply = client.distances(query);
    ASSERT_GT(reply.rows(), 0u);
    ASSERT_LE(reply.rows(), reduced.size.rows);
    EXPECT_TRUE(same_bits(reply.distance(), reduced.view.distance));
    EXPECT_TRUE(same_bits(reply.pair(), reduced.view.pair));
  }
}

TEST_F(ShmDaemon, PreparedCallsOfEachKindAnswerAsTheCalls) {
  Daemon daemon({"--scene", source_file("scenes/cell/robot.yaml"), "--shm", path_, "--threads", "1"});
  Client client = patient(daemon.url());
  test::expect_prepared_calls_answer_as_calls(client, client.joints("arm"));
  test::expect_prepared_paths_answer_as_calls(client, client.joints("arm"));
}

TEST_F(ShmDaemon, PreparedQueriesAnswerAsDistancesDoUntilTheirIdsChange) {
  Daemon daemon(options());
  Client client = patient(daemon.url()), other = patient(daemon.url());
  const std::vector<std::uint32_t> moved{client.body(client.scene().bodies[3].name)};
  Prepared prepared = client.prepare({.bodies = moved});
  const std::vector<Pose7> poses{{1, 2, 3, 1, 0, 0, 0}, {0.5, 0, 0, 1, 0, 0, 0}};
  const Result expected = client.distances({.bodies = moved, .configurations = poses});
  ASSERT_GT(expected.rows(), 0u);
  EXPECT_TRUE(same_bits(prepared.run(poses).lower(), expected.lower().data()));
  int called = 0;
  Pending pending = prepared.submit({.configurations = poses}, [&called] { ++called; });
  EXPECT_TRUE(same_bits(pending.get().lower(), expected.lower().data()));
  EXPECT_EQ(called, 1);

  try {
    client.prepare(as_check({.bodies = moved, .margin = -1}));
    ADD_FAILURE() << "a margin is at least 0";
  } catch (const RequestError& error) {
    EXPECT_EQ(error.code, static_cast<std::uint16_t>(wire::ErrorCode::kBadQuery));
    EXPECT_STREQ(error.what(), "query: margin must be a finite number of metres >= 0, got -1");
  }
  client.prepare(as_check({.bodies = moved, .margin = 0.1}));

  other.add_body({.name = "last", .sphere = 0.1, .pose = Pose7{9, 9, 9, 1, 0, 0, 0}});
  const std::vector<IdPair> of_last{{0, other.body("last")}};
  Prepared with_last = other.prepare({.pairs = of_last});
  EXPECT_EQ(with_last.run().rows(), 1u);
  EXPECT_GT(prepared.run(poses).rows(), expected.rows());  // another client's body; the ids of this one stay
  EXPECT_FALSE(prepared.is_stale());
  other.remove_body("last");
  try {
    with_last.run();
    ADD_FAILURE() << "a removed body has no distances";
  } catch (const StaleQuery& error) {
    EXPECT_NE(std::string(error.what()).find("the body \"last\" is no longer in the scene"), std::string::npos)
        << error.what();
  }
  EXPECT_TRUE(with_last.is_stale());
}

TEST_F(ShmDaemon, RepliesStayReadableWhileMoreAreRequested) {
  Daemon daemon(options());
  Client client = patient(daemon.url() + "?spin_us=0");
  const std::vector<IdPair> all = client.pairs();
  ASSERT_EQ(all.size(), 4950u);
  std::vector<Result> held;
  std::vector<std::vector<double>> expected;
  std::mt19937_64 random(9);
  for (int i = 0; i < 12; ++i) {
    std::vector<IdPair> some;
    for (int k = 0; k < 50; ++k) some.push_back(all[random() % all.size()]);
    Query query;
    query.pairs = some;
    held.push_back(client.distances(query));
    expected.emplace_back(held.back().distance().begin(), held.back().distance().end());
  }
  std::vector<Pending> pending;
  Query one;
  one.pairs = std::span(all).first(1);
  for (int i = 0; i < 4; ++i) pending.push_back(client.submit(one));  // the last four slots
  EXPECT_THROW(client.distances(one), ConnectionError);
  for (Pending& p : pending) EXPECT_EQ(p.get().rows(), 1u);
  pending.clear();
  EXPECT_EQ(client.distances(one).rows(), 1u);
  for (std::size_t i = 0; i < held.size(); ++i)
    EXPECT_TRUE(
        std::equal(expected[i].begin(), expected[i].end(), held[i].distance().begin(), held[i].distance().end()));
}

TEST_F(ShmDaemon, ADaemonThatIsKilledIsNoticedAndItsSuccessorTakesThePath) {
  auto daemon = std::make_unique<Daemon>(options());
  Client client = patient(daemon->url());
  Query query;
  query.max_distance = 5;
  const Result before = client.distances(query);
  const std::vector<double> distances(before.distance().begin(), before.distance().end());
  ASSERT_EQ(::kill(daemon->pid(), SIGSTOP), 0);  // so that the request is certainly in progress when the daemon dies
  Pending pending = client.submit(query);
  EXPECT_FALSE(pending.ready());
  EXPECT_EQ(daemon->stop(SIGKILL), -SIGKILL);
  try {
    pending.get();
    ADD_FAILURE() << "a dead daemon answered";
  } catch (const TimeoutError& error) {
    ADD_FAILURE() << "its death was not noticed: " << error.what();
  } catch (const ConnectionError& error) {
    EXPECT_NE(std::string(error.what()).find("the daemon is gone"), std::string::npos) << error.what();
  }
  EXPECT_THROW(client.distances(query), ConnectionError);
  EXPECT_TRUE(std::filesystem::exists(path_)) << "a killed daemon cannot clean up";

  daemon = std::make_unique<Daemon>(options());
  EXPECT_THROW(client.distances(query), NewEpoch);
  client.acknowledge_epoch();
  const Result again = client.distances(query);
  ASSERT_EQ(again.rows(), distances.size()) << "the client connects anew by itself";
  EXPECT_TRUE(std::equal(distances.begin(), distances.end(), again.distance().begin()));
  EXPECT_THROW(pending.get(), std::logic_error);
  Client fresh = patient(daemon->url());
  const Result after = fresh.distances(query);
  ASSERT_EQ(after.rows(), distances.size());
  EXPECT_TRUE(std::equal(distances.begin(), distances.end(), after.distance().begin()));
  EXPECT_TRUE(std::equal(distances.begin(), distances.end(), before.distance().begin()))
      << "what had arrived is still there";

  const Finished second = run({program("clearanced"), "--scene", kScene, "--shm", path_});
  EXPECT_EQ(second.code, 4);
  EXPECT_NE(second.err.find("shm://" + path_ + ": another process listens there"), std::string::npos) << second.err;
  EXPECT_EQ(fresh.distances(query).rows(), distances.size());
  EXPECT_EQ(daemon->stop(SIGTERM), 0);
  EXPECT_FALSE(std::filesystem::exists(path_));
}

std::size_t descriptors_of(int pid) {
  const std::filesystem::directory_iterator all("/proc/" + std::to_string(pid) + "/fd");
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}
std::size_t segments_of(int pid) {
  std::ifstream maps("/proc/" + std::to_string(pid) + "/maps");
  std::size_t count = 0;
  for (std::string line; std::getline(maps, line);) count += line.find("clearance-shm") != std::string::npos;
  return count;
}

TEST_F(ShmDaemon, ClientsKilledMidQueryLeaveNothingInTheDaemon) {
  Daemon daemon(options());
  Client client = patient(daemon.url());
  const auto counter = [&](const std::string& wanted) {
    for (const auto& [name, value] : client.stats())
      if (name == wanted) return value;
    return std::uint64_t{0};
  };
  const auto clients_now = [&] { return counter("shm.clients"); };
  while (clients_now() != 1) {
  }
  const std::size_t descriptors = descriptors_of(daemon.pid()), segments = segments_of(daemon.pid());
  EXPECT_EQ(segments, 1u);
  const auto deadline = soon();
  // Until some query was in progress when its client died, however late the kills come.
  for (int round = 0; round < 20 || counter("requests.dropped") == 0; ++round) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    const pid_t parent = ::getpid(), child = ::fork();
    if (child == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (::getppid() != parent) ::_exit(1);
      try {
        Client victim = patient(daemon.url());
        Query large;  // some tenths of a second of work
        large.fields = kDefaultFields | kFieldPoints;
        large.rel_tol = 1e-12;
        for (bool first = true;; first = false) {
          std::vector<Pending> pending;
          for (int i = 0; i < 4; ++i) pending.push_back(victim.submit(large));
          if (first && ::write(ends[1], "x", 1) != 1) ::_exit(1);
          for (Pending& p : pending) p.get();
        }
      } catch (...) {
      }
      ::_exit(1);
    }
    char byte;
    ASSERT_EQ(::read(ends[0], &byte, 1), 1);
    ASSERT_EQ(::kill(child, SIGKILL), 0);
    int status;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_TRUE(WIFSIGNALED(status));
    ::close(ends[0]);
    ::close(ends[1]);
    EXPECT_EQ(client.distances({.max_distance = 1, .reduce = Reduce::kMin}).rows(), 1u);
  }
  while ((descriptors_of(daemon.pid()) != descriptors || segments_of(daemon.pid()) != segments) &&
         std::chrono::steady_clock::now() < deadline)
    clients_now();
  EXPECT_EQ(descriptors_of(daemon.pid()), descriptors);
  EXPECT_EQ(segments_of(daemon.pid()), segments);
  EXPECT_EQ(clients_now(), 1u);
}

// Malformed frames in valid slots: an error reply each, and the connection continues.
TEST_F(ShmDaemon, GarbledFramesAreAnsweredWithErrors) {
  Daemon daemon(options());
  auto channel = open_shm_channel(path_, soon());
  std::mt19937_64 random(21);
  std::set<std::uint16_t> codes;
  for (std::uint64_t id = 1; id <= 300; ++id) {
    wire::FrameHeader header;
    header.request_id = id;
    header.type = static_cast<std::uint16_t>(wire::FrameType::kQuery);
    const std::size_t payload = random() % 400;
    header.payload_bytes = payload;
    std::byte* room = channel->begin(sizeof header + payload, 0);
    for (std::size_t i = 0; i < payload; ++i) room[sizeof header + i] = static_cast<std::byte>(random());
    switch (id % 4) {
      case 0:
        header.version = static_cast<std::uint16_t>(2 + random() % 1000);
        break;
      case 1:
        header.type = static_cast<std::uint16_t>(random());
        break;
      case 2:
        header.magic = static_cast<std::uint32_t>(random());
        break;
      default:
        break;
    }
    std::memcpy(room, &header, sizeof header);
    channel->send();
    const auto frame = channel->receive(id, soon());
    ASSERT_TRUE(frame);
    ASSERT_EQ(frame->header().type, static_cast<std::uint16_t>(wire::FrameType::kError)) << id;
    wire::ErrorHeader error;
    ASSERT_GE(frame->payload().size(), sizeof error);
    std::memcpy(&error, frame->payload().data(), sizeof error);
    EXPECT_GT(error.text_bytes, 0u);
    codes.insert(error.code);
  }
  for (const auto code : {wire::ErrorCode::kBadFrame, wire::ErrorCode::kWrongVersion, wire::ErrorCode::kUnknownType})
    EXPECT_TRUE(codes.contains(static_cast<std::uint16_t>(code))) << static_cast<int>(code);
  Client client = patient(daemon.url());
  EXPECT_EQ(client.distances({.max_distance = 1, .reduce = Reduce::kMin}).rows(), 1u);
}

}  // namespace
}  // namespace clearance
