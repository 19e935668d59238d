// Pools of clients' repeated queries: one for each query, and no client takes those of another.
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "server/tasks/client_jobs.h"

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

constexpr std::size_t kFew = 30;  // bodies

QueryView within(double metres) {
  QueryView query;
  query.max_distance = metres;
  return query;
}

const std::vector<std::uint32_t> kJoints{0, 1, 2}, kTurned{2, 1, 0};
const std::vector<BodyPair> kPairs{{0, 5}, {1, 5}}, kOtherPairs{{0, 5}, {1, 6}};
const std::vector<MarginEntry> kMargins{{kEveryBody, kEveryBody, 0.1}}, kOtherMargins{{kEveryBody, kEveryBody, 0.2}};
const std::vector<double> kPositions{0, 1, 2, 3, 4, 5}, kNumbers{0.1, 0.1}, kOtherNumbers{0.1, 0.2};

// Queries of which each differs from the others, also from the first, and not by the values of configurations.
std::vector<std::pair<std::string, std::function<void(QueryView&)>>> changes() {
  return {{"nothing", [](QueryView&) {}},
          {"max_distance", [](QueryView& q) { q.max_distance = 0.5; }},
          {"abs_tol", [](QueryView& q) { q.abs_tol = 1e-3; }},
          {"rel_tol", [](QueryView& q) { q.rel_tol = 1e-3; }},
          {"precision", [](QueryView& q) { q.precision = Precision::kF32; }},
          {"signed", [](QueryView& q) { q.signed_distance = true; }},
          {"fields", [](QueryView& q) { q.fields = kFieldStatus; }},
          {"any", [](QueryView& q) { q.reduce = Reduce::kAny; }},
          {"margin", [](QueryView& q) { q.margin = 0.01; }},
          {"max_evaluations", [](QueryView& q) { q.max_evaluations = 8; }},
          {"joints", [](QueryView& q) { q.joints = kTurned; }},
          {"bodies", [](QueryView& q) { q.bodies = kJoints; }},
          {"count", [](QueryView& q) { q.configuration_count = 1; }},
          {"scene", [](QueryView& q) { q.scene_revision = 7; }},
          {"no pairs", [](QueryView& q) { q.all_pairs = false; }},
          {"pairs", [](QueryView& q) { q.pairs = kPairs; }},
          {"other pairs", [](QueryView& q) { q.pairs = kOtherPairs; }},
          {"margins", [](QueryView& q) { q.margins = kMargins; }},
          {"other margins", [](QueryView& q) { q.margins = kOtherMargins; }},
          {"pair_margins", [](QueryView& q) { q.pair_margins = kNumbers; }},
          {"other pair_margins", [](QueryView& q) { q.pair_margins = kOtherNumbers; }},
          {"weights", [](QueryView& q) { q.weights = kNumbers; }}};
}

TEST(ClientJobs, AQueryIsKnownAgainByAllButItsConfigurations) {
  std::set<std::shared_ptr<JobPool>> pools;
  ClientJobs jobs;
  for (const auto& [name, change] : changes()) {
    SCOPED_TRACE(name);
    QueryView query;
    query.joints = kJoints;
    query.configuration_count = 2;
    query.positions = kPositions;
    change(query);
    const FakeSink client(1);
    const std::shared_ptr<JobPool> pool = jobs.pool_of(client, query, kFew);
    ASSERT_TRUE(pool);
    EXPECT_TRUE(pools.insert(pool).second) << "another query's pool";
    query.positions = kOtherNumbers;
    EXPECT_EQ(jobs.pool_of(client, query, kFew), pool);
  }
}

TEST(ClientJobs, AClientReplacesItsOwnQueriesAlone) {
  ClientJobs jobs;
  const FakeSink one(1), other(2);
  const std::weak_ptr<JobPool> of_one = jobs.pool_of(one, within(0), kFew),
                               of_other = jobs.pool_of(other, within(0), kFew);
  EXPECT_NE(of_one.lock(), of_other.lock());
  for (std::size_t i = 1; i < RecentQueries::kQueries; ++i) jobs.pool_of(one, within(static_cast<double>(i)), kFew);
  EXPECT_EQ(jobs.pool_of(one, within(0), kFew), of_one.lock());  // now its latest
  const std::weak_ptr<JobPool> second = jobs.pool_of(one, within(1), kFew);
  for (std::size_t i = 0; i < RecentQueries::kQueries - 1; ++i)
    jobs.pool_of(one, within(100 + static_cast<double>(i)), kFew);
  EXPECT_TRUE(of_one.expired());
  EXPECT_FALSE(second.expired());
  EXPECT_EQ(jobs.pool_of(other, within(0), kFew), of_other.lock());
}

TEST(ClientJobs, LargeScenesHaveFewerQueries) {
  ClientJobs jobs;
  const FakeSink client(1);
  const std::weak_ptr<JobPool> first = jobs.pool_of(client, within(1), RecentQueries::kBodies / 2);
  const std::weak_ptr<JobPool> second = jobs.pool_of(client, within(2), RecentQueries::kBodies / 2);
  EXPECT_FALSE(first.expired());
  const std::weak_ptr<JobPool> third = jobs.pool_of(client, within(3), RecentQueries::kBodies / 2);
  EXPECT_TRUE(first.expired());
  EXPECT_FALSE(second.expired());
  const std::weak_ptr<JobPool> fourth = jobs.pool_of(client, within(4), 2 * RecentQueries::kBodies);
  EXPECT_TRUE(third.expired());
  EXPECT_FALSE(fourth.expired());
}

TEST(ClientJobs, AClientThatIsGoneHasNone) {
  ClientJobs jobs;
  const FakeSink one(1), other(2), unwatched(3, false);
  EXPECT_EQ(jobs.pool_of(unwatched, within(1), kFew), nullptr);
  const std::weak_ptr<JobPool> of_one = jobs.pool_of(one, within(1), kFew),
                               of_other = jobs.pool_of(other, within(1), kFew);
  jobs.drop_gone();
  EXPECT_FALSE(of_one.expired());
  *one.is_there = false;
  jobs.drop_gone();
  EXPECT_TRUE(of_one.expired());
  EXPECT_FALSE(of_other.expired());
}

TEST(ClientJobs, WhatDependsOnTheClockIsNotKept) {
  ClientJobs jobs;
  const FakeSink client(1);
  QueryView query;
  query.max_pose_age_ns = 1;
  EXPECT_EQ(jobs.pool_of(client, query, kFew), nullptr);
}

}  // namespace
}  // namespace clearance
