// The class control precedes the class planning, and planning never takes the resources that control needs.
#include <gtest/gtest.h>

#include "server/shm/shm_segment.h"
#include "server/shm/shm_transport.h"
#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

class Classes : public LoopTest {
 protected:
  Classes() { a_.rights = kAllRights | kControl; }
  void send(MemoryClient& client, const TestQuery& query, std::uint64_t id = 1) {
    transport_->send(client, query.frame(id));
  }
  void serve(const MemoryClient& client, std::size_t replies = 1) {
    while (client.replies.size() < replies) ASSERT_TRUE(loop_->turn());
  }
  static TestQuery lowered(TestQuery query) {
    query.flags = wire::kFramePlanning;
    return query;
  }
};

TEST_F(Classes, ControlGoesFirst) {
  start(scattered_scene(20), short_slices());
  send(b_, large_query(20));
  send(c_, large_query(20));
  for (int i = 0; i < 10; ++i) loop_->turn();  // both have begun
  send(a_, large_query(20));
  serve(a_);
  EXPECT_TRUE(b_.replies.empty() && c_.replies.empty()) << "they began earlier, and are not even half done";
  serve(b_);
  serve(c_);
  EXPECT_EQ(result_of(take(a_)).rows(), result_of(take(b_)).rows());
}

TEST_F(Classes, ASmallControlQueryIsAnsweredBeforeSmallOnesThatCameEarlier) {
  start(small_scene(), short_slices());
  for (std::uint64_t i = 0; i < 20; ++i) send(b_, small_query(), i);
  send(a_, small_query());
  serve(a_);
  EXPECT_LE(b_.replies.size(), 1u);
  serve(b_, 20);
}

TEST_F(Classes, ARequestMayHaveALowerClassThanItsClient) {
  start(scattered_scene(20), short_slices());
  send(b_, large_query(20));
  loop_->turn();
  send(a_, lowered(large_query(20)), 1);
  loop_->turn();
  send(a_, large_query(20), 2);
  serve(a_);
  EXPECT_EQ(take(a_)->header().request_id, 2u) << "the later one, which has the client's class";
  serve(b_);
  serve(a_);
}

TEST_F(Classes, ALargeRequestMayHaveALowerClass) {
  start(scattered_scene(20), short_slices());
  TestQuery query = large_query(20);
  for (int i = 0; i < 3; ++i)
    query.configurations.insert(query.configurations.end(), query.configurations.begin(), query.configurations.end());
  ASSERT_GT(query.frame(1).size(), kLargePayload);
  send(a_, lowered(query), 1);
  for (int i = 0; i < 10; ++i) loop_->turn();
  send(a_, query, 2);
  serve(a_);
  EXPECT_EQ(take(a_)->header().request_id, 2u);
  serve(a_);
}

/// The share of the class planning is full; a client of class control is admitted.
TEST_F(Classes, MemoryIsKeptForControl) {
  Loop::Options options = short_slices();
  options.max_waiting_bytes = 1 << 20;
  options.kept_for_control = 300 << 10;
  start(scattered_scene(20), options);
  for (const std::uint64_t id : {1, 2, 3}) send(id % 2 ? b_ : c_, large_query(20), id);  // of 237 kB each
  for (int i = 0; i < 20; ++i) loop_->turn();
  ASSERT_EQ(loop_->waiting(), 3u);
  send(a_, lowered(large_query(20)), 1);
  send(a_, large_query(20), 2);
  serve(a_, 2);
  for (int i = 0; i < 2; ++i) {
    const auto answer = take(a_);
    if (answer->header().request_id == 1)
      EXPECT_EQ(answer->type(), FrameType::kError) << "as planning there is no room for it";
    else
      EXPECT_EQ(answer->type(), FrameType::kReply);
  }
  turn_until_idle();
  send(b_, large_query(20), 99);
  serve(b_);
  turn_until_idle();
  EXPECT_EQ(b_.replies.back()->type(), FrameType::kReply) << "nothing is left behind";
}

TEST_F(Classes, WhatIsKeptForControlIsNotTakenTwice) {
  Quotas::Limits limits;
  limits.max_waiting_bytes = 1000;
  limits.kept_for_control = 200;
  Quotas quotas(limits);
  const auto take = [&](std::uint64_t client, ServiceClass service, std::uint64_t bytes) {
    quotas.check_bytes(client, service, bytes, 0);
    return quotas.take(client, service, bytes);
  };
  const auto planning = take(1, ServiceClass::kPlanning, 700);
  EXPECT_THROW(quotas.check_bytes(2, ServiceClass::kPlanning, 101, 0), RejectedRequest);
  const auto first = take(3, ServiceClass::kControl, 200);
  EXPECT_NO_THROW(quotas.check_bytes(2, ServiceClass::kPlanning, 100, 0)) << "control took what is its own";
  const auto second = take(4, ServiceClass::kControl, 100);
  EXPECT_THROW(quotas.check_bytes(2, ServiceClass::kPlanning, 1, 0), RejectedRequest)
      << "and now of what is everybody's";
  EXPECT_THROW(quotas.check_bytes(4, ServiceClass::kControl, 1, 0), RejectedRequest);
}

TEST(Segments, AreKeptForTheClassControl) {
  const auto budget = std::make_shared<SegmentBudget>();
  budget->limit = std::uint64_t{170} << 20;
  budget->kept_for_control = std::uint64_t{50} << 20;
  const ShmLimits limits;
  std::string why;
  std::vector<std::shared_ptr<Segment>> segments;  // of 20 MiB each
  const auto take = [&](ServiceClass service) {
    segments.push_back(Segment::make(budget, nullptr, limits, service, 0, 0, 0, why));
    return segments.back() != nullptr;
  };
  while (take(ServiceClass::kPlanning)) ASSERT_LT(segments.size(), 20u);
  EXPECT_EQ(segments.size(), 6u) << "five, and one that is refused";
  EXPECT_NE(why.find("no room for a segment of "), std::string::npos) << why;
  EXPECT_TRUE(take(ServiceClass::kControl)) << why;
  EXPECT_TRUE(take(ServiceClass::kControl)) << why;
}

/// A control client may send requests as large as others': the loop's share is as small.
TEST_F(Classes, ControlDoesNotHoldTheLoopUpEither) {
  with_worker_ = true;
  engine::Scene scene;
  std::vector<std::string> names;
  for (int i = 0; i < 1500; ++i) {
    names.push_back("b" + std::to_string(i));
    scene.add_sphere(names.back(), 0.1, at(i % 50, i / 50, 0));
  }
  scene.add_group("all", names);
  start(std::move(scene));
  TestQuery groups;
  groups.pairs = {{kGroupBit, kGroupBit}};
  groups.header.reduce = static_cast<std::uint8_t>(Reduce::kMin);
  send(a_, groups, 1);
  transport_->send(a_, simple_frame(FrameType::kPing, 2, std::vector<std::byte>(8 << 20)));
  transport_->send(a_, groups.frame(3, FrameType::kPairs));
  while (a_.replies.size() < 3) loop_->turn();
  EXPECT_LE(loop_->counter("loop.longest_section_units"), 8192u);
  for (int i = 0; i < 3; ++i) EXPECT_NE(take(a_)->type(), FrameType::kError);
}

}  // namespace
}  // namespace clearance
