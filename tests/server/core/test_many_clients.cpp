// 64 clients at once: none waits for another's large batch, measured by turns and counts, and every answer is the
// engine's.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <numeric>
#include <thread>

#include "client/client.h"
#include "tests/engine/engine_test_util.h"
#include "tests/patience.h"
#include "tests/server/core/loop_fixture.h"
#include "tests/temporary_folder.h"

namespace clearance {
namespace {

constexpr int kClients = 64;

class ManyClients : public LoopTest {
 protected:
  /// Keeps one small query of each client in progress, and runs one turn of the loop.
  void turn() {
    for (std::size_t i = 0; i < small_.size(); ++i)
      while (!small_[i].replies.empty()) {
        ASSERT_EQ(take(small_[i])->type(), wire::FrameType::kReply);
        ++answers_[i];
      }
    // One turn answers many. They repeat their queries in the order of real time: clients with fewer answers first.
    std::vector<std::size_t> order(small_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(),
                     [this](std::size_t a, std::size_t b) { return answers_[a] < answers_[b]; });
    for (const std::size_t i : order)
      if (small_[i].sinks == 0) transport_->send(small_[i], small_query().frame(1));
    loop_->turn();
    ++turns_;
  }
  int least() const { return *std::min_element(answers_.begin(), answers_.end()); }
  int most() const { return *std::max_element(answers_.begin(), answers_.end()); }
  /// They are served in turn, except those that send again within the turn in which they were answered: the test then
  /// changes their order.
  int most_allowed() const { return least() + 2 + least() / 10; }

  std::vector<MemoryClient> small_{kClients - 1};
  std::vector<int> answers_ = std::vector<int>(kClients - 1);
  MemoryClient large_;
  int turns_ = 0;
};

TEST_F(ManyClients, TakeTurnsWithALargeBatch) {
  // A slice of 1 ns: each turn works on one query for one slice, so that turns count slices.
  start(scattered_scene(60), short_slices());
  transport_->send(large_, large_query(60).frame(1));
  int alone = 0;
  while (large_.replies.empty()) loop_->turn(), ++alone;
  ASSERT_GT(alone, 20) << "too small a batch to tell";
  large_.replies.clear();

  constexpr int kBatches = 4;
  for (int i = 0; i < kBatches; ++i) transport_->send(large_, large_query(60).frame(static_cast<std::uint64_t>(2 + i)));
  loop_->turn();
  // A small query takes one slice here, and the large one gets one of five: 63 clients are served after 79 turns, plus
  // one for the queries already waiting at the start of the round.
  while (least() < 1) {
    turn();
    ASSERT_LE(turns_, 2 * kClients) << "a client waits longer than all the others take together";
  }
  while (large_.replies.size() < kBatches) {
    turn();
    ASSERT_LE(most(), most_allowed()) << "after " << turns_ << " turns";
    ASSERT_LE(turns_, 5 * kBatches * alone + 2 * kClients) << "the large batch has its turns too";
  }
  EXPECT_GE(least(), kBatches);
}

TEST_F(ManyClients, ABatchOfTenMillionPairsDelaysNoOtherByMoreThanItsSlices) {
  constexpr std::uint32_t kConfigurations = 85'500;
  start(scattered_scene(60));
  TestQuery batch;  // two bodies move: 117 pairs in each configuration
  batch.header.reduce = static_cast<std::uint8_t>(Reduce::kWithin);
  batch.header.max_distance = 1e-3;
  batch.header.max_results = 1000;
  batch.bodies = {0, 1};
  for (std::uint32_t k = 0; k < kConfigurations; ++k)
    for (int b = 0; b < 2; ++b) batch.configurations.push_back({1e-3 * (k % 40'000) - 20, 3.0 * b, 0, 1, 0, 0, 0});
  transport_->send(large_, batch.frame(1));
  loop_->turn();
  ASSERT_TRUE(large_.replies.empty());
  while (large_.replies.empty()) {
    turn();
    ASSERT_LE(most(), most_allowed()) << "after " << turns_ << " turns";
  }
  const Result reply = result_of(take(large_));
  EXPECT_EQ(reply.configurations() * reply.pairs(), std::uint64_t{117} * kConfigurations);
  EXPECT_GT(reply.configurations() * reply.pairs(), 10'000'000u);
  EXPECT_GT(reply.total(), 0u) << "some pair comes near";
  EXPECT_GT(least(), 10) << "everybody was answered again and again meanwhile";
}

/// A query of a client, and the answer of the engine in this process.
struct Expected {
  TestQuery query;
  test::Answer own;
};

TEST_F(ManyClients, OverSharedMemoryAndZeroMqAllGetTheEnginesBits) {
  constexpr int kScattered = 60, kQueries = 12;
  const TemporaryFolder folder;
  const std::string base = folder / "many";
  start(scattered_scene(kScattered));
  loop_->add(make_shm_transport(base + ".shm"));
  loop_->add(make_zmq_transport("ipc://" + base + ".zmq"));

  std::vector<Expected> expected(4);
  expected[0].query.pairs = {{3, 17}};
  for (std::uint32_t i = 0; i < 200; ++i) expected[1].query.pairs.push_back({i % 29, 30 + i % 30});
  expected[2].query.header.fields = kDefaultFields | kFieldPoints | kFieldNormal;  // all 1770
  expected[3].query.bodies = {5, 6};
  for (int k = 0; k < 60; ++k)
    for (int b = 0; b < 2; ++b) expected[3].query.configurations.push_back({0.3 * k, 2.0 * b, 0, 1, 0, 0, 0});
  const auto parts_of = [](const TestQuery& q, auto& view) {
    view.bodies = q.bodies;
    view.all_pairs = q.pairs.empty();
    view.fields = q.header.fields;
  };
  for (Expected& e : expected) {
    e.query.header.fields = e.query.header.fields ? e.query.header.fields : kDefaultFields;
    QueryView view;
    parts_of(e.query, view);
    view.pairs = {reinterpret_cast<const BodyPair*>(e.query.pairs.data()), e.query.pairs.size()};
    view.configurations = {reinterpret_cast<const Pose*>(e.query.configurations.data()), e.query.configurations.size()};
    view.configuration_count =
        static_cast<std::uint32_t>(e.query.bodies.empty() ? 0 : e.query.configurations.size() / e.query.bodies.size());
    e.own = test::evaluate(*engine_, view);
  }

  std::jthread serving([this] { loop_->run(); });
  std::atomic<int> right{0}, wrong{0};
  {
    std::vector<std::jthread> clients;
    for (int c = 0; c < kClients; ++c)
      clients.emplace_back([&, c] {
        Client client = patient(c % 2 ? "shm://" + base + ".shm" : "ipc://" + base + ".zmq");
        for (int i = 0; i < kQueries; ++i) {
          const Expected& e = expected[static_cast<std::size_t>(c + i) % expected.size()];
          Query query;
          parts_of(e.query, query);
          query.pairs = e.query.pairs;
          query.configurations = e.query.configurations;
          const Result reply = client.distances(query);
          const bool same = reply.rows() == e.own.size.rows &&
                            std::memcmp(reply.lower().data(), e.own.view.lower, 8 * reply.rows()) == 0 &&
                            std::memcmp(reply.upper().data(), e.own.view.upper, 8 * reply.rows()) == 0 &&
                            std::memcmp(reply.status().data(), e.own.view.status, reply.rows()) == 0;
          ++(same ? right : wrong);
        }
      });
  }
  loop_->stop();
  serving.join();
  EXPECT_EQ(right, kClients * kQueries);
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(loop_->waiting(), 0u);
  EXPECT_EQ(loop_->counter("errors"), 0u);
}

}  // namespace
}  // namespace clearance
