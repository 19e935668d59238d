// A query under way, as its caller sees it.
#pragma once

#include <chrono>
#include <memory>
#include <span>

#include "engine/query/query.h"

namespace clearance {

class Engine;

/// A query under way. Holds the snapshot it began with; the columns it writes belong to the caller and must outlive it.
class Job {
 public:
  Job(Job&&) noexcept;
  Job& operator=(Job&&) noexcept;
  ~Job();

  /// Works for about `budget` (one slice of work at least). Returns true once the answer is whole.
  bool advance(std::chrono::nanoseconds budget = std::chrono::nanoseconds::max());

  /// Whether this job and `other`, of the same engine and neither of them begun, are small and ask the same of their
  /// pairs, so that finish_together() may answer both.
  bool joins(const Job& other) const;
  /// Completes jobs that all join the first one, as one batch: pairs of one fill the lanes that another would leave
  /// idle. Each gets the bits that it gets alone. If it throws, none has begun, and each may still be advanced by
  /// itself.
  static void finish_together(std::span<Job* const> jobs);

  const QuerySize& size() const;
  /// Valid once advance() returned true.
  const ReplyInfo& info() const;

  struct State;

 private:
  friend class Engine;
  explicit Job(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace clearance
