// Whose turn it is. Queries are worked on in short slices, so that a small one never waits behind a large one: each new
// query gets its first slice before those that have had one already go on, the clients taking turns. A query that needs
// more slices goes behind the others of its kind, and is not forgotten however many new ones come. Those of the class
// control come before all of that, and leave the others a slice now and then.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "server/base/fair_queue.h"
#include "server/base/service_class.h"

namespace clearance {

/// A query under way, as the scheduler sees it.
class ScheduledQuery {
 public:
  using Clock = std::chrono::steady_clock;

  virtual ~ScheduledQuery() = default;

  // On the thread that works.
  /// Whether anybody waits for it.
  virtual bool is_wanted() const = 0;
  /// Works for about `budget`. Returns true where the loop is needed. Does not throw.
  /// \param now the time; it is then the time at which the work ended.
  virtual bool advance(std::chrono::nanoseconds budget, Clock::time_point& now) = 0;
  /// Frees what takes long to free. Nobody wants it any more.
  virtual void let_go() {}

  // On the loop's.
  /// Looks whether its client is still there.
  virtual void look() {}
  /// When nobody needs its answer any more.
  virtual Clock::time_point deadline() const { return Clock::time_point::max(); }
  /// Refuses it, where that is possible while somebody may work on it: its deadline has passed.
  virtual void expire() {}
  /// Does what only the loop may, after advance() has returned true. Returns true once it is over, answered, refused or
  /// unwanted. Does not throw.
  virtual bool settle() { return true; }

  std::uint64_t client() const { return client_; }
  ServiceClass service_class() const { return service_; }
  /// Orders one client's queries: the one that should be over first goes first.
  Clock::time_point due() const { return due_; }

 protected:
  ScheduledQuery(std::uint64_t client, ServiceClass service, Clock::time_point due)
      : client_(client), service_(service), due_(due) {}
  void set_service_class(ServiceClass service) { service_ = service; }

 private:
  std::uint64_t client_;
  ServiceClass service_;
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
  bool empty() const { return control_.empty() && planning_.empty(); }
  std::size_t size() const { return control_.size() + planning_.size(); }
  /// Takes those for which the loop is needed, and those that nobody wants any more.
  using Over = std::function<void(QueryPtr)>;
  /// Works on one query after another until about a slice has passed since `now`; on one, if there is any.
  void work(Clock::time_point now, const Over& over);

 private:
  struct DueFirst {
    bool operator()(const QueryPtr& a, const QueryPtr& b) const { return a->due() < b->due(); }
  };
  /// Of one class.
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
