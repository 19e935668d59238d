// A query under way, as its caller sees it.
#pragma once

#include <chrono>
#include <memory>

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
