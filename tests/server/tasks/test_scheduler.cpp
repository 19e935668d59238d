// Scheduling, tested with queries that only record their slices and advance a simulated clock.
#include <gtest/gtest.h>

#include <vector>

#include "server/tasks/scheduler.h"

namespace clearance {
namespace {

using namespace std::chrono_literals;

TEST(FairQueue, ClientsTakeTurns) {
  FairQueue<int> queue;
  for (int i = 0; i < 3; ++i) queue.push(1, 10 + i);
  queue.push(2, 20);
  queue.push(3, 30);
  std::vector<int> order;
  while (!queue.empty()) order.push_back(queue.pop());
  EXPECT_EQ(order, (std::vector<int>{10, 20, 30, 11, 12}));
}

TEST(FairQueue, OneClientsItemsAreOrdered) {
  struct ByTens {
    bool operator()(int a, int b) const { return a / 10 < b / 10; }
  };
  FairQueue<int, ByTens> queue;
  for (const int i : {31, 10, 32, 20, 11}) queue.push(1, i);
  queue.push(2, 90);
  std::vector<int> order;
  while (!queue.empty()) order.push_back(queue.pop());
  EXPECT_EQ(order, (std::vector<int>{10, 90, 11, 20, 31, 32}));
}

class SchedulerTest : public testing::Test {
 protected:
  using Clock = Scheduler::Clock;
  static constexpr auto kSlice = 200us;

  struct What {
    int name;
    std::uint64_t client;
    int slices = 1;
    std::chrono::nanoseconds due = 0ns, takes = kSlice;
    bool wanted = true;
    ServiceClass service = ServiceClass::kPlanning;
  };
  class FakeQuery final : public ScheduledQuery {
   public:
    FakeQuery(SchedulerTest& test, const What& what)
        : ScheduledQuery(what.client, what.service, Clock::time_point(what.due)), test_(test), what_(what) {
      ++test_.alive_;
    }
    ~FakeQuery() override { --test_.alive_; }
    bool is_wanted() const override { return what_.wanted && client() != test_.gone_; }
    void free_memory() override { ++test_.freed_; }
    bool advance(std::chrono::nanoseconds budget, Clock::time_point& now) override {
      EXPECT_EQ(budget, kSlice);
      test_.slices_.push_back(what_.name);
      now += what_.takes;
      return --what_.slices == 0;
    }

   private:
    SchedulerTest& test_;
    What what_;
  };

  void add(const What& what) { scheduler_.add(std::make_unique<FakeQuery>(*this, what)); }
  /// Returns the number of queries dropped because their clients are gone.
  int work() {
    const int before = freed_;
    scheduler_.work(Clock::time_point(), [](Scheduler::QueryPtr) {});
    return freed_ - before;
  }
  /// The slices that this many calls of work() give, by name.
  std::vector<int> work(int calls) {
    slices_.clear();
    while (calls-- > 0) work();
    return slices_;
  }
  std::vector<int> work_to_the_end() {
    slices_.clear();
    while (!scheduler_.empty()) work();
    return slices_;
  }

  std::vector<int> slices_;
  std::uint64_t gone_ = 0;  // a client
  int alive_ = 0;           // queries
  int freed_ = 0;           // likewise
  Scheduler scheduler_{kSlice};
};

TEST_F(SchedulerTest, AFreshQueryComesBeforeALongOne) {
  add({.name = 1, .client = 1, .slices = 100});
  EXPECT_EQ(work(3), (std::vector<int>{1, 1, 1}));
  add({.name = 2, .client = 2});
  add({.name = 3, .client = 1});
  EXPECT_EQ(work(3), (std::vector<int>{2, 3, 1})) << "also before a long one of its own client";
  EXPECT_EQ(scheduler_.size(), 1u);
  EXPECT_EQ(alive_, 1) << "those that are over are gone";
}

TEST_F(SchedulerTest, ClientsTakeTurns) {
  for (int i = 0; i < 50; ++i) add({.name = 1, .client = 1});
  add({.name = 2, .client = 2});
  add({.name = 3, .client = 3});
  EXPECT_EQ(work(5), (std::vector<int>{1, 2, 3, 1, 1})) << "one of many queries delays no other by more than one";
}

TEST_F(SchedulerTest, LongQueriesOfSeveralClientsTakeTurns) {
  for (int client = 1; client <= 3; ++client)
    add({.name = client, .client = static_cast<std::uint64_t>(client), .slices = 3});
  EXPECT_EQ(work_to_the_end(), (std::vector<int>{1, 2, 3, 1, 2, 3, 1, 2, 3}));
}

TEST_F(SchedulerTest, OfOneClientsLongQueriesOneGoesAfterTheOther) {
  add({.name = 1, .client = 1, .slices = 3, .due = 30ms});
  add({.name = 2, .client = 1, .slices = 3, .due = 10ms});
  add({.name = 3, .client = 1, .slices = 3, .due = 20ms});
  EXPECT_EQ(work_to_the_end(), (std::vector<int>{2, 3, 1, 2, 2, 3, 3, 1, 1})) << "which is due first is over first";
}

TEST_F(SchedulerTest, ALongQueryIsNotForgottenHoweverManyNewOnesCome) {
  add({.name = 1, .client = 1, .slices = 1000});
  work();
  slices_.clear();
  for (int i = 0; i < 100; ++i) {
    for (std::uint64_t client = 2; client < 5; ++client) add({.name = 0, .client = client});
    work();
  }
  ASSERT_EQ(slices_.size(), 100u);
  for (std::size_t i = 0; i < slices_.size(); ++i) EXPECT_EQ(slices_[i], i % 5 == 3) << "slice " << i;
  EXPECT_EQ(scheduler_.size(), 221u);
}

TEST_F(SchedulerTest, TheClassControlGoesFirst) {
  for (std::uint64_t client = 1; client <= 20; ++client) add({.name = 1, .client = client, .slices = 3});
  work(30);
  add({.name = 2, .client = 30, .slices = 3, .service = ServiceClass::kControl});
  EXPECT_EQ(work(4), (std::vector<int>{2, 2, 2, 1})) << "to its end, whatever the others have waiting";
}

TEST_F(SchedulerTest, TheClassControlLeavesTheOthersASliceNowAndThen) {
  add({.name = 1, .client = 1, .slices = 1000});
  for (int i = 0; i < 1000; ++i) add({.name = 0, .client = 2, .service = ServiceClass::kControl});
  const std::vector<int> order = work(260);
  for (std::size_t i = 0; i < order.size(); ++i) EXPECT_EQ(order[i], i % 65 == 64) << "slice " << i;
}

TEST_F(SchedulerTest, WorksForASliceInAll) {
  for (int i = 0; i < 10; ++i) add({.name = i, .client = 1, .takes = 60us});
  EXPECT_EQ(work(1), (std::vector<int>{0, 1, 2, 3})) << "the fourth began within the slice";
  EXPECT_EQ(work(1), (std::vector<int>{4, 5, 6, 7}));
  add({.name = 10, .client = 2, .takes = 1s});
  EXPECT_EQ(work(1), (std::vector<int>{8, 10})) << "after one that took too long the transports have their turn";
  EXPECT_EQ(work(5), (std::vector<int>{9})) << "and without any there is nothing to do";
  EXPECT_EQ(scheduler_.size(), 0u);
}

TEST_F(SchedulerTest, ThoseThatAreNotWantedAreDroppedWithoutASlice) {
  add({.name = 1, .client = 1, .slices = 9});
  add({.name = 2, .client = 2, .slices = 9});
  ASSERT_EQ(work(2), (std::vector<int>{1, 2}));
  add({.name = 3, .client = 1});
  add({.name = 4, .client = 2});
  gone_ = 1;
  slices_.clear();
  EXPECT_EQ(work(), 1) << "the fresh one";
  EXPECT_EQ(slices_, (std::vector<int>{4})) << "its slice is the next one's";
  slices_.clear();
  EXPECT_EQ(work(), 1) << "the long one";
  EXPECT_EQ(slices_, (std::vector<int>{2}));
  EXPECT_EQ(alive_, 1);
  add({.name = 5, .client = 3, .wanted = false});
  add({.name = 6, .client = 4});
  slices_.clear();
  EXPECT_EQ(work(), 1) << "found out when its turn came";
  EXPECT_EQ(slices_, (std::vector<int>{6})) << "its slice is the next one's";
  EXPECT_EQ(alive_, 1);
}

TEST_F(SchedulerTest, WhatIsStillUnderWayEndsWithIt) {
  {
    Scheduler other(kSlice);
    other.add(std::make_unique<FakeQuery>(*this, What{.name = 1, .client = 1}));
    EXPECT_EQ(alive_, 1);
  }
  EXPECT_EQ(alive_, 0);
}

}  // namespace
}  // namespace clearance
