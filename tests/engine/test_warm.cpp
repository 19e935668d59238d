// Memory of warm state: tables of the least recently used clients are evicted, those of jobs never are.
#include <gtest/gtest.h>

#include "engine/engine.h"
#include "engine/narrow/warm.h"

namespace clearance {
namespace {

constexpr std::uint64_t kRow = sizeof(WarmSimplex);

/// Runs a job of `client`, which marks its first simplex.
void evaluate(WarmStore& store, std::uint64_t client, std::uint64_t size) {
  auto table = store.take(client, client, size);
  ASSERT_TRUE(table);
  table->simplices[0].size = 3;
  store.put_back(std::move(table));
}
/// Whether the client's next job would begin warm. Does not count as a job.
bool is_warm(WarmStore& store, std::uint64_t client, std::uint64_t size) {
  auto table = store.take(client, client, size);
  const bool warm = table && table->simplices[0].size == 3;
  if (table) store.put_back(std::move(table));
  return warm;
}

TEST(WarmStore, TheLongestSilentMakesWay) {
  WarmStore store(100 * kRow);
  for (const std::uint64_t client : {1, 2, 3}) evaluate(store, client, 30);
  EXPECT_EQ(store.bytes(), 90 * kRow);
  EXPECT_TRUE(is_warm(store, 1, 30));
  evaluate(store, 4, 40);
  EXPECT_EQ(store.bytes(), 100 * kRow);
  EXPECT_TRUE(is_warm(store, 1, 30)) << "it has asked since";
  EXPECT_TRUE(is_warm(store, 3, 30));
  EXPECT_FALSE(is_warm(store, 2, 30));
  EXPECT_LE(store.bytes(), 100 * kRow);
  EXPECT_EQ(store.without_room(), 0u);
}

TEST(WarmStore, WhatJobsWorkOnIsCountedAndStays) {
  WarmStore store(100 * kRow);
  evaluate(store, 9, 30);
  std::vector<std::unique_ptr<WarmTable>> jobs;
  for (int i = 0; i < 3; ++i) {
    jobs.push_back(store.take(1, 1, 30));
    ASSERT_TRUE(jobs.back());
    EXPECT_LE(store.bytes(), 100 * kRow) << "client 9 makes way";
  }
  EXPECT_EQ(store.take(2, 2, 11), nullptr);
  EXPECT_EQ(store.without_room(), 1u);
  jobs.push_back(store.take(2, 2, 10));
  ASSERT_TRUE(jobs.back());
  EXPECT_EQ(store.bytes(), 100 * kRow);
  for (auto& job : jobs) store.put_back(std::move(job));
  EXPECT_EQ(store.bytes(), 40 * kRow) << "one table of each client is kept";
  store.trim(1, 30 * kRow);
  EXPECT_EQ(store.bytes(), 40 * kRow);
  store.trim(1, 30 * kRow - 1);
  EXPECT_EQ(store.bytes(), 10 * kRow);
  EXPECT_EQ(store.take(3, 3, 0), nullptr);
  EXPECT_EQ(store.take(3, 3, WarmStore::kMostSimplices + 1), nullptr);
  EXPECT_EQ(store.without_room(), 1u);
}

TEST(WarmStore, AQueryTakesWhatTheEngineSays) {
  Scene scene;
  for (int i = 0; i < 5; ++i) scene.add_box("b" + std::to_string(i), {1, 1, 1}, {.pose = Pose{{2.0 * i, 0, 0}}});
  Engine::Options options;
  options.threads = 1;
  options.warm_memory = 10 * kRow;
  const Engine engine(std::move(scene), options);
  const auto stat = [&](const std::string& wanted) {
    for (const auto& [name, value] : engine.stats())
      if (name == wanted) return value;
    return ~std::uint64_t{0};
  };
  QueryView query;
  query.fields = kFieldUpper;
  query.warm_slot = 1;
  double upper[10];
  ReplyView reply;
  reply.rows = 10;
  reply.upper = upper;
  const QuerySize size = engine.size(query);
  ASSERT_EQ(size.rows, 10u);
  EXPECT_EQ(Engine::warm_bytes(query, size), 10 * kRow);
  {
    Job job = engine.start(query, reply);
    EXPECT_EQ(stat("engine.warm_bytes"), 10 * kRow);
    query.warm_slot = 2;
    while (!engine.start(query, reply).advance()) {
    }
    EXPECT_EQ(stat("engine.warm_without_room"), 1u);
    while (!job.advance()) {
    }
  }
  EXPECT_EQ(stat("engine.warm_bytes"), 10 * kRow);
  engine.trim_warm(1, 0);
  EXPECT_EQ(stat("engine.warm_bytes"), 0u);
  query.reduce = Reduce::kMin;
  EXPECT_EQ(Engine::warm_bytes(query, engine.size(query)), 0u);
}

}  // namespace
}  // namespace clearance
