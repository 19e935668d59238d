// Runs numbered units of work on one thread or a team, in slices.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

#include "engine/narrow/work_meter.h"

namespace clearance {

/// Distributes units over workers. A worker is a thread's state, so a unit interrupted at the end of a slice is resumed
/// by the same worker.
class UnitRunner {
 public:
  /// Runs unit `i`. Returns false if the slice ended within it.
  using Unit = std::function<bool(std::uint64_t i, int worker, WorkMeter& meter)>;

  /// \param teams counts the teams of threads that were started; may be null
  UnitRunner(int workers, std::atomic<std::uint64_t>* teams)
      : interrupted_(static_cast<std::size_t>(workers), kNone64), teams_(teams) {}
  int workers() const { return static_cast<int>(interrupted_.size()); }

  /// Runs units [next, count). Returns true once all are done, or false at the end of the slice, with `next` advanced.
  /// \param alone on the calling thread only; otherwise a team takes over work that is worth it (team_cost.h)
  bool run(std::uint64_t& next, std::uint64_t count, WorkMeter& slice, const Unit& unit, bool alone);

 private:
  class Pass;
  static constexpr std::uint64_t kNone64 = ~std::uint64_t{0};

  std::vector<std::uint64_t> interrupted_;  // unit to resume, by worker, or kNone64
  std::atomic<std::uint64_t>* teams_;
};

}  // namespace clearance
