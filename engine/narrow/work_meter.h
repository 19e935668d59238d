// Measures and limits the work of an answer, so that other requests get their turn.
//
// A unit is a pair of convex parts in lanes, or a support evaluation of a pair that is answered alone, for parts of up
// to 64 vertices; larger parts cost more. Other work that grows with a request counts, too: sixteen compared boxes are
// one unit. A unit takes some tenths of a microsecond.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "engine/hull/convex_part.h"

namespace clearance {

/// Units of work that this thread has done or waited for so far. Serves to check threads that must not do much.
inline thread_local std::uint64_t units_of_this_thread = 0;
/// Counts copied bytes.
inline void count_copied(std::uint64_t bytes) {
  units_of_this_thread += bytes / 1024;
}

/// Budget of one slice. Both limits are checked between pairs of parts, the clock after some units.
struct WorkBudget {
  static constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};

  std::chrono::nanoseconds time = std::chrono::nanoseconds::max();
  std::uint64_t units = kNoLimit;
  /// Maximum for one pair of parts. A pair that needs more is abandoned, and restarted in the next slice; one whose
  /// slice ends within EPA is resumed there.
  std::uint64_t pair_units = kNoLimit;
};

class WorkMeter {
 public:
  using Clock = std::chrono::steady_clock;
  /// Thrown within a pair of parts that exceeds its maximum, or whose slice has ended.
  struct PairUnfinished {};

  WorkMeter() = default;  ///< without limits
  explicit WorkMeter(const WorkBudget& budget)
      : budget_(budget),
        deadline_(budget.time == std::chrono::nanoseconds::max() ? Clock::time_point::max()
                                                                 : Clock::now() + budget.time) {}

  /// A meter for another thread, with the rest of the same slice.
  WorkMeter share() const {
    WorkMeter other(*this);
    other.spent_ = 0;
    other.next_look_ = kUnitsPerLook;
    if (budget_.units != WorkBudget::kNoLimit) other.budget_.units -= std::min(budget_.units, spent_);
    return other;
  }
  /// The same, for at most `time` of it.
  WorkMeter share(std::chrono::nanoseconds time) const {
    WorkMeter other = share();
    other.deadline_ = std::min(deadline_, Clock::now() + time);
    return other;
  }
  /// The rest of the slice, for code with its own meter whose work is then counted here.
  WorkBudget left() const {
    WorkBudget left = budget_;
    if (budget_.units != WorkBudget::kNoLimit) left.units -= std::min(budget_.units, spent_);
    if (deadline_ != Clock::time_point::max())
      left.time = std::max(std::chrono::nanoseconds(deadline_ - Clock::now()), std::chrono::nanoseconds(0));
    return left;
  }
  /// Counts work on many pairs.
  void count(std::uint64_t units) { spent_ += units; }
  /// Begins a pair of parts that is answered alone.
  void begin_pair() {
    pair_end_ = budget_.pair_units < WorkBudget::kNoLimit - spent_ ? spent_ + budget_.pair_units : WorkBudget::kNoLimit;
  }
  /// Counts work on that pair. Throws PairUnfinished.
  void spend(std::uint64_t units) {
    spent_ += units;
    if (spent_ > pair_end_) throw PairUnfinished();
  }
  /// Whether the slice is over.
  bool is_over() {
    if (spent_ >= budget_.units) return true;
    if (deadline_ == Clock::time_point::max() || (spent_ < next_look_ && !late_)) return false;
    next_look_ = spent_ + kUnitsPerLook;
    late_ = late_ || Clock::now() >= deadline_;
    return late_;
  }
  std::uint64_t spent() const { return spent_; }

  /// Units of a support of one part, and of both parts.
  static std::uint64_t units_of(const ConvexPart& part) {
    return part.table ? kUnitsOfATable : (part.vertices.size() + kVerticesPerUnit - 1) / kVerticesPerUnit;
  }
  static std::uint64_t units_of(const ConvexPart& a, const ConvexPart& b) { return units_of(a) + units_of(b); }

 private:
  static constexpr std::uint64_t kUnitsPerLook = 32;  // between two readings of the clock
  static constexpr std::uint64_t kVerticesPerUnit = 64, kUnitsOfATable = 8;

  WorkBudget budget_;
  Clock::time_point deadline_ = Clock::time_point::max();
  std::uint64_t spent_ = 0, next_look_ = kUnitsPerLook, pair_end_ = WorkBudget::kNoLimit;
  bool late_ = false;
};

}  // namespace clearance
