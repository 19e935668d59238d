// Makes covers of bodies in the background and hands them out.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <unordered_map>
#include <vector>

#include "engine/cache/background_worker.h"
#include "engine/cache/cache.h"
#include "engine/cover/cover.h"
#include "engine/cover/obstacle_shapes.h"

namespace clearance {

/// Covers by their bodies' parts, shared by engines. Thread-safe.
class CoverStore {
 public:
  using Parts = std::vector<ConvexPartPtr>;
  static constexpr std::uint64_t kMostBytes = std::uint64_t{256} << 20;

  struct Progress {
    std::uint64_t made = 0;  ///< covers in memory
    std::uint64_t pending = 0;
    std::uint64_t impossible = 0;  ///< without a cover, because making it failed or the store is full
    std::uint64_t bytes = 0;       ///< of all covers
    double seconds = 0;            ///< spent on making and reading covers
  };

  /// \param most_bytes of all covers; a store that holds more makes no further ones
  explicit CoverStore(std::uint64_t most_bytes = kMostBytes) : most_bytes_(most_bytes) {}
  CoverStore(const CoverStore&) = delete;
  CoverStore& operator=(const CoverStore&) = delete;

  /// The cover of a body, or null while there is none.
  std::shared_ptr<const Cover> find(std::span<const ConvexPartPtr> parts) const;
  /// Requests covers, the most important ones first. Skips bodies that were requested before or cannot have one, and
  /// drops covers whose owners are gone.
  /// \param in_cache whether new ones are read from the cache and kept there
  void request(std::vector<Parts> bodies, const TaskOwner& owner = {}, bool in_cache = true);
  /// BackgroundWorker::wait().
  bool wait(std::chrono::nanoseconds timeout) { return worker_.wait(timeout); }
  /// Takes no lock.
  Progress progress() const;
  /// Shapes of the obstacles that covers are compared with.
  ObstacleShapes& obstacle_shapes() const { return *obstacle_shapes_; }
  /// Increases whenever a cover arrives. Takes no lock.
  std::uint64_t revision() const { return arrived_.load(std::memory_order_acquire); }

 private:
  class Entry;
  Entry* find_entry(std::uint64_t hash, std::span<const ConvexPartPtr> parts) const;

  const std::uint64_t most_bytes_;
  const Cache cache_ = Cache::of_environment(), no_cache_ = Cache::none();
  std::atomic<std::uint64_t> arrived_{0}, made_{0}, impossible_{0}, bytes_{0};
  std::atomic<std::chrono::nanoseconds> spent_{};
  std::mutex requests_;       // held until the tasks of a request wait in the worker
  mutable std::mutex mutex_;  // guards the entries
  std::unordered_multimap<std::uint64_t, std::shared_ptr<Entry>> entries_;
  std::unique_ptr<ObstacleShapes> obstacle_shapes_ = std::make_unique<ObstacleShapes>();
  BackgroundWorker worker_;  // stops before the entries end
};

}  // namespace clearance
