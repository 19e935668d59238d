// Makes joint tables in the background and hands them out.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

#include "engine/cache/cache.h"
#include "engine/decision/background_worker.h"
#include "engine/decision/joint_table_maker.h"

namespace clearance {

/// Tables by robots, links and their parts, shared by engines. Thread-safe. They stay until the store is destroyed, and
/// are kept in the cache.
class JointTableStore {
 public:
  static constexpr std::size_t kMostOfRobot = 24;
  static constexpr std::size_t kMostTables = 192;  // about 70 MB

  /// Requests tables for the enabled pairs of links of each robot: of one joint before two, at most kMostOfRobot.
  void request(const engine::Scene& scene);
  /// The table of two links of a robot, or null while there is none.
  std::shared_ptr<const JointTable> find(const SceneRobot& robot, const Body& a, const Body& b) const;
  /// BackgroundWorker::wait().
  bool wait(std::chrono::nanoseconds timeout) { return worker_.wait(timeout); }
  /// Increases whenever a table arrives. Takes no lock.
  std::uint64_t revision() const { return made_.load(std::memory_order_acquire); }

 private:
  class Entry;
  const Entry* find_entry(std::uint64_t hash, const SceneRobot& robot, const Body& a, const Body& b) const;
  void add(TablePair pair, const Body& a, const Body& b, std::vector<BackgroundTask*>& tasks);

  const Cache cache_ = Cache::of_environment();
  std::atomic<std::uint64_t> made_{0};
  mutable std::mutex mutex_;  // guards the entries, of which none is removed
  std::unordered_multimap<std::uint64_t, std::shared_ptr<Entry>> entries_;
  BackgroundWorker worker_;  // stops before the entries end
};

}  // namespace clearance
