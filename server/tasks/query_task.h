// A query under way: the engine's job and the reply that it becomes.
//
// It alternates between two threads. A worker does what may take long: it parses the request, lists the pairs and runs
// the job (advance()). The loop does what needs the daemon's state: it takes quota and memory, and sends the reply
// (advance_on_loop()). Step has the order.
#pragma once

#include <atomic>
#include <functional>
#include <optional>

#include "server/limits/forecast.h"
#include "server/requests/pending_request.h"
#include "server/requests/reply_writer.h"
#include "server/tasks/query_input.h"
#include "server/tasks/query_reply.h"
#include "server/tasks/scheduler.h"

namespace clearance {

class QueryTask final : public ScheduledQuery {
 public:
  /// Parts of the daemon, which outlive this.
  struct Daemon {
    ReplyWriter& answers;
    Quotas& quotas;
    Stats& stats;
    const QueryLimits& limits;
    Forecast& forecast;
    std::function<void(std::shared_ptr<void>)> drop;  ///< frees on a worker
    /// Defers a query until its poses have arrived, and takes the sink. Returns false if they have. Throws
    /// RejectedRequest.
    std::function<bool(const wire::FrameHeader&, ServiceClass, const QueryOptions&, const OwnPayload&,
                       std::unique_ptr<ReplySink>&, Clock::time_point received)>
        hold;
  };

  /// @param engine for this query, even if another one has replaced it in the daemon before the query ends
  QueryTask(const Daemon& daemon, std::uint64_t client, ServiceClass service, const wire::FrameHeader& request,
            std::shared_ptr<engine::Engine> engine, Clock::time_point received, Clock::time_point due)
      : ScheduledQuery(client, service, due),
        daemon_(daemon),
        pending_{nullptr, request, {}},
        engine_(std::move(engine)),
        received_(received) {}

  /// Sets the deadline if the options are known before the query begins. Throws RejectedRequest (kDeadline) if it
  /// cannot be met.
  void take_options(const QueryOptions& options, const QueryCost& cost);
  /// Begins a small query on the loop, up to Step::kRun. Takes the sink unless it throws.
  /// @param jobs of the client's earlier queries with other configurations; may be null
  void begin_on_loop(const wire::QueryParts& parts, std::uint64_t payload_bytes, std::unique_ptr<ReplySink>& sink,
                     const std::shared_ptr<JobPool>& jobs);
  /// Takes a large query, whose payload a worker fetches. Throws RejectedRequest (kBusy).
  void begin_on_worker(std::function<OwnPayload()> fetch, std::uint64_t payload_bytes, std::uint64_t listed_pairs,
                       std::unique_ptr<ReplySink>& sink);

  bool is_wanted() const override { return on_loop_ ? pending_.sink->alive() : !gone_.load(std::memory_order_relaxed); }
  bool advance(std::chrono::nanoseconds budget, Clock::time_point& now) override;
  void free_memory() override;
  void check_client() override { gone_.store(is_ended_ || !pending_.sink->alive(), std::memory_order_relaxed); }
  Clock::time_point deadline() const override { return is_ended_ ? Clock::time_point::max() : deadline_; }
  void expire() override;
  bool advance_on_loop() override;
  /// Units of work so far.
  std::uint64_t units() const { return units_; }

 private:
  /// The steps in their order, with the thread of each. A small query begins at kRun, with a first slice on the loop.
  enum class Step {
    kRead,          ///< worker: parses the request
    kSetOptions,    ///< loop: sets the deadline, waits for poses. Then kRead again; skipped without such options
    kList,          ///< worker: lists the pairs
    kReserve,       ///< loop: takes quota and memory for the largest reply
    kRun,           ///< worker: runs the engine's job
    kReserveFinal,  ///< loop: takes memory for the rows that came back; only if kReserve could not have the sink's
    kCopy,          ///< worker: copies the reply into that memory
    kPublish,       ///< loop: sends the reply
    kOver,          ///< worker: frees the rest of a query that its client no longer needs
  };

  void work(std::chrono::nanoseconds budget);
  void work_on_loop();
  void read();
  void set_options();
  void prepare(const wire::QueryParts& parts, const std::shared_ptr<JobPool>& jobs = nullptr);
  void list(const WorkBudget& budget);
  void reserve(ReplySink& sink);
  void start();
  void run(std::chrono::nanoseconds budget);
  void reserve_final();
  void copy();
  void publish();
  void end();
  void reject(const RejectedRequest& failure);
  void check_deadline(Clock::time_point now) const;
  Forecast::Work cost_class() const { return Forecast::work_of(options_, cost_); }

  const Daemon& daemon_;
  PendingRequest pending_;
  std::shared_ptr<engine::Engine> engine_;
  Clock::time_point received_, worked_;  // end of the last slice
  std::chrono::nanoseconds in_engine_{0};
  Step step_ = Step::kRead;
  bool on_loop_ = false;
  bool has_options_ = false;  // kSetOptions is over
  bool is_ended_ = false;     // answered or dropped, while a worker may still have it
  Clock::time_point deadline_ = Clock::time_point::max();
  std::atomic<bool> gone_{false};
  std::optional<RejectedRequest> failure_;
  std::uint64_t payload_bytes_ = 0, units_ = 0;

  // Of the request. free_memory() frees large memory on the worker.
  std::function<OwnPayload()> fetch_;
  std::vector<std::uint64_t> aligned_;
  OwnPayload payload_;
  bool whole_table_ = false;
  QueryOptions options_;
  QueryCost cost_;
  std::optional<PreparedQuery> prepared_;
  std::optional<Job> job_;
  QueryReply reply_;
};

}  // namespace clearance
