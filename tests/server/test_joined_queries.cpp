// Small queries that wait at once are answered as one batch: each as it would be alone, and none spoils another.
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "failing_new.h"
#include "loop_fixture.h"
#include "server/fair_queue.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

TEST(FairQueue, HandsOutWhatIsWantedClientByClient) {
  FairQueue<int> queue;
  for (const int i : {10, 11, 12}) queue.push(1, i);
  for (const int i : {25, 21}) queue.push(2, i);  // its first is not wanted, and keeps its second back
  for (const int i : {30, 35, 31}) queue.push(3, i);
  std::vector<int> taken, kept;
  queue.take_each([&](int& item) {
    if (item % 10 == 5) return false;
    taken.push_back(item);
    return true;
  });
  EXPECT_EQ(taken, (std::vector<int>{10, 30, 11, 12}));
  EXPECT_EQ(queue.size(), 4u);
  queue.push(1, 13);
  while (!queue.empty()) kept.push_back(queue.pop());
  EXPECT_EQ(kept, (std::vector<int>{25, 35, 13, 21, 31}));
}

TEST(FairQueue, AClientThatGaveGoesBehindTheOthers) {
  FairQueue<int> queue;
  for (const int i : {10, 11}) queue.push(1, i);
  queue.push(2, 25);
  int left = 1;
  queue.take_each([&](int& item) { return item < 20 && left-- > 0; });
  EXPECT_EQ(queue.pop(), 25);
  EXPECT_EQ(queue.pop(), 11);
}

class JoinedQueries : public LoopTest {
 protected:
  static constexpr int kBodies = 30;
  static constexpr std::size_t kClients = 48;

  /// Of a few kinds, so that many ask the same of their pairs and some do not; every eleventh is refused.
  static TestQuery query_of(std::size_t client, std::mt19937& random) {
    TestQuery q;
    q.header.all_pairs = 0;
    q.header.fields = kDefaultFields | kFieldFlags;
    for (auto count = 1 + random() % 6; count > 0; --count) {
      const auto a = static_cast<std::uint32_t>(random() % kBodies);
      q.pairs.push_back({a, static_cast<std::uint32_t>((a + 1 + random() % (kBodies - 1)) % kBodies)});
    }
    if (client % 4 == 1) {
      q.bodies = {static_cast<std::uint32_t>(client % kBodies)};
      q.configurations = {{1, 2, 3, 1, 0, 0, 0}, {0, 0, 0, 0, 0, 0, 0}};  // the second is no rotation
    }
    if (client % 6 == 2) q.header.precision = static_cast<std::uint8_t>(Precision::kF32);
    if (client % 6 == 3) q.header.max_distance = 8;
    if (client % 6 == 4) q.header.fields |= kFieldPoints | kFieldNormal | kFieldGradient;
    if (client % 11 == 7) q.header.abs_tol = -1;
    return q;
  }
  void send_all(std::vector<MemoryClient>& clients) {
    std::mt19937 random(5);
    for (std::size_t i = 0; i < clients.size(); ++i) transport_->send(clients[i], query_of(i, random).frame(i + 1));
  }
  /// What must not depend on company: all but the times.
  static void expect_same(const MemoryFrame& got, const MemoryFrame& wanted) {
    ASSERT_EQ(got.type(), wanted.type());
    EXPECT_EQ(got.header().request_id, wanted.header().request_id);
    ASSERT_EQ(got.payload().size(), wanted.payload().size());
    const std::size_t skipped = got.type() == FrameType::kReply ? sizeof(wire::ReplyHeader) : 0;
    EXPECT_EQ(
        std::memcmp(got.payload().data() + skipped, wanted.payload().data() + skipped, got.payload().size() - skipped),
        0);
    if (!skipped) return;
    const wire::ReplyHeader g = wire::parse_reply(got.payload()), w = wire::parse_reply(wanted.payload());
    EXPECT_EQ(g.rows, w.rows);
    EXPECT_EQ(g.total, w.total);
    EXPECT_EQ(g.configurations, w.configurations);
    EXPECT_EQ(g.pairs, w.pairs);
    EXPECT_EQ(g.pairs_evaluated, w.pairs_evaluated);
    EXPECT_EQ(g.snapshot_revision, w.snapshot_revision);
  }
};

TEST_F(JoinedQueries, EachGetsTheAnswerThatItGetsAlone) {
  Loop::Options options;
  options.batch_pairs = 0;
  start(scattered_scene(kBodies), options);
  std::vector<MemoryClient> alone(kClients), together(kClients);
  send_all(alone);
  turn_until_idle();
  EXPECT_EQ(loop_->counter("queries.joined"), 0u);

  start(scattered_scene(kBodies));
  together[5].alive = false;
  together[6].room = 100;
  send_all(together);
  turn_until_idle();
  EXPECT_GT(loop_->counter("queries.joined"), kClients / 2);
  EXPECT_EQ(loop_->counter("queries.answered"), loop_->counter("replies"));
  std::map<FrameType, int> types;
  for (std::size_t i = 0; i < kClients; ++i) {
    ASSERT_EQ(alone[i].replies.size(), 1u);
    EXPECT_EQ(together[i].sinks, 0);
    ASSERT_EQ(together[i].replies.size(), i == 5 || i == 6 ? 0u : 1u) << i;
    if (together[i].replies.empty()) continue;
    ++types[together[i].replies[0]->type()];
    expect_same(*together[i].replies[0], *alone[i].replies[0]);
    if (HasFatalFailure()) FAIL() << "client " << i;
  }
  EXPECT_GE(types[FrameType::kError], 4);
  EXPECT_GE(types[FrameType::kReply], 40);
}

TEST_F(JoinedQueries, ABatchHasSoManyPairsAndTheOthersTheirTurn) {
  Loop::Options options;
  options.slice = 1ns;
  options.batch_pairs = 10;
  start(scattered_scene(kBodies), options);
  TestQuery four, other;
  four.pairs = {{0, 1}, {2, 3}, {4, 5}, {6, 7}};
  other = four;
  other.header.precision = static_cast<std::uint8_t>(Precision::kF32);
  for (std::uint64_t i = 1; i <= 5; ++i) transport_->send(a_, four.frame(i));
  transport_->send(b_, other.frame(1));
  transport_->send(c_, four.frame(1));
  loop_->turn();  // a's first and c's: eight pairs
  EXPECT_EQ(a_.replies.size(), 1u);
  EXPECT_EQ(c_.replies.size(), 1u);
  EXPECT_EQ(b_.replies.size(), 0u);
  loop_->turn();
  EXPECT_EQ(b_.replies.size(), 1u) << "who does not join is not passed over";
  loop_->turn();
  EXPECT_EQ(a_.replies.size(), 3u);
  turn_until_idle();
  EXPECT_EQ(a_.replies.size(), 5u);
  EXPECT_EQ(loop_->counter("queries.joined"), 6u);
}

/// Comes after the transport with the requests: when memory runs out is told from there.
class LastTransport final : public Transport {
 public:
  std::string url() const override { return "last://"; }
  std::vector<int> descriptors() const override { return {}; }
  int poll(Inbox&) override {
    allocations_left = failing;
    return 0;
  }
  int failing = -1;
};

TEST_F(JoinedQueries, ABatchThatRunsOutOfMemoryIsAnsweredOneByOne) {
  const auto send = [this](std::vector<MemoryClient>& clients) {
    std::mt19937 random(6);
    for (std::size_t i = 0; i < clients.size(); ++i) transport_->send(clients[i], query_of(0, random).frame(i + 1));
  };
  std::vector<MemoryClient> wanted(8);
  start(scattered_scene(kBodies));
  send(wanted);
  loop_->turn();
  ASSERT_EQ(loop_->counter("queries.joined"), wanted.size());

  auto last = std::make_unique<LastTransport>();
  LastTransport& memory = *last;
  loop_->add(std::move(last));
  int one_by_one = 0;
  for (memory.failing = 0; one_by_one < 1000; ++memory.failing) {
    const std::uint64_t joined = loop_->counter("queries.joined");
    std::vector<MemoryClient> clients(wanted.size());
    send(clients);
    loop_->turn();
    allocations_left = -1;
    if (loop_->counter("queries.joined") > joined) break;  // it ran out after the batch
    ++one_by_one;
    for (std::size_t i = 0; i < clients.size(); ++i) {
      ASSERT_EQ(clients[i].replies.size(), 1u) << "client " << i << ", allocation " << memory.failing;
      expect_same(*clients[i].replies[0], *wanted[i].replies[0]);
    }
  }
  EXPECT_GT(one_by_one, 3);
  EXPECT_LT(one_by_one, 1000);
}

}  // namespace
}  // namespace clearance
