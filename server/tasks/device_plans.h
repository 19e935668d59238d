// Open plans by number, with their clients.
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

/// Used on the loop's thread.
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
  /// Throws RejectedRequest (kBadQuery) unless the client has opened the plan.
  Open& find(std::uint64_t client, std::uint64_t number);
  /// Marks a run as over, even if the plan was closed meanwhile.
  void end_run(std::uint64_t number);
  /// Throws as find(). A run under way ends before its memory is freed.
  void close(std::uint64_t client, std::uint64_t number);
  /// Closes plans of clients that are gone, and returns their number.
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

/// Reads a kOpenPlan and makes the plan. Used on a worker.
class PlanOpening {
 public:
  /// @param answers and limits outlive this
  /// @param fetch brings the request's payload
  /// @param free frees a plan on a worker; from any thread
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

  /// Returns the payload of kPlan. Throws RejectedRequest, QueryError or WireError.
  /// @param number of the plan
  /// @param ignored count of unknown records, to which it adds
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
