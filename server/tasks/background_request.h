// A request other than a query that is too expensive for the loop. A worker makes the reply's payload and copies it.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <vector>

#include "server/requests/pending_request.h"
#include "server/requests/reply_writer.h"
#include "server/tasks/scheduler.h"

namespace clearance {

class BackgroundRequest final : public ScheduledQuery {
 public:
  /// Makes the reply's payload on a worker within about `budget`, or returns nothing if it needs another slice. Throws
  /// RejectedRequest.
  /// @param ignored count of the request's unknown records, to which it adds
  using Make =
      std::function<std::optional<std::vector<std::byte>>(std::chrono::nanoseconds budget, std::uint64_t& ignored)>;
  /// Called on the loop after Make. Returns false if Make must run again.
  /// @param made that it did not throw
  using Done = std::function<bool(bool made)>;
  /// The loop copies and sends the short reply of a light request. That of a heavy one is copied and freed on a worker.
  enum class Weight { kHeavy, kLight };

  BackgroundRequest(ReplyWriter& answers, PendingRequest pending, ServiceClass service, wire::FrameType type,
                    Clock::time_point received, Make make, Done done = nullptr, Weight weight = Weight::kHeavy)
      : ScheduledQuery(pending.sink->client(), service, received),
        answers_(answers),
        pending_(std::move(pending)),
        type_(type),
        make_(std::move(make)),
        done_(std::move(done)),
        weight_(weight) {}

  bool is_wanted() const override { return !gone_.load(std::memory_order_relaxed); }
  bool advance(std::chrono::nanoseconds budget, Clock::time_point& now) override;
  void free_memory() override;
  void check_client() override;
  bool advance_on_loop() override;

 private:
  enum class Step { kMake, kReserve, kCopy, kPublish, kOver };

  bool copy(Clock::time_point end);

  ReplyWriter& answers_;
  PendingRequest pending_;
  wire::FrameType type_;
  Make make_;
  Done done_;
  Weight weight_;
  Step step_ = Step::kMake;
  std::atomic<bool> gone_{false};
  std::optional<RejectedRequest> failure_;
  std::vector<std::byte> payload_;
  std::uint64_t payload_bytes_ = 0, copied_ = 0, ignored_ = 0;
  std::byte* frame_ = nullptr;
};

}  // namespace clearance
