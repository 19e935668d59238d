// Queries of clients that are known again by their bytes: read as a parser reads them, and never those of another client.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "engine/query/recent_queries.h"
#include "server/tasks/client_queries.h"
#include "server/tasks/query_input.h"
#include "tests/engine/arm_scene.h"
#include "tests/server/core/memory_transport.h"

namespace clearance {
namespace {

/// A client, connected until `is_there` is false.
struct FakeSink final : ReplySink {
  explicit FakeSink(std::uint64_t number, bool is_watched = true) : number_(number), is_watched_(is_watched) {}
  std::byte* reserve(std::uint64_t) override { return nullptr; }
  void publish(std::uint64_t) override {}
  bool alive() const override { return *is_there; }
  std::uint64_t client() const override { return number_; }
  std::function<bool()> watch() const override {
    return [there = is_there] { return *there; };
  }
  bool sees_end() const override { return is_watched_; }

  std::shared_ptr<bool> is_there = std::make_shared<bool>(true);

 private:
  std::uint64_t number_;
  bool is_watched_;
};

/// A request in memory of its own, at an address of its own.
struct TestRequest {
  explicit TestRequest(const TestQuery& query) : TestRequest(query.frame(1)) {}
  explicit TestRequest(const std::vector<std::byte>& frame) : words((frame.size() + 7) / 8) {
    std::memcpy(&header, frame.data(), sizeof header);
    std::memcpy(words.data(), frame.data() + sizeof header, frame.size() - sizeof header);
  }
  std::span<std::byte> payload() { return std::as_writable_bytes(std::span(words)).first(header.payload_bytes); }
  std::span<const std::byte> payload() const { return std::as_bytes(std::span(words)).first(header.payload_bytes); }

  wire::FrameHeader header;
  std::vector<std::uint64_t> words;
};

TestQuery of_joints(double at = 0.1) {
  TestQuery query;
  query.joints = {0, 1};
  query.positions = {at, at, at, at};
  return query;
}
TestQuery of_both(double at = 0.1) {
  TestQuery query = of_joints(at);
  query.pairs = {{0, 2}, {1, 2}, {1, 3}};
  query.bodies = {1};
  query.configurations = {{at, 0, 0, 1, 0, 0, 0}, {0, at, 0, 1, 0, 0, 0}};
  wire::append_epoch(query.records, 5, wire::kRecordRequired);
  return query;
}

template <class T>
void expect_same(const wire::Records<T>& a, const wire::Records<T>& b, const char* what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  EXPECT_TRUE(a.size() == 0 || std::memcmp(a.data(), b.data(), a.size_bytes()) == 0) << what;
}

void expect_same(const wire::QueryParts& a, const wire::QueryParts& b) {
  EXPECT_EQ(std::memcmp(&a.header, &b.header, sizeof a.header), 0);
  for_each_query_option(
      [&](const QueryOption& option, auto member) { EXPECT_EQ(member(a.options), member(b.options)) << option.name; });
  EXPECT_EQ(a.passed_over, b.passed_over);
  EXPECT_EQ(a.epoch, b.epoch);
  expect_same(a.pairs, b.pairs, "pairs");
  expect_same(a.bodies, b.bodies, "bodies");
  expect_same(a.configurations, b.configurations, "configurations");
  expect_same(a.joints, b.joints, "joints");
  expect_same(a.positions, b.positions, "positions");
  expect_same(a.margins, b.margins, "margins");
  expect_same(a.pair_margins, b.pair_margins, "pair_margins");
  expect_same(a.weights, b.weights, "weights");
  expect_same(a.growths, b.growths, "growths");
}

class ClientQueriesTest : public testing::Test {
 protected:
  const ClientQuery& read(const FakeSink& client, const TestRequest& request) {
    return queries_.read(client, request.header, request.payload(), engine_);
  }
  std::shared_ptr<JobPool> jobs(const FakeSink& client, const TestQuery& query) {
    return read(client, TestRequest(query)).jobs;
  }

  engine::Engine engine_{test::arm_scene(test::at_home()), {.threads = 1}};
  ClientQueries queries_;
  FakeSink one_{1}, other_{2};
};

TEST_F(ClientQueriesTest, OtherInputsAreTheSameQuery) {
  for (const auto make : {of_joints, of_both}) {
    const std::shared_ptr<JobPool> pool = jobs(one_, make(0.1));
    ASSERT_TRUE(pool);
    const TestRequest request(make(0.2));
    const ClientQuery& query = read(one_, request);
    EXPECT_EQ(query.jobs, pool);
    EXPECT_EQ(query.parts.positions[0], 0.2);
    expect_same(query.parts, wire::parse_query(request.header, request.payload()));
  }
}

TEST_F(ClientQueriesTest, OtherOptionsAndArraysAreNot) {
  const std::vector<std::function<void(TestQuery&)>> changes{
      [](TestQuery& q) { q.header.max_distance = 0.5; },
      [](TestQuery& q) { q.header.fields = kFieldStatus; },
      [](TestQuery& q) { q.header.reduce = static_cast<std::uint8_t>(Reduce::kMin); },
      [](TestQuery& q) { q.joints = {1, 0}; },
      [](TestQuery& q) { q.bodies = {2}; },
      [](TestQuery& q) { q.pairs[2][1] = 4; },
      [](TestQuery& q) { q.positions.resize(2), q.configurations.resize(1); },
      [](TestQuery& q) { q.scene_revision = 7; },
      [](TestQuery& q) { q.records.clear(), wire::append_epoch(q.records, 7, wire::kRecordRequired); }};
  const std::shared_ptr<JobPool> pool = jobs(one_, of_both());
  for (std::size_t i = 0; i < changes.size(); ++i) {
    TestQuery query = of_both();
    changes[i](query);
    EXPECT_NE(jobs(one_, query), pool) << "change " << i;
    EXPECT_EQ(jobs(one_, of_both()), pool) << "change " << i;
  }
}

TEST_F(ClientQueriesTest, TheStampThatAQueryWaitsForIsAnInput) {
  const auto waiting = [](std::int64_t stamp) {
    TestQuery query = of_joints();
    query.header.min_pose_stamp_ns = stamp;
    query.header.deadline_ns = 1000;
    return query;
  };
  const std::shared_ptr<JobPool> pool = jobs(one_, waiting(5));
  const ClientQuery& next = read(one_, TestRequest(waiting(7)));
  EXPECT_EQ(next.jobs, pool);
  EXPECT_EQ(next.parts.options.min_pose_stamp_ns, 7);
  EXPECT_EQ(next.parts.header.min_pose_stamp_ns, 7);
  EXPECT_THROW(jobs(one_, waiting(-1)), wire::WireError);
  EXPECT_EQ(jobs(one_, waiting(0)), pool);
}

// Any bytes, also those that only look like a kept query, are read as a parser reads them.
TEST_F(ClientQueriesTest, ChangedBytesAreReadAsByAParser) {
  std::mt19937 random(11);
  int known = 0, parsed = 0, rejected = 0;
  for (int round = 0; round < 20000; ++round) {
    const TestQuery base = round % 2 ? of_both() : of_joints();
    const std::shared_ptr<JobPool> pool = jobs(one_, base);
    TestRequest request(base);
    const std::span<std::byte> bytes = request.payload();
    for (unsigned changes = 1 + random() % 2; changes > 0; --changes)
      bytes[random() % bytes.size()] = static_cast<std::byte>(random() % 4 ? random() : random() % 3);
    if (random() % 8 == 0) request.header.records_bytes = random() % 3 * 8;
    std::optional<wire::QueryParts> expected;
    try {
      expected = wire::parse_query(request.header, request.payload());
    } catch (const wire::WireError& error) {
      EXPECT_THROW(read(one_, request), wire::WireError) << error.what();
      ++rejected;
      continue;
    }
    const ClientQuery& query = read(one_, request);
    expect_same(query.parts, *expected);
    ++(query.jobs == pool ? known : parsed);
    if (HasFailure()) FAIL() << "round " << round;
  }
  EXPECT_GT(known, 1000);
  EXPECT_GT(parsed, 1000);
  EXPECT_GT(rejected, 1000);
}

TEST_F(ClientQueriesTest, AClientReplacesItsOwnQueriesAlone) {
  const auto within = [](double metres) {
    TestQuery query = of_joints();
    query.header.max_distance = metres;
    return query;
  };
  const std::weak_ptr<JobPool> of_one = jobs(one_, within(0)), of_other = jobs(other_, within(0));
  EXPECT_NE(of_one.lock(), of_other.lock());
  for (std::size_t i = 1; i < RecentQueries::kQueries; ++i) jobs(one_, within(static_cast<double>(i)));
  EXPECT_EQ(jobs(one_, within(0)), of_one.lock());  // now its latest
  const std::weak_ptr<JobPool> second = jobs(one_, within(1));
  for (std::size_t i = 0; i < RecentQueries::kQueries - 1; ++i) jobs(one_, within(100 + static_cast<double>(i)));
  EXPECT_TRUE(of_one.expired());
  EXPECT_FALSE(second.expired());
  EXPECT_EQ(jobs(other_, within(0)), of_other.lock());
}

TEST_F(ClientQueriesTest, AClientThatIsGoneHasNone) {
  const FakeSink unwatched(3, false);
  EXPECT_EQ(jobs(unwatched, of_joints()), nullptr);
  const std::weak_ptr<JobPool> of_one = jobs(one_, of_joints()), of_other = jobs(other_, of_joints());
  queries_.drop_gone();
  EXPECT_FALSE(of_one.expired());
  *one_.is_there = false;
  queries_.drop_gone();
  EXPECT_TRUE(of_one.expired());
  EXPECT_FALSE(of_other.expired());
}

TEST_F(ClientQueriesTest, WhatDependsOnTheClockIsNotKept) {
  TestQuery query = of_joints();
  query.header.max_pose_age_ns = 1;
  EXPECT_EQ(jobs(one_, query), nullptr);
}

TEST_F(ClientQueriesTest, TheCostIsThatOfThePresentScene) {
  const TestRequest request(of_joints());
  const std::uint64_t before = read(one_, request).cost.part_pairs;
  const auto cost = [&] { return engine_.cost(view_of(wire::parse_query(request.header, request.payload()), 0)); };
  EXPECT_EQ(before, cost().part_pairs);
  engine_.attach(1, 4);  // the ball moves with a link, so that it has pairs
  EXPECT_EQ(read(one_, request).cost.part_pairs, cost().part_pairs);
  EXPECT_NE(read(one_, request).cost.part_pairs, before);
}

}  // namespace
}  // namespace clearance
