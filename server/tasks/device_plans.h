// Plans that clients have open, by their numbers: whose they are, whether one runs, and whether its client is still
// there.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "server/limits/resource_quota.h"
#include "server/requests/reply_writer.h"
#include "server/requests/transport.h"
#include "server/tasks/shared_plan.h"

namespace clearance {

/// Of the loop's thread.
class DevicePlans {
 public:
  struct Limits {
    std::uint32_t max_plans_of_client = 8;                            ///< 0 if no plans may be opened
    std::uint32_t max_plans = 64;                                     ///< of all clients
    std::uint64_t max_plan_bytes_of_client = std::uint64_t{2} << 30;  ///< kTooLarge beyond it
    std::uint64_t max_plan_bytes = std::uint64_t{8} << 30;            ///< of all clients, kBusy beyond it
  };
  struct Open {
    std::uint64_t client = 0;
    std::function<bool()> is_there;  ///< ReplySink::watch()
    std::shared_ptr<SharedPlan> plan;
    bool is_running = false;
  };

  explicit DevicePlans(const Limits& limits);

  /// Counts a plan that is being opened. Throws RejectedRequest beyond a limit.
  [[nodiscard]] PlanShare begin(std::uint64_t client);
  /// A number that no other plan has had.
  std::uint64_t next_number() { return ++last_; }
  void add(std::uint64_t number, Open open) { plans_.emplace(number, std::move(open)); }
  /// Throws a Refusal (kBadQuery) unless the client has it open.
  Open& find(std::uint64_t client, std::uint64_t number);
  /// Says that a run is over; the plan may be gone.
  void end_run(std::uint64_t number);
  /// Throws as find(). What runs goes on to its end, and the memory with it.
  void close(std::uint64_t client, std::uint64_t number);
  /// Closes those whose clients are gone. Returns how many these were.
  std::size_t drop_gone();
  void clear() { plans_.clear(); }
  std::uint64_t count() const { return count_.total(); }
  std::uint64_t bytes() const { return bytes_.total(); }

 private:
  const bool is_allowed_;
  ResourceQuota count_, bytes_;  // plans are made and freed on threads of their own
  std::map<std::uint64_t, Open> plans_;
  std::uint64_t last_ = 0;
};

/// Reads a kOpenPlan and makes the plan. On the thread that works.
class PlanOpening {
 public:
  /// \param answers, limits must outlive this. \param fetch brings the request's payload. \param free has a plan freed
  /// where that holds up nobody; from any thread
  PlanOpening(const ReplyWriter& answers, const QueryLimits& limits, std::shared_ptr<const Engine> engine,
              const wire::FrameHeader& request, std::function<OwnPayload()> fetch, PlanShare share,
              std::function<void(std::shared_ptr<void>)> free)
      : answers_(answers),
        limits_(limits),
        engine_(std::move(engine)),
        request_(request),
        fetch_(std::move(fetch)),
        share_(std::move(share)),
        free_(std::move(free)) {}

  /// The payload of kPlan. Throws what the request is refused for. \param number the plan's. \param ignored counts
  /// records of the request that nobody here knows.
  std::vector<std::byte> make(std::uint64_t number, std::uint64_t& ignored);
  std::shared_ptr<SharedPlan> take() { return std::move(plan_); }

 private:
  const ReplyWriter& answers_;
  const QueryLimits& limits_;
  std::shared_ptr<const Engine> engine_;
  wire::FrameHeader request_;
  std::function<OwnPayload()> fetch_;
  PlanShare share_;
  std::function<void(std::shared_ptr<void>)> free_;
  std::shared_ptr<SharedPlan> plan_;
};

}  // namespace clearance
