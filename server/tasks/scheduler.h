// Order of queries. They run in short slices, so that a small query never waits behind a large one: each new query gets
// its first slice before others get a further one, clients taking turns. A query that needs more slices goes behind
// those of its kind, and is served in between however many new ones come. The class control goes first, and leaves the
// other class a slice now and then.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "server/base/fair_queue.h"
#include "server/base/service_class.h"

namespace clearance {

/// A query under way.
class ScheduledQuery {
 public:
  using Clock = std::chrono::steady_clock;

  virtual ~ScheduledQuery() = default;

  // On a worker's thread.
  /// Whether its client still needs the reply.
  virtual bool is_wanted() const = 0;
  /// Works for about `budget`. Returns true if the loop must continue. Does not throw.
  /// @param now the time, updated to the end of the work
  virtual bool advance(std::chrono::nanoseconds budget, Clock::time_point& now) = 0;
  /// Frees large memory of a query that is no longer needed.
  virtual void free_memory() {}

  // On the loop's thread.
  /// Checks whether its client is still connected.
  virtual void check_client() {}
  /// Time after which the reply is useless.
  virtual Clock::time_point deadline() const { return Clock::time_point::max(); }
  /// Rejects it after its deadline, if a worker that may have it allows that.
  virtual void expire() {}
  /// Does the loop's part, after advance() has returned true. Returns true if the query is over. Does not throw.
  virtual bool advance_on_loop() { return true; }

  std::uint64_t client() const { return client_; }
  ServiceClass service_class() const { return service_; }
  /// Orders one client's queries, the earliest first.
  Clock::time_point due() const { return due_; }

 protected:
  ScheduledQuery(std::uint64_t client, ServiceClass service, Clock::time_point due)
      : client_(client), service_(service), due_(due) {}

 private:
  std::uint64_t client_;
  ServiceClass service_;
  Clock::time_point due_;
};

/// Owns the queries under way. Independent of clocks and of the queries' content.
class Scheduler {
 public:
  using Clock = ScheduledQuery::Clock;
  using QueryPtr = std::unique_ptr<ScheduledQuery>;

  /// @param slice of one query, before the others get a turn
  explicit Scheduler(std::chrono::nanoseconds slice) : slice_(slice) {}

  void add(QueryPtr query);
  bool empty() const { return control_.empty() && planning_.empty(); }
  std::size_t size() const { return control_.size() + planning_.size(); }
  /// Takes queries for which the loop must continue, and those no longer needed.
  using Over = std::function<void(QueryPtr)>;
  /// Works on queries until about a slice has passed since `now`, on at least one if there is any.
  void work(Clock::time_point now, const Over& over);

 private:
  struct DueFirst {
    bool operator()(const QueryPtr& a, const QueryPtr& b) const { return a->due() < b->due(); }
  };
  /// Queues of one class.
  struct Queues {
    FairQueue<QueryPtr, DueFirst> fresh, begun;  // before their first slice, and after it
    int fresh_in_a_row = 0;

    bool empty() const { return fresh.empty() && begun.empty(); }
    std::size_t size() const { return fresh.size() + begun.size(); }
    QueryPtr next();
  };
  Queues& of(ServiceClass service) { return service == ServiceClass::kControl ? control_ : planning_; }
  QueryPtr next();

  std::chrono::nanoseconds slice_;
  Queues control_, planning_;
  int control_in_a_row_ = 0;
};

}  // namespace clearance
