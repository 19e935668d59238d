#include "server/core/plan_requests.h"

#include <utility>

#include "server/requests/request_payload.h"

namespace clearance {

using wire::ErrorCode;

void PlanRequests::open(Request& request) {
  const std::uint64_t client = request.sink->client();
  std::function<bool()> is_there = request.sink->watch();
  if (!is_there)
    throw RejectedRequest{
        ErrorCode::kNotSupported,
        "a plan on a device: its memory is for processes of this machine whose end the daemon sees, by shm:// "
        "and ipc://; this client is none of them"};
  context_.check_quota(request, request.bytes);
  const auto opening = std::make_shared<PlanOpening>(
      context_.answers, query_limits_, context_.engine, request.header, request.take_payload(), plans_.begin(client),
      [&workers = context_.workers](std::shared_ptr<void> plan) { workers.drop_plan(std::move(plan)); });
  const std::uint64_t number = plans_.next_number();
  const auto make = [opening, number](auto, std::uint64_t& ignored) { return opening->make(number, ignored); };
  const auto done = [=, this](bool made) {
    if (made) {
      plans_.add(number, {client, is_there, opening->take()});
      ++context_.stats["plans.opened"];
    }
    return true;
  };
  context_.submit(request, request.bytes, make, done);
}

void PlanRequests::run(Request& request) {
  const std::uint64_t client = request.sink->client(), number = wire::parse_plan_request(request.payload).plan;
  DevicePlans::Open& open = plans_.find(client, number);
  const std::string named = "a plan on a device: plan " + std::to_string(number);
  const std::uint64_t revision = request.header.scene_revision;
  if (revision && revision != context_.engine->scene_revision())
    throw RejectedRequest{ErrorCode::kWrongScene,
                          named + " was made for another scene than the daemon has now; open it again"};
  if (open.is_running)
    throw RejectedRequest{ErrorCode::kBusy,
                          named + " is running already; wait for its rows, which are the same memory"};
  context_.quotas.check_requests(client);
  wire::PlanResult result;
  result.plan = number;
  result.snapshot_revision = context_.engine->pose_revision();
  const auto make = [plan = open.plan, result, begun = false](
                        std::chrono::nanoseconds budget,
                        std::uint64_t&) mutable -> std::optional<std::vector<std::byte>> {
    if (!std::exchange(begun, true)) plan->begin_run();
    if (!plan->advance(budget)) return std::nullopt;
    result.took_ns = static_cast<std::uint64_t>(plan->took().count());
    const auto bytes = bytes_of(result);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  const auto done = [this, number](bool made) {
    plans_.end_run(number);
    if (made) ++context_.stats["plans.runs"];
    return true;
  };
  context_.submit(request, request.payload.size(), make, done);
  open.is_running = true;
}

void PlanRequests::close(Request& request) {
  wire::PlanResult result;
  result.plan = wire::parse_plan_request(request.payload).plan;
  plans_.close(request.sink->client(), result.plan);
  count_closed(1);
  result.snapshot_revision = context_.engine->pose_revision();
  context_.reply(request, bytes_of(result));
}

}  // namespace clearance
