// Makes joint tables in the background and hands them out.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "engine/cache/background_worker.h"
#include "engine/cache/cache.h"
#include "engine/joint_table/joint_table_maker.h"

namespace clearance {

/// Tables by robots, links and their parts, shared by engines. Thread-safe. They are kept in the cache.
class JointTableStore {
 public:
  static constexpr std::size_t kMostOfRobot = 24;
  static constexpr std::size_t kMostTables = 192;  // about 70 MB

  /// Requests tables for the enabled pairs of links of each robot: of one joint before two, at most kMostOfRobot.
  /// Drops tables whose owners are gone.
  void request(const engine::Scene& scene, const TaskOwner& owner = {});
  /// The table of two links of a robot, or null while there is none.
  std::shared_ptr<const JointTable> find(const SceneRobot& robot, const Body& a, const Body& b) const;
  /// BackgroundWorker::wait().
  bool wait(std::chrono::nanoseconds timeout) { return worker_.wait(timeout); }
  /// Increases whenever a table arrives. Takes no lock.
  std::uint64_t revision() const { return arrived_.load(std::memory_order_acquire); }
  std::uint64_t pending() const { return worker_.pending(); }
  /// Number of tables in memory, and their size.
  std::uint64_t count() const;
  std::uint64_t bytes() const { return bytes_; }

 private:
  class Entry;
  Entry* find_entry(std::uint64_t hash, const SceneRobot& robot, const Body& a, const Body& b) const;
  void add(TablePair pair, const Body& a, const Body& b, const TaskOwner& owner,
           std::vector<std::shared_ptr<BackgroundTask>>& tasks);

  const Cache cache_ = Cache::of_environment();
  std::atomic<std::uint64_t> arrived_{0}, bytes_{0};
  std::mutex requests_;       // held until the tasks of a request wait in the worker
  mutable std::mutex mutex_;  // guards the entries
  std::unordered_multimap<std::uint64_t, std::shared_ptr<Entry>> entries_;
  BackgroundWorker worker_;  // stops before the entries end
};

}  // namespace clearance
