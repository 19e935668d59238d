// A query under way: the engine's job, and the reply that it becomes.
//
// It goes back and forth between two threads. What may take long is done by whoever works (advance()): the request is
// read and checked, its pairs are listed, the job runs, its reply is put in order. What needs the daemon's state, the
// loop does (settle()): room for the reply, and its publication.
#pragma once

#include <atomic>
#include <functional>
#include <optional>

#include "server/limits/forecast.h"
#include "server/requests/pending_request.h"
#include "server/requests/reply_writer.h"
#include "server/tasks/scheduler.h"
#include "wire/aligned_buffer.h"
#include "wire/wire.h"

namespace clearance {

/// Where the columns of a reply begin in its frame.
inline constexpr std::uint64_t kColumnsBegin = sizeof(wire::FrameHeader) + sizeof(wire::ReplyHeader);
static_assert(kColumnsBegin % wire::kColumnAlignment == 0);

/// The engine's view of a query whose payload begins on a multiple of 8.
QueryView view_of(const wire::QueryParts& parts, std::uint64_t scene_revision);

/// A payload whose first byte lies on a multiple of 8: this one, or a copy in `room`.
std::span<const std::byte> aligned(std::span<const std::byte> payload, std::vector<std::uint64_t>& room);

class QueryTask final : public ScheduledQuery {
 public:
  /// What one query may ask for.
  struct Limits {
    std::uint64_t max_pairs = 10'000'000'000;            ///< pairs times configurations; more: kTooLarge
    std::uint64_t max_piece_pairs = 10'000'000'000'000;  ///< pairs of pieces, likewise
    /// Of the one slice that the loop itself gives. Work, not time, so that what the machine does beside decides
    /// nothing.
    WorkBudget on_loop{.units = 4096, .pair_units = 1024};
    /// The same, of a query that others of the class control must not wait for.
    WorkBudget on_loop_beside_control{.units = 512, .pair_units = 256};
    bool has_control = false;  ///< anybody may have that class

    /// Throw a Refusal (kTooLarge): before pairs are listed, and once they are.
    void check(const QueryCost& extent) const;
    void check(const QuerySize& size) const;
  };
  /// What it uses of the daemon; all of it outlives this.
  struct Daemon {
    ReplyWriter& answers;
    Quotas& quotas;
    Stats& stats;
    const Limits& limits;
    Forecast& forecast;
    std::function<void(std::shared_ptr<void>)> drop;  ///< lets go of what takes long to free, elsewhere
    /// Holds a query until its poses are there, and takes the sink; false: they are. Throws a Refusal.
    std::function<bool(const wire::FrameHeader&, ServiceClass, const QueryOptions&, const OwnPayload&,
                       std::unique_ptr<ReplySink>&, Clock::time_point received)>
        hold;
  };

  /// \param received when the request came. \param engine that answers, though another one may serve by the time that
  /// this ends.
  QueryTask(const Daemon& daemon, std::uint64_t client, ServiceClass service, const wire::FrameHeader& request,
            std::shared_ptr<Engine> engine, Clock::time_point received, Clock::time_point due)
      : ScheduledQuery(client, service, due),
        daemon_(daemon),
        asked_{nullptr, request, {}},
        engine_(std::move(engine)),
        received_(received) {}

  /// What its options ask of the loop, where they are known before it begins: its deadline. Throws a Refusal
  /// (kDeadline) if there is no keeping it.
  void take_options(const QueryOptions& options, const QueryCost& extent);
  /// A small query, up to its job: on the loop, while its payload is there. Throws what it is refused for, and takes
  /// the sink if it is not.
  void begin_here(const wire::QueryParts& parts, std::uint64_t payload_bytes, std::unique_ptr<ReplySink>& sink);
  /// A large one, whose payload is brought by whoever works. Throws a Refusal (kBusy).
  void begin_elsewhere(std::function<OwnPayload()> fetch, std::uint64_t payload_bytes, std::uint64_t listed_pairs,
                       std::unique_ptr<ReplySink>& sink);

  bool is_wanted() const override { return on_loop_ ? asked_.sink->alive() : !gone_.load(std::memory_order_relaxed); }
  bool advance(std::chrono::nanoseconds budget, Clock::time_point& now) override;
  void let_go() override;
  void look() override { gone_.store(is_ended_ || !asked_.sink->alive(), std::memory_order_relaxed); }
  Clock::time_point deadline() const override { return is_ended_ ? Clock::time_point::max() : deadline_; }
  void expire() override;
  bool settle() override;
  /// Units of work so far.
  std::uint64_t units() const { return units_; }

 private:
  enum class Step { kPrepare, kOptions, kList, kRoom, kRun, kFinalRoom, kCopy, kPublish, kOver };

  void read();
  void settle_options();
  void end();
  void check_deadline(Clock::time_point now) const;
  void prepare(const wire::QueryParts& parts);
  void list(const WorkBudget& budget);
  void take_room(ReplySink& sink);
  void start();
  void run(std::chrono::nanoseconds budget);
  void take_final_room();
  void publish();
  wire::ReplyHeader reply_header() const;
  std::uint64_t columns_end() const {
    return kColumnsBegin + wire::columns_bytes(info_.rows, size_.fields, size_.joints);
  }

  const Daemon& daemon_;
  PendingRequest asked_;
  std::shared_ptr<Engine> engine_;
  Clock::time_point received_, worked_;  // until when it was worked on
  std::chrono::nanoseconds in_engine_{0};
  Step step_ = Step::kPrepare;
  bool on_loop_ = false;
  bool options_settled_ = false;  // with the loop: class, deadline, poses to wait for
  bool is_ended_ = false;         // for its client, while somebody may still work on it
  Clock::time_point deadline_ = Clock::time_point::max();
  std::atomic<bool> gone_{false};
  std::optional<RejectedRequest> failure_;
  std::uint64_t payload_bytes_ = 0, units_ = 0;

  // Of the query. The memory of what is large is given back by whoever works.
  std::function<OwnPayload()> fetch_;
  std::vector<std::uint64_t> aligned_;
  OwnPayload payload_;
  bool whole_table_ = false, wants_warm_ = false;
  Reduce reduce_ = Reduce::kNone;
  Format format_ = Format::kFull;
  QueryOptions options_;
  QueryCost extent_;
  std::vector<std::byte> records_;  // of the reply, behind its columns
  std::optional<PreparedQuery> prepared_;
  std::optional<Job> job_;

  // Of the reply.
  QuerySize size_;
  ReplyInfo info_;
  std::byte* frame_ = nullptr;  // the sink's, or own_
  AlignedBytes own_;            // where the sink has no room for so many rows, and far fewer may come back
};

}  // namespace clearance
