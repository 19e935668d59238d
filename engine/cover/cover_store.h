// Makes covers of bodies in the background and hands them out.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/cover/cover.h"
#include "engine/cover/obstacle_shapes.h"

namespace clearance {

/// Covers by their bodies' parts, shared by engines. Thread-safe. A thread of lowest priority makes them one by one and
/// exists only while some are pending. They stay until the store is destroyed, and are kept in the cache.
class CoverStore {
 public:
  using Parts = std::vector<ConvexPartPtr>;
  static constexpr std::uint64_t kMostBytes = std::uint64_t{256} << 20;

  struct Progress {
    std::uint64_t made = 0, pending = 0;
    std::uint64_t impossible = 0;  ///< without a cover, because making it failed or the store is full
    std::uint64_t bytes = 0;       ///< of all covers
    double seconds = 0;            ///< spent on making and reading covers
  };

  /// \param most_bytes of all covers; a store that holds more makes no further ones
  explicit CoverStore(std::uint64_t most_bytes = kMostBytes);
  /// Stops the thread. Frees nothing in a child after fork(), which has no such thread.
  ~CoverStore();
  CoverStore(const CoverStore&) = delete;
  CoverStore& operator=(const CoverStore&) = delete;

  /// The cover of a body, or null while there is none. Takes no lock.
  std::shared_ptr<const Cover> find(std::span<const ConvexPartPtr> parts) const;
  /// Requests covers, the most important ones first. Skips bodies that were requested before or cannot have one.
  void request(std::vector<Parts> bodies);
  /// Waits until nothing is pending, and returns whether that is so. Makes covers on the calling thread meanwhile, since
  /// a thread of lowest priority may get no time; so it may take a body longer than the timeout.
  bool wait(std::chrono::nanoseconds timeout);
  /// Takes no lock.
  Progress progress() const;
  /// Shapes of the obstacles that covers are compared with.
  ObstacleShapes& obstacle_shapes() const { return *obstacle_shapes_; }
  /// Increases whenever a cover arrives. Takes no lock.
  std::uint64_t revision() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
  std::unique_ptr<ObstacleShapes> obstacle_shapes_ = std::make_unique<ObstacleShapes>();
  pid_t process_;
};

}  // namespace clearance
