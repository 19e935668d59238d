// The loop's part of plans in a device's memory: they are made, run and freed on threads of their own.
#include <utility>

#include "server/core/loop.h"
#include "server/requests/request_payload.h"

namespace clearance {
namespace {

using wire::ErrorCode;
using wire::FrameHeader;
using wire::FrameType;

}  // namespace

void Loop::open_plan(const FrameHeader& header, std::function<OwnPayload()> fetch, std::uint64_t bytes,
                     std::unique_ptr<ReplySink>& sink) {
  const std::uint64_t client = sink->client();
  std::function<bool()> is_there = sink->watch();
  if (!is_there)
    throw RejectedRequest{
        ErrorCode::kNotSupported,
        "a plan on a device: its memory is for processes of this machine whose end the daemon sees, by shm:// "
        "and ipc://; this client is none of them"};
  const ServiceClass service = class_for(*sink, kDefaultOptions);
  quotas_.check_requests(client);
  quotas_.check_bytes(client, service, bytes, sink->unsent_bytes());
  const auto opening = std::make_shared<PlanOpening>(
      answers_, options_, engine_, header, std::move(fetch), plans_.begin(client),
      [this](std::shared_ptr<void> plan) { plan_worker_.drop(std::move(plan)); });
  const std::uint64_t number = plans_.next_number();
  const auto ignored = std::make_shared<std::uint64_t>(0);
  const auto make = [opening, number, ignored](auto) { return opening->make(number, *ignored); };
  const auto done = [=, this](bool made) {
    stats_.records_ignored += *ignored;
    if (made) {
      plans_.add(number, {client, is_there, opening->take()});
      ++stats_["plans.opened"];
    }
    return true;
  };
  PendingRequest asked{nullptr, header, quotas_.take(client, service, bytes)};
  asked.sink = std::move(sink);
  plan_worker_.add(std::make_unique<BackgroundRequest>(answers_, std::move(asked), service, FrameType::kPlan,
                                                       turn_began_, make, done, BackgroundRequest::Weight::kLight));
}

void Loop::run_plan(const FrameHeader& header, std::span<const std::byte> payload, std::unique_ptr<ReplySink>& sink) {
  const std::uint64_t client = sink->client(), number = wire::parse_plan_request(payload).plan;
  DevicePlans::Open& open = plans_.find(client, number);
  const std::string named = "a plan on a device: plan " + std::to_string(number);
  if (header.scene_revision && header.scene_revision != engine_->scene_revision())
    throw RejectedRequest{ErrorCode::kWrongScene,
                          named + " was made for another scene than the daemon has now; open it again"};
  if (open.is_running)
    throw RejectedRequest{ErrorCode::kBusy,
                          named + " is running already; wait for its rows, which are the same memory"};
  const ServiceClass service = class_for(*sink, kDefaultOptions);
  quotas_.check_requests(client);
  PendingRequest asked{nullptr, header, quotas_.take(client, service, payload.size())};
  wire::PlanResult result;
  result.plan = number;
  result.snapshot_revision = engine_->pose_revision();
  const auto make = [plan = open.plan, result,
                     begun = false](std::chrono::nanoseconds budget) mutable -> std::optional<std::vector<std::byte>> {
    if (!std::exchange(begun, true)) plan->begin_run();
    if (!plan->advance(budget)) return std::nullopt;
    result.took_ns = static_cast<std::uint64_t>(plan->took().count());
    const auto bytes = bytes_of(result);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  const auto done = [this, number](bool made) {
    plans_.end_run(number);
    if (made) ++stats_["plans.runs"];
    return true;
  };
  asked.sink = std::move(sink);
  open.is_running = true;
  run_worker_.add(std::make_unique<BackgroundRequest>(answers_, std::move(asked), service, FrameType::kPlanDone,
                                                      turn_began_, make, done, BackgroundRequest::Weight::kLight));
}

wire::PlanResult Loop::close_plan(std::span<const std::byte> payload, std::uint64_t client) {
  wire::PlanResult result;
  result.plan = wire::parse_plan_request(payload).plan;
  plans_.close(client, result.plan);
  count_closed(1);
  result.snapshot_revision = engine_->pose_revision();
  return result;
}

}  // namespace clearance
