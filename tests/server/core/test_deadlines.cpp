// A query with a deadline is answered by then, or rejected: early if similar ones took longer.
#include <gtest/gtest.h>

#include <thread>

#include "server/limits/forecast.h"
#include "tests/server/core/loop_fixture.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameType;

class Deadlines : public LoopTest {
 protected:
  static TestQuery with_deadline(TestQuery query, std::chrono::nanoseconds deadline) {
    query.header.deadline_ns = deadline.count();
    return query;
  }
  void send(MemoryClient& client, const TestQuery& query) {
    sent_ = Loop::Clock::now();
    transport_->send(client, query.frame(1));
  }
  void wait_for(std::chrono::nanoseconds deadline) const { std::this_thread::sleep_until(sent_ + deadline + 1ms); }
  /// The message of a rejection.
  std::string rejection(MemoryClient& client, ErrorCode code = ErrorCode::kDeadline) {
    const auto frame = take(client);
    EXPECT_EQ(frame->type(), FrameType::kError);
    const auto error = wire::parse_error(frame->body());
    EXPECT_EQ(static_cast<ErrorCode>(error.header.code), code) << error.text;
    return error.text;
  }
  Loop::Clock::time_point sent_;
};

TEST_F(Deadlines, OneThatIsKeptChangesNothing) {
  start(scattered_scene(20), short_slices());
  const Result without = evaluate(a_, large_query(20)), with = evaluate(a_, with_deadline(large_query(20), 1h));
  ASSERT_EQ(with.rows(), without.rows());
  EXPECT_EQ(std::memcmp(with.lower().data(), without.lower().data(), 8 * with.rows()), 0);
}

TEST_F(Deadlines, OneThatHasPassedIsRejectedAtOnce) {
  start(small_scene());
  send(a_, with_deadline(small_query(), 1ns));
  turn_until_idle();
  EXPECT_EQ(rejection(a_),
            "no answer within the 1e-06 ms of its deadline_ns: it was waiting, or its pairs were still being listed");
  EXPECT_EQ(loop_->counter("errors.deadline"), 1u);
}

TEST_F(Deadlines, AQueryThatWaitsIsRejectedWhenItsDeadlinePasses) {
  start(scattered_scene(20), short_slices());
  transport_->send(b_, large_query(20).frame(1));
  loop_->turn();
  send(a_, with_deadline(large_query(20), 400ms));
  loop_->turn();
  ASSERT_EQ(loop_->waiting(), 2u);
  ASSERT_TRUE(a_.replies.empty());
  wait_for(400ms);
  loop_->turn();
  EXPECT_NE(rejection(a_).find("within the 400 ms of its deadline_ns: it was waiting"), std::string::npos);
  EXPECT_TRUE(b_.replies.empty()) << "before the other had ended";
  turn_until_idle();
  EXPECT_EQ(take(b_)->type(), FrameType::kReply);
  EXPECT_TRUE(a_.replies.empty());
  EXPECT_EQ(loop_->waiting(), 0u);
  EXPECT_EQ(a_.sinks, 0);
}

TEST_F(Deadlines, AQueryThatOverrunsIsGivenUp) {
  start(scattered_scene(20), short_slices());
  send(a_, with_deadline(large_query(20), 400ms));
  for (int i = 0; i < 20; ++i) loop_->turn();  // of some hundred slices
  ASSERT_TRUE(a_.replies.empty());
  wait_for(400ms);
  for (int i = 0; i < 3 && a_.replies.empty(); ++i) loop_->turn();
  EXPECT_NE(rejection(a_).find("it was given up after "), std::string::npos);
  turn_until_idle();
  EXPECT_EQ(loop_->waiting(), 0u);
  EXPECT_EQ(a_.sinks, 0);
  EXPECT_EQ(evaluate(a_, small_query()).rows(), 1u);
}

TEST_F(Deadlines, OneThatLikeQueriesDidNotKeepIsRejectedBeforeAnyWork) {
  start(scattered_scene(20), short_slices());
  evaluate(a_, large_query(20));
  std::string said;
  for (int i = 0; i < 10 && said.find("it would take about ") == std::string::npos; ++i) {
    send(a_, with_deadline(large_query(20), 500us));
    turn_until_idle();
    said = rejection(a_);  // the deadline had passed if this thread had no CPU for so long
  }
  EXPECT_NE(said.find(" ms, based on similar queries"), std::string::npos) << said;
}

TEST_F(Deadlines, ALargeRequestIsReadBeforeItsDeadlineIsKnown) {
  start(scattered_scene(20), short_slices());
  TestQuery query = large_query(20);
  for (int i = 0; i < 3; ++i)
    query.configurations.insert(query.configurations.end(), query.configurations.begin(), query.configurations.end());
  ASSERT_GT(query.frame(1).size(), kLargePayload);
  send(a_, with_deadline(query, 1ns));
  turn_until_idle();
  rejection(a_);
  EXPECT_EQ(evaluate(a_, with_deadline(query, 1h)).rows(), 320u * 190);
}

TEST_F(Deadlines, AQueryWaitsForPosesToItsDeadlineAtMost) {
  start(small_scene());
  send(a_, with_deadline(waiting_query(), 20ms));
  while (a_.replies.empty()) loop_->turn();
  EXPECT_NE(rejection(a_, ErrorCode::kPosesLate).find("came within 20.0"), std::string::npos);
  EXPECT_GE(Loop::Clock::now() - sent_, 20ms);
  EXPECT_EQ(loop_->held(), 0u);
}

TEST_F(Deadlines, ALoopThatSleepsWakesForThem) {
  Loop::Options options;
  options.tick = 1h;
  with_worker_ = true;
  start(small_scene(), options);
  transport_->send(a_, with_deadline(waiting_query(), 50ms).frame(1));
  std::thread serving([this] { loop_->run(); });
  transport_->wait_for_reply();
  loop_->stop();
  serving.join();
  rejection(a_, ErrorCode::kPosesLate);
}

TEST(Forecast, LearnsWhatLikeQueriesTook) {
  Forecast forecast;
  const QueryOptions options;
  const auto work = Forecast::work_of(options, {.part_pairs = 1'000'000});
  EXPECT_EQ(forecast.of(work), std::nullopt);
  EXPECT_NO_THROW(forecast.check(work, 1ns, 1ns)) << "of what was never seen nothing is said";
  forecast.note(work, 100ms, true);
  EXPECT_EQ(forecast.of(work), 100ms);
  EXPECT_EQ(forecast.of(Forecast::work_of(options, {.part_pairs = 800'000})), 80ms);
  EXPECT_NO_THROW(forecast.check(work, 100ms, 1s));
  QueryOptions depths;
  depths.signed_distance = true;
  EXPECT_EQ(forecast.of(Forecast::work_of(depths, {.part_pairs = 1'000'000})), std::nullopt) << "another kind";
  EXPECT_EQ(forecast.of(Forecast::work_of(options, {.part_pairs = 10})), std::nullopt) << "another size";
  for (int i = 0; i < 50; ++i) forecast.note(work, 20ms, true);
  EXPECT_NEAR(static_cast<double>(forecast.of(work)->count()), 20e6, 1e4);
}

TEST(Forecast, OneThatLostItsCpuSpoilsNoOthers) {
  Forecast forecast;
  const auto work = Forecast::work_of({}, {.part_pairs = 1});
  for (int i = 0; i < 5; ++i) forecast.note(work, 3us, true);
  forecast.note(work, 100ms, true);
  forecast.note(work, 100ms, false);
  EXPECT_NO_THROW(forecast.check(work, 1ms, 1ms));
  for (int i = 0; i < 50; ++i) forecast.note(work, 100ms, true);
  EXPECT_THROW(forecast.check(work, 1ms, 1ms), RejectedRequest) << "where all of them take long that is learnt";
}

TEST(Forecast, TriesAgainAfterSomeRejections) {
  Forecast forecast;
  const auto work = Forecast::work_of({}, {.part_pairs = 1000});
  forecast.note(work, 10ms, false);
  EXPECT_EQ(forecast.of(work), 20ms) << "it had 10 ms, and was not done";
  int rejected = 0;
  const auto is_rejected = [&] {
    try {
      forecast.check(work, 10ms, 15ms);
      return false;
    } catch (const RejectedRequest& rejection) {
      if (rejected == 0) {
        EXPECT_EQ(rejection.text,
                  "no answer within the 15 ms of its deadline_ns: it would take about 20 ms, based on similar queries");
      }
      return true;
    }
  };
  while (is_rejected()) ASSERT_LT(++rejected, 100);
  EXPECT_GT(rejected, 10);
}

}  // namespace
}  // namespace clearance
