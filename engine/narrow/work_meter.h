// How much work an answer has taken, and how much it may take before others have their turn.
//
// A unit is a pair of pieces in lanes, or a support evaluation of one that is answered alone, for pieces of up to 64
// vertices; larger pieces count for more. So is what else grows with a request: sixteen boxes that are compared are a
// unit, too. A unit takes some tenths of a microsecond.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>

#include "engine/hull/piece.h"

namespace clearance {

/// Units of work that this thread has done so far, or has waited for: so a thread that must never do much is watched.
inline thread_local std::uint64_t units_of_this_thread = 0;
/// Bytes that are copied count, too.
inline void count_copied(std::uint64_t bytes) {
  units_of_this_thread += bytes / 1024;
}

/// What one slice may take. Both are looked at between pairs of pieces, the clock after some units.
struct WorkBudget {
  static constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};

  std::chrono::nanoseconds time = std::chrono::nanoseconds::max();
  std::uint64_t units = kNoLimit;
  /// The most for one pair of pieces: one that needs more is given up, and begun anew in the next slice (one whose
  /// slice ends within EPA goes on there).
  std::uint64_t pair_units = kNoLimit;
};

class WorkMeter {
 public:
  using Clock = std::chrono::steady_clock;
  /// Thrown out of a pair of pieces that needs more than one may take, or in which the slice has ended.
  struct PairUnfinished {};

  WorkMeter() = default;  ///< without limits
  explicit WorkMeter(const WorkBudget& budget)
      : budget_(budget),
        deadline_(budget.time == std::chrono::nanoseconds::max() ? Clock::time_point::max()
                                                                 : Clock::now() + budget.time) {}

  /// Another thread's, of the same slice, for what is left of it.
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
  /// What is left of the slice, for somebody who meters himself and whose work is then counted here.
  WorkBudget left() const {
    WorkBudget left = budget_;
    if (budget_.units != WorkBudget::kNoLimit) left.units -= std::min(budget_.units, spent_);
    if (deadline_ != Clock::time_point::max())
      left.time = std::max(std::chrono::nanoseconds(deadline_ - Clock::now()), std::chrono::nanoseconds(0));
    return left;
  }
  /// Counts work on many pairs.
  void count(std::uint64_t units) { spent_ += units; }
  /// A pair of pieces begins that is answered alone.
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

  /// What a support of a piece counts, and one of both.
  static std::uint64_t units_of(const Piece& piece) {
    return piece.table ? kUnitsOfATable : (piece.vertices.size() + kVerticesPerUnit - 1) / kVerticesPerUnit;
  }
  static std::uint64_t units_of(const Piece& a, const Piece& b) { return units_of(a) + units_of(b); }

 private:
  static constexpr std::uint64_t kUnitsPerLook = 32;  // at the clock
  static constexpr std::uint64_t kVerticesPerUnit = 64, kUnitsOfATable = 8;

  WorkBudget budget_;
  Clock::time_point deadline_ = Clock::time_point::max();
  std::uint64_t spent_ = 0, next_look_ = kUnitsPerLook, pair_end_ = WorkBudget::kNoLimit;
  bool late_ = false;
};

}  // namespace clearance
