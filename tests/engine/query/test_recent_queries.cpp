// The last queries of a caller: known again by all but their configurations.
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "engine/query/recent_queries.h"

namespace clearance {
namespace {

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
          {"weights", [](QueryView& q) { q.weights = kNumbers; }},
          {"growths", [](QueryView& q) { q.growths = kNumbers; }}};
}

TEST(RecentQueries, AQueryIsKnownAgainByAllButItsConfigurations) {
  std::set<std::shared_ptr<JobPool>> pools;
  RecentQueries queries(2);
  for (const auto& [name, change] : changes()) {
    SCOPED_TRACE(name);
    QueryView query;
    query.joints = kJoints;
    query.configuration_count = 2;
    query.positions = kPositions;
    change(query);
    const std::shared_ptr<JobPool> pool = queries.pool_of(query, kFew);
    ASSERT_TRUE(pool);
    EXPECT_TRUE(pools.insert(pool).second) << "another query's pool";
    query.positions = kOtherNumbers;
    EXPECT_EQ(queries.pool_of(query, kFew), pool);
  }
}

TEST(RecentQueries, EvictTheOnesRepeatedLongestAgo) {
  RecentQueries queries(2);
  const std::weak_ptr<JobPool> first = queries.pool_of(within(0), kFew), second = queries.pool_of(within(1), kFew);
  for (std::size_t i = 2; i < RecentQueries::kQueries; ++i) queries.pool_of(within(static_cast<double>(i)), kFew);
  EXPECT_EQ(queries.pool_of(within(0), kFew), first.lock());  // now the latest
  queries.pool_of(within(100), kFew);
  EXPECT_FALSE(first.expired());
  EXPECT_TRUE(second.expired());
}

TEST(RecentQueries, AreFewerInLargeScenes) {
  EXPECT_EQ(RecentQueries::most(0), RecentQueries::kQueries);
  EXPECT_EQ(RecentQueries::most(RecentQueries::kBodies / 2), 2u);
  EXPECT_EQ(RecentQueries::most(2 * RecentQueries::kBodies), 1u);
  RecentQueries queries(2);
  const std::weak_ptr<JobPool> first = queries.pool_of(within(1), RecentQueries::kBodies / 2),
                               second = queries.pool_of(within(2), RecentQueries::kBodies / 2);
  EXPECT_FALSE(first.expired());
  queries.pool_of(within(3), RecentQueries::kBodies / 2);
  EXPECT_TRUE(first.expired());
  EXPECT_FALSE(second.expired());
}

}  // namespace
}  // namespace clearance
