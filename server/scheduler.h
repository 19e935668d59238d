// Whose turn it is. Queries are worked on in short slices, so that a small one never waits behind a large one: each new
// query gets its first slice before those that have had one already go on, the clients taking turns. A query that needs
// more slices goes behind the others of its kind, and is not forgotten however many new ones come.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "fair_queue.h"

namespace clearance {

/// A query under way, as the scheduler sees it.
class ScheduledQuery {
 public:
  using Clock = std::chrono::steady_clock;

  virtual ~ScheduledQuery() = default;
  /// Whether its client is still there.
  virtual bool is_wanted() const = 0;
  /// Works for about `budget`. Returns true once it is over, answered or refused. Does not throw.
  /// \param now the time; it is then the time at which the work ended.
  virtual bool advance(std::chrono::nanoseconds budget, Clock::time_point& now) = 0;

  std::uint64_t client() const { return client_; }
  /// Orders one client's queries: the one that should be over first goes first.
  Clock::time_point due() const { return due_; }

 protected:
  ScheduledQuery(std::uint64_t client, Clock::time_point due) : client_(client), due_(due) {}

 private:
  std::uint64_t client_;
  Clock::time_point due_;
};

/// Owns the queries under way. Knows no clock but the one that it is told, and nothing of what queries ask.
class Scheduler {
 public:
  using Clock = ScheduledQuery::Clock;
  using QueryPtr = std::unique_ptr<ScheduledQuery>;

  /// \param slice of one query, before the others get a turn.
  explicit Scheduler(std::chrono::nanoseconds slice) : slice_(slice) {}

  void add(QueryPtr query);
  bool empty() const { return fresh_.empty() && long_.empty(); }
  std::size_t size() const { return fresh_.size() + long_.size(); }
  /// Works on one query after another until about a slice has passed since `now`; on one, if there is any. Those that
  /// nobody wants any more are let go of. Returns how many these were.
  std::size_t work(Clock::time_point now);
  /// Lets go of all that nobody wants any more. Returns how many these were.
  std::size_t drop_unwanted();

 private:
  QueryPtr next();

  struct DueFirst {
    bool operator()(const QueryPtr& a, const QueryPtr& b) const { return a->due() < b->due(); }
  };
  std::chrono::nanoseconds slice_;
  FairQueue<QueryPtr, DueFirst> fresh_, long_;  // before their first slice, and after it
  int fresh_in_a_row_ = 0;
};

}  // namespace clearance
