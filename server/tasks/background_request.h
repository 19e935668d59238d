// A request that is no query, but too dear for the loop: whoever works makes the reply's payload, and copies it.
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
  /// Reads the request and makes the reply's payload within about `budget`; throws what it is refused for. None: it
  /// wants to be called once more. On the thread that works.
  using Make = std::function<std::optional<std::vector<std::byte>>(std::chrono::nanoseconds budget)>;
  /// Called on the loop once make() has ended. \param made it did not throw. Returns false where it must be called once
  /// more.
  using Done = std::function<bool(bool made)>;
  /// kLight: the reply is short and what make() holds is freed at once, so that the loop sends it as soon as it is
  /// made.
  enum class Weight { kHeavy, kLight };

  BackgroundRequest(ReplyWriter& answers, PendingRequest asked, ServiceClass service, wire::FrameType type,
                    Clock::time_point received, Make make, Done done = nullptr, Weight weight = Weight::kHeavy)
      : ScheduledQuery(asked.sink->client(), service, received),
        answers_(answers),
        asked_(std::move(asked)),
        type_(type),
        make_(std::move(make)),
        done_(std::move(done)),
        weight_(weight) {}

  bool is_wanted() const override { return !gone_.load(std::memory_order_relaxed); }
  bool advance(std::chrono::nanoseconds budget, Clock::time_point& now) override;
  void let_go() override;
  void look() override;
  bool settle() override;

 private:
  enum class Step { kMake, kRoom, kCopy, kPublish, kOver };

  bool copy(Clock::time_point end);

  ReplyWriter& answers_;
  PendingRequest asked_;
  wire::FrameType type_;
  Make make_;
  Done done_;
  Weight weight_;
  Step step_ = Step::kMake;
  std::atomic<bool> gone_{false};
  std::optional<RejectedRequest> failure_;
  std::vector<std::byte> payload_;
  std::uint64_t payload_bytes_ = 0, copied_ = 0;
  std::byte* frame_ = nullptr;
};

}  // namespace clearance
