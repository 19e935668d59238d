// clearanced over ZeroMQ, with the client library: answers, many clients, clients that disconnect or do not read.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <set>
#include <thread>
#include <zmq.hpp>

#include "client/client.h"
#include "tests/patience.h"
#include "tests/server/bad_requests.h"
#include "tests/server/core/memory_transport.h"
#include "tests/server/daemon_fixture.h"

namespace clearance {
namespace {

using namespace std::chrono_literals;

std::string scattered_yaml(int count) {
  return "random: {count: " + std::to_string(count) +
         ", shape: {uv_sphere: {radius: 2, resolution: 5}}, box: 60, seed: 1}\n";
}

std::uint64_t counter(Client& client, const std::string& wanted) {
  for (const auto& [name, value] : client.stats())
    if (name == wanted) return value;
  return 0;
}

/// Repeats a request until the counter has the value.
void wait_for_counter(Client& client, const std::string& name, std::uint64_t value) {
  while (counter(client, name) < value) std::this_thread::sleep_for(1ms);
}

class ZmqTest : public testing::Test {
 protected:
  TestFolder folder_;
  Daemon daemon_{{"--scene", folder_.write("scene.yaml", scattered_yaml(100)), "--zmq", "ipc://" + (folder_ / "c.ipc"),
                  "--zmq", "tcp://127.0.0.1:*", "--threads", "1"}};
};

bool same_bits(std::span<const double> a, std::span<const double> b) {
  return a.size() == b.size() &&
         std::equal(a.begin(), a.end(), b.begin(), [](double x, double y) { return std::memcmp(&x, &y, 8) == 0; });
}

TEST_F(ZmqTest, BothEndpointsGiveTheSameBits) {
  Client ipc = patient(daemon_.urls()[0]), tcp = patient(daemon_.urls()[1]);
  Query query;
  query.fields = kDefaultFields | kFieldPoints | kFieldNormal | kFieldPair;
  const Result a = ipc.distances(query), b = tcp.distances(query);
  ASSERT_EQ(a.rows(), 100u * 99 / 2);  // 500 KB: passed to ZeroMQ without a copy
  EXPECT_TRUE(same_bits(a.lower(), b.lower()));
  EXPECT_TRUE(same_bits(a.upper(), b.upper()));
  EXPECT_TRUE(same_bits(a.point_a(), b.point_a()));
  EXPECT_TRUE(same_bits(a.normal(), b.normal()));
  for (std::size_t i = 0; i < a.rows(); ++i) ASSERT_LE(a.lower()[i], a.upper()[i]);
  EXPECT_EQ(a.snapshot_revision(), b.snapshot_revision());
  const auto pairs = ipc.pairs();
  ASSERT_EQ(pairs.size(), a.rows());
  EXPECT_EQ(pairs[777], a.pair()[777]);
}

TEST_F(ZmqTest, ConfigurationsAndPosesAgree) {
  Client client = patient(daemon_.url());
  const std::uint32_t body = 3;
  const Pose7 elsewhere{1, 2, 3, 0.5, 0.5, 0.5, 0.5};
  Query query;
  query.fields |= kFieldPair;
  query.bodies = std::span(&body, 1);
  query.configurations = std::span(&elsewhere, 1);
  const Result requested = client.distances(query);
  ASSERT_EQ(requested.rows(), 99u);
  const std::pair<std::uint32_t, Pose7> update{body, elsewhere};
  EXPECT_EQ(client.set_poses(std::span(&update, 1)).applied, 1u);
  const std::vector<IdPair> pairs(requested.pair().begin(), requested.pair().end());
  Query moved;
  moved.pairs = pairs;
  const Result now = client.distances(moved);
  EXPECT_TRUE(same_bits(requested.lower(), now.lower()));
  EXPECT_TRUE(same_bits(requested.upper(), now.upper()));
  EXPECT_EQ(now.snapshot_revision(), requested.snapshot_revision() + 1);
}

TEST_F(ZmqTest, ManyClientsAtOnceGetTheirOwnAnswers) {
  constexpr int kClients = 6, kRounds = 40;
  std::atomic<int> good{0};
  std::vector<std::thread> threads;
  for (int c = 0; c < kClients; ++c)
    threads.emplace_back([&, c] {
      Client client = patient(daemon_.urls()[static_cast<std::size_t>(c % 2)]);
      for (int i = 0; i < kRounds; ++i) {
        const IdPair pair{static_cast<std::uint32_t>(c), static_cast<std::uint32_t>(10 + i)};
        Query query;
        query.pairs = std::span(&pair, 1);
        query.fields |= kFieldPair;
        const Result reply = client.distances(query);
        good += reply.rows() == 1 && reply.pair()[0] == pair;
      }
    });
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(good, kClients * kRounds);
}

TEST_F(ZmqTest, ManyQueriesOfOneClientAreAnsweredOrRejectedAsBusy) {
  Client client = patient(daemon_.url());
  std::vector<Pending> pending;
  for (int i = 0; i < 200; ++i) pending.push_back(client.submit());
  int answered = 0, busy = 0;
  for (Pending& p : pending) {
    try {
      answered += p.get().rows() == 4950;
    } catch (const RequestError& error) {
      busy += std::string(error.what()).find("of this client are under way already; retry later") != std::string::npos;
    }
  }
  EXPECT_EQ(answered + busy, 200);
  EXPECT_GE(answered, 64);
}

TEST_F(ZmqTest, AClientThatDiesMidQueryCostsNothing) {
  Client witness = patient(daemon_.url());
  const std::uint64_t answered = counter(witness, "queries.answered");
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Client doomed = patient(daemon_.url());
    for (int i = 0; i < 5; ++i) (void)doomed.submit();
    doomed.ping();  // all five have arrived
    kill(getpid(), SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_EQ(witness.distances().rows(), 4950u);
  wait_for_counter(witness, "queries", 6);
  while (counter(witness, "queries.waiting")) std::this_thread::sleep_for(1ms);
  EXPECT_EQ(witness.distances().rows(), 4950u);
  EXPECT_GE(counter(witness, "queries.answered") + counter(witness, "queries.dropped"), answered + 7);
}

/// A client that does not read: its own library accepts one reply, the others stay in the daemon's.
zmq::socket_t lazy_client(zmq::context_t& context, const std::string& url) {
  zmq::socket_t lazy(context, zmq::socket_type::dealer);
  lazy.set(zmq::sockopt::linger, 0);
  lazy.set(zmq::sockopt::rcvhwm, 1);
  lazy.connect(url);
  return lazy;
}

TEST_F(ZmqTest, RepliesToAClientThatReadsLateAreKept) {
  constexpr std::uint64_t kRequested = 1000;
  zmq::context_t context;
  zmq::socket_t lazy = lazy_client(context, daemon_.url());
  Client witness = patient(daemon_.url());
  const std::vector<std::byte> payload(4096);  // more in total than the sockets hold
  for (std::uint64_t id = 1; id <= kRequested; ++id) {
    const auto header = wire::make_header(wire::FrameType::kPing, id, payload.size());
    lazy.send(zmq::buffer(&header, sizeof header), zmq::send_flags::sndmore);
    lazy.send(zmq::buffer(payload), zmq::send_flags::none);
  }
  for (std::uint64_t own = 1; counter(witness, "ipc.frames") < own + kRequested; ++own)
    std::this_thread::sleep_for(1ms);
  EXPECT_EQ(counter(witness, "zmq.replies_dropped"), 0u);
  lazy.set(zmq::sockopt::rcvtimeo, 60'000);
  for (std::uint64_t id = 1; id <= kRequested; ++id) {
    zmq::message_t head, body;
    ASSERT_TRUE(lazy.recv(head)) << id;
    ASSERT_TRUE(lazy.recv(body)) << id;
    wire::FrameHeader header;
    ASSERT_EQ(head.size(), sizeof header);
    std::memcpy(&header, head.data(), sizeof header);
    ASSERT_EQ(header.request_id, id);
    ASSERT_EQ(body.size(), payload.size() + wire::kEpochRecordBytes);
  }
}

TEST_F(ZmqTest, AClientStopsBeforeTheDaemonHasToDropReplies) {
  Client client = patient(daemon_.url());
  ASSERT_EQ(kill(daemon_.pid(), SIGSTOP), 0);
  std::vector<Pending> pending;
  std::string why;
  try {
    while (pending.size() < 5000) pending.push_back(client.submit());
  } catch (const ConnectionError& error) {
    why = error.what();
  }
  ASSERT_EQ(kill(daemon_.pid(), SIGCONT), 0);
  EXPECT_EQ(why, daemon_.url() + ": the daemon takes no more requests: its queue is full");
  EXPECT_LE(pending.size(), 1000u);
  for (Pending& p : pending) {  // each of them is answered or rejected
    try {
      p.get();
    } catch (const RequestError&) {
    }
  }
}

TEST_F(ZmqTest, RepliesToAClientThatDoesNotReadAreDroppedAndCounted) {
  zmq::context_t context;
  zmq::socket_t lazy = lazy_client(context, daemon_.url());
  Client witness = patient(daemon_.url());
  // Echoes of 1 MiB that the client does not read: the daemon keeps a bounded number, and continues.
  const std::vector<std::byte> payload(1 << 20);
  const auto header = wire::make_header(wire::FrameType::kPing, 1, payload.size());
  for (std::uint64_t sent = 0; counter(witness, "zmq.replies_dropped") == 0; ++sent) {
    ASSERT_LT(sent, 2000u) << "nothing is ever dropped";
    lazy.send(zmq::buffer(&header, sizeof header), zmq::send_flags::sndmore);
    lazy.send(zmq::buffer(payload), zmq::send_flags::none);
  }
  EXPECT_EQ(witness.distances().rows(), 4950u);
}

TEST_F(ZmqTest, RepliesThatAClientDoesNotReadAreCountedAmongItsOwn) {
  const Daemon daemon({"--scene", folder_.write("two.yaml", scattered_yaml(100)), "--zmq",
                       "ipc://" + (folder_ / "d.ipc"), "--threads", "1", "--limit", "max-client-mib=4"});
  zmq::context_t context;
  zmq::socket_t lazy = lazy_client(context, daemon.url());
  Client witness = patient(daemon.url());
  TestQuery query;
  query.header.fields = kDefaultFields | kFieldPoints | kFieldNormal;  // 4950 rows, 480 KB
  for (std::uint64_t sent = 1; counter(witness, "errors.busy") == 0; ++sent) {
    ASSERT_LT(sent, 2000u) << "never too many";
    const std::vector<std::byte> frame = query.frame(sent);
    lazy.send(zmq::buffer(frame.data(), sizeof(wire::FrameHeader)), zmq::send_flags::sndmore);
    lazy.send(zmq::buffer(frame.data() + sizeof(wire::FrameHeader), frame.size() - sizeof(wire::FrameHeader)),
              zmq::send_flags::none);
    while (counter(witness, "queries") < sent || counter(witness, "queries.waiting")) std::this_thread::sleep_for(1ms);
  }
  EXPECT_EQ(counter(witness, "zmq.replies_dropped"), 0u) << "long before that";
  EXPECT_EQ(witness.distances().rows(), 4950u);
}

TEST_F(ZmqTest, TheDaemonsEndIsNoticed) {
  Client client = patient(daemon_.url());
  client.scene();
  daemon_.stop(SIGKILL);
  try {
    client.distances();
    FAIL();
  } catch (const ConnectionError& error) {
    EXPECT_EQ(std::string(error.what()), daemon_.url() + ": the daemon has gone");
  }
}

}  // namespace
}  // namespace clearance
