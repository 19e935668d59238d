// Limits of one client: each rejection names the limit, and the next request is answered.
#include <gtest/gtest.h>

#include <thread>

#include "client/client.h"
#include "server/limits/places.h"
#include "tests/patience.h"
#include "tests/server/core/loop_fixture.h"
#include "tests/server/daemon_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;

class Quotas : public LoopTest {
 protected:
  /// Sends without serving; turn_until_idle() collects the replies.
  void send(MemoryClient& client, const TestQuery& query, std::uint64_t id) {
    transport_->send(client, query.frame(id));
  }
};

TEST_F(Quotas, PairsOfOneQuery) {
  Loop::Options options;
  options.max_pairs = 120;
  start(small_scene(), options);
  TestQuery query;  // six pairs
  query.bodies = {1};
  const auto evaluate_for = [&](int configurations) {
    query.pairs = {{0, 1}, {1, 2}, {0, 2}, {2, 3}, {1, 3}, {0, 3}};
    query.configurations.assign(static_cast<std::size_t>(configurations), {0, 0, 1, 1, 0, 0, 0});
    return evaluate(a_, query.frame(1));
  };
  EXPECT_EQ(evaluate_for(20)->type(), wire::FrameType::kReply);
  const auto error = error_of(evaluate_for(21));
  EXPECT_EQ(static_cast<ErrorCode>(error.header.code), ErrorCode::kTooLarge);
  EXPECT_EQ(error.text,
            "21 configurations of 6 pairs are more than the 120 that one query may have (limit max-pairs): split it");
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);  // few rows, but as many pairs
  EXPECT_EQ(evaluate_for(21)->type(), wire::FrameType::kError);
  EXPECT_EQ(evaluate_for(20)->type(), wire::FrameType::kReply);
}

TEST_F(Quotas, BytesOfOneClientsReplies) {
  Loop::Options options = short_slices();
  options.max_client_bytes = 100'000;
  start(scattered_scene(20), options);
  const TestQuery large = large_query(20);  // 40 times 190 rows of 25 bytes: more than the limit by itself
  send(a_, large, 1);
  turn_until_it_runs();
  ASSERT_EQ(loop_->waiting(), 1u) << "one may always be under way";
  send(a_, small_query(), 2);
  loop_->turn();
  const auto error = error_of(take(a_));
  EXPECT_EQ(static_cast<ErrorCode>(error.header.code), ErrorCode::kBusy);
  EXPECT_NE(error.text.find("the requests and replies of this client under way take "), std::string::npos)
      << error.text;
  EXPECT_NE(error.text.find("(limit max-client-mib)"), std::string::npos) << error.text;
  send(b_, small_query(), 3);
  turn_until_idle();
  EXPECT_EQ(take(b_)->type(), wire::FrameType::kReply) << "others are not touched";
  EXPECT_EQ(take(a_)->type(), wire::FrameType::kReply);
  EXPECT_EQ(evaluate(a_, small_query()).rows(), 1u) << "what has been answered is not counted any more";
}

TEST_F(Quotas, BytesOfOneClientsRequests) {
  Loop::Options options = short_slices();
  options.max_client_bytes = 100'000;
  start(scattered_scene(20), options);
  TestQuery query = large_query(20);                              // 800 poses of 56 bytes
  query.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);  // and 40 rows
  for (const std::uint64_t id : {1, 2, 3}) send(a_, query, id);
  loop_->turn();
  const auto error = error_of(take(a_));
  EXPECT_EQ(static_cast<ErrorCode>(error.header.code), ErrorCode::kBusy);
  EXPECT_NE(error.text.find("(limit max-client-mib)"), std::string::npos) << error.text;
  turn_until_idle();
  EXPECT_EQ(a_.replies.size(), 2u);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(take(a_)->type(), wire::FrameType::kReply);

  // Groups that name far more pairs than they have bytes.
  TestQuery named;
  named.pairs.assign(30, {kEveryBody, kEveryBody});
  named.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  for (const std::uint64_t id : {4, 5, 6}) send(a_, named, id);
  loop_->turn();
  EXPECT_EQ(static_cast<ErrorCode>(error_of(take(a_)).header.code), ErrorCode::kBusy);
  turn_until_idle();
  EXPECT_EQ(a_.replies.size(), 2u);
}

TEST_F(Quotas, OfAClientThatGoesAreGivenBack) {
  Loop::Options options = short_slices();
  options.max_client_bytes = 100'000;
  options.tick = std::chrono::nanoseconds(0);
  start(scattered_scene(20), options);
  send(a_, large_query(20), 1);
  loop_->turn();
  a_.alive = false;
  turn_until_idle();
  EXPECT_EQ(loop_->waiting(), 0u);
  a_.alive = true;
  send(a_, large_query(20), 2);
  turn_until_idle();
  EXPECT_EQ(take(a_)->type(), wire::FrameType::kReply);
}

/// Options of a daemon that accepts two clients on each endpoint.
std::vector<std::string> for_two(const TestFolder& folder) {
  const std::string scene = folder.write(
      "scene.yaml", "random: {count: 400, shape: {uv_sphere: {radius: 2, resolution: 5}}, box: 60, seed: 1}\n");
  return {"--scene",       scene,       "--shm", folder / "c.sock", "--zmq", "ipc://" + (folder / "c.ipc"), "--limit",
          "max-clients=2", "--threads", "1"};
}

TEST(Places, AreKeptForTheClassControl) {
  Places places(64, 8);
  std::vector<Places::Share> taken;
  const auto user = [](unsigned number) { return ucred{static_cast<pid_t>(number), number, number}; };
  unsigned number = 1;
  while (places.why_not(user(number), "clients").empty()) taken.push_back(places.take(user(number++)));
  EXPECT_EQ(places.taken(), 56u);
  EXPECT_EQ(places.why_not(user(number), "clients"),
            "this daemon already has 56 clients; the last 8 places are for the class control");
  for (int i = 0; i < 8; ++i) {
    ASSERT_EQ(places.why_not(user(7), "clients", ServiceClass::kControl), "") << "also of a user who has many";
    taken.push_back(places.take(user(7)));
  }
  EXPECT_NE(places.why_not(user(7), "clients", ServiceClass::kControl), "") << "there are no more";
}

TEST(Places, AreKeptForThoseWhoHaveFew) {
  Places places(256);
  const ucred greedy{.pid = 1, .uid = 10, .gid = 0};
  std::vector<Places::Share> taken, others;
  while (places.why_not(greedy, "clients").empty()) taken.push_back(places.take(greedy));
  EXPECT_EQ(taken.size(), 128u);
  EXPECT_EQ(places.why_not(greedy, "clients"), "process 1 already has 128 clients; the last 128 places are for others");
  ucred another = greedy;  // of the same user: a restarted program
  for (another.pid = 2; places.why_not(another, "clients").empty(); ++another.pid)
    taken.push_back(places.take(another));
  EXPECT_EQ(taken.size(), 192u);
  EXPECT_EQ(places.why_not(another, "clients"), "user 10 already has 192 clients; the last 64 places are for others");
  const ucred other{.pid = 5000, .uid = 11, .gid = 0};
  while (places.why_not(other, "clients").empty()) others.push_back(places.take(other));
  EXPECT_EQ(others.size(), 16u) << "one program of another user";
  others.clear();
  taken.clear();
  EXPECT_EQ(places.taken(), 0u);
  for (const std::uint64_t few : {1, 2, 3}) {
    Places all(few);
    for (std::uint64_t i = 0; i < few; ++i) {
      EXPECT_EQ(all.why_not(greedy, "clients"), "");
      taken.push_back(all.take(greedy));
    }
    EXPECT_EQ(all.why_not(greedy, "clients"), "this daemon already has " + std::to_string(few) + " clients");
    taken.clear();
  }
}

TEST(MaxClients, ConnectionsThatAProgramForgetsShutOutNoOtherProgram) {
  const TestFolder folder;
  Daemon daemon({"--scene", folder.write("scene.yaml", kSmallSceneYaml), "--shm", folder / "c.sock", "--limit",
                 "max-clients=16"});
  std::vector<Client> idle;
  std::string why;
  while (why.empty()) try {
      idle.push_back(connect(daemon.url()));
    } catch (const ConnectionError& error) {
      why = error.what();
    }
  EXPECT_EQ(idle.size(), 8u);
  EXPECT_NE(why.find("already has 8 shared-memory clients; the last 8 places are for others (limit max-clients)"),
            std::string::npos)
      << why;
  const Finished controller = run({program("clearance"), "stat", "--ping", "--connect", daemon.url()});
  EXPECT_EQ(controller.code, 0) << controller.err;
}

TEST(MaxClients, OverSharedMemory) {
  const TestFolder folder;
  Daemon daemon(for_two(folder));
  Client first = patient(daemon.urls()[0]);
  {
    Client second = patient(daemon.urls()[0]);
    try {
      patient(daemon.urls()[0]);
      FAIL();
    } catch (const ConnectionError& error) {
      EXPECT_NE(std::string(error.what()).find("already has 2 shared-memory clients (limit max-clients)"),
                std::string::npos)
          << error.what();
    }
    second.ping();
  }
  for (bool in = false; !in; std::this_thread::yield()) try {  // until the daemon notices the second's end
      patient(daemon.urls()[0]).ping();
      in = true;
    } catch (const ConnectionError&) {
    }
  first.ping();
}

TEST(MaxClients, OverZeroMq) {
  const TestFolder folder;
  Daemon daemon(for_two(folder));
  Client first = patient(daemon.urls()[1]), second = patient(daemon.urls()[1]), third = patient(daemon.urls()[1]);
  for (Client* client : {&first, &second, &third}) client->ping();  // any number may come in succession
  const std::uint32_t body = 1;
  std::string said;
  for (std::size_t configurations = 20000; said.empty(); configurations *= 2) {  // until both outlast a few echoes
    const std::vector<Pose7> poses(configurations, {0, 0, 0, 1, 0, 0, 0});
    Query large;
    large.bodies = std::span(&body, 1);
    large.configurations = poses;
    large.reduce = Reduce::kMin;
    Pending a = first.submit(large), b = second.submit(large);
    while (said.empty() && !(a.ready() && b.ready())) try {
        third.ping();
      } catch (const RequestError& error) {
        EXPECT_EQ(error.code, static_cast<std::uint16_t>(ErrorCode::kBusy));
        said = error.what();
      }
    EXPECT_EQ(a.get().rows(), configurations);
    EXPECT_EQ(b.get().rows(), configurations);
  }
  EXPECT_EQ(said, "requests of 2 ZeroMQ clients are under way already; retry later (limit max-clients)");
  third.ping();
}

}  // namespace
}  // namespace clearance
