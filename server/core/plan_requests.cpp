#include "server/core/plan_requests.h"

#include <string>
#include <utility>

#include "server/requests/request_payload.h"
#include "server/tasks/query_reader.h"

namespace clearance {
namespace {

using wire::ErrorCode;

RejectedRequest rejected(ErrorCode code, const std::string& text) {
  return {code, "a plan on a device: " + text};
}

std::string text_of_bytes(std::uint64_t more, std::uint64_t most) {
  return "a plan on a device: it needs " + std::to_string(more) + " bytes of the device's memory; of the " +
         std::to_string(most);
}

/// Limit of open plans.
/// @param whose "this client are open already; close one (limit max-client-plans)"
ResourceQuota::Limit plan_limit(std::uint64_t most, const char* whose) {
  return {most, ErrorCode::kBusy, [whose](std::uint64_t held, std::uint64_t) {
            return "a plan on a device: " + std::to_string(held) + " plans of " + whose;
          }};
}

ResourceQuota::Limit bytes_of_client(std::uint64_t most) {
  return {most, ErrorCode::kTooLarge, [most](std::uint64_t held, std::uint64_t more) {
            return text_of_bytes(more, most) + " that this client may take, its plans have " + std::to_string(held) +
                   " already (limit max-client-plan-mib)";
          }};
}

ResourceQuota::Limit bytes_of_all(std::uint64_t most) {
  return {most, ErrorCode::kBusy, [most](std::uint64_t held, std::uint64_t more) {
            return text_of_bytes(more, most) + " of all clients, " + std::to_string(held) +
                   " are taken already (limit max-plan-mib)";
          }};
}

/// Makes a plan on a worker.
struct Opening : QueryReader {
  const QueryLimits& limits;
  PlanShare share;
  std::shared_ptr<SharedPlan> plan = nullptr;

  /// Returns the payload of kPlan.
  /// @param free frees the plan on a worker; from any thread
  std::vector<std::byte> make(std::uint64_t number, std::uint64_t& ignored,
                              const std::function<void(std::shared_ptr<void>)>& free) {
    const wire::QueryParts parts = read(ignored);
    if (parts.options.min_pose_stamp_ns != 0 || parts.options.deadline_ns != 0)
      throw rejected(ErrorCode::kNotSupported, "without min_pose_stamp_ns and deadline_ns");
    plan = {new SharedPlan(std::exchange(engine_, nullptr), view_of(parts, request_.scene_revision), limits,
                           std::move(share)),
            [free](SharedPlan* made) { free(std::shared_ptr<SharedPlan>(made)); }};
    return plan->description(number);
  }
};

}  // namespace

PlanRequests::PlanRequests(RequestContext& context, const PlanLimits& limits, const QueryLimits& query_limits)
    : context_(context),
      query_limits_(query_limits),
      is_allowed_(limits.max_plans_of_client > 0),
      count_(plan_limit(limits.max_plans_of_client, "this client are open already; close one (limit max-client-plans)"),
             plan_limit(limits.max_plans, "all clients are open already (limit max-plans)"),
             ResourceQuota::Threads::kMany),
      bytes_(bytes_of_client(limits.max_plan_bytes_of_client), bytes_of_all(limits.max_plan_bytes),
             ResourceQuota::Threads::kMany) {}

PlanShare PlanRequests::take_share(std::uint64_t client) {
  if (!is_allowed_) throw rejected(ErrorCode::kNotSupported, "this daemon opens none (limit max-client-plans = 0)");
  count_.check(client, 1);
  return {count_.take(client, 1), bytes_.take(client, 0)};
}

/// Throws RejectedRequest (kBadQuery) unless the client has opened the plan that it names.
PlanRequests::Plans::iterator PlanRequests::find(const Request& request) {
  const std::uint64_t number = wire::parse_plan_request(request.payload).plan;
  const auto found = plans_.find(number);
  if (found == plans_.end() || found->second.client != request.sink->client())
    throw rejected(ErrorCode::kBadQuery, "this client has no plan " + std::to_string(number) + " open");
  return found;
}

void PlanRequests::drop_gone() {
  context_.stats["plans.closed"] += std::erase_if(plans_, [](const auto& plan) { return !plan.second.is_there(); });
}

void PlanRequests::open(Request& request) {
  const std::uint64_t client = request.sink->client();
  std::function<bool()> is_there = request.sink->watch();
  if (!is_there)
    throw rejected(ErrorCode::kNotSupported,
                   "its memory is shared only with processes of this machine, over shm:// and ipc://; this "
                   "client is not one of them");
  context_.check_quota(request, request.bytes);
  const auto opening = std::make_shared<Opening>(Opening{
      {context_.answers, context_.engine, request.header, request.take_payload()}, query_limits_, take_share(client)});
  const std::uint64_t number = ++last_number_;
  const auto make = [opening, number, &workers = context_.workers](auto, std::uint64_t& ignored) {
    return opening->make(number, ignored, [&workers](auto plan) { workers.drop_plan(std::move(plan)); });
  };
  const auto done = [=, this](bool made) {
    if (made) {
      plans_.emplace(number, Plan{client, is_there, std::move(opening->plan)});
      ++context_.stats["plans.opened"];
    }
    return true;
  };
  context_.submit(request, request.bytes, make, done);
}

void PlanRequests::run(Request& request) {
  const auto& [number, plan] = *find(request);
  const std::string named = "plan " + std::to_string(number);
  const std::uint64_t revision = request.header.scene_revision;
  if (revision && revision != context_.engine->scene_revision())
    throw rejected(ErrorCode::kWrongScene, named + " was made for an earlier scene; open it again");
  if (plan.is_running)
    throw rejected(ErrorCode::kBusy, named + " is running already; wait for its rows, which are the same memory");
  context_.quotas.check_requests(plan.client);
  wire::PlanResult result;
  result.plan = number;
  result.snapshot_revision = context_.engine->pose_revision();
  const auto make = [plan = plan.plan, result, begun = false](
                        std::chrono::nanoseconds budget,
                        std::uint64_t&) mutable -> std::optional<std::vector<std::byte>> {
    if (!std::exchange(begun, true)) plan->begin_run();
    if (!plan->advance(budget)) return std::nullopt;
    result.took_ns = static_cast<std::uint64_t>(plan->took().count());
    const auto bytes = bytes_of(result);
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  const auto done = [this, id = number](bool made) {
    if (const auto found = plans_.find(id); found != plans_.end()) found->second.is_running = false;
    if (made) ++context_.stats["plans.runs"];
    return true;
  };
  context_.submit(request, request.payload.size(), make, done);
  plans_.at(result.plan).is_running = true;
}

void PlanRequests::close(Request& request) {
  const auto found = find(request);
  wire::PlanResult result;
  result.plan = found->first;
  plans_.erase(found);
  ++context_.stats["plans.closed"];
  result.snapshot_revision = context_.engine->pose_revision();
  context_.reply(request, bytes_of(result));
}

}  // namespace clearance
