#include "server/tasks/device_plans.h"

#include <string>
#include <utility>

namespace clearance {
namespace {

constexpr const char* kPlan = "a plan on a device: ";

ResourceQuota::Limit plans_of_client(std::uint64_t most) {
  return {most, wire::ErrorCode::kBusy, [](std::uint64_t held, std::uint64_t) {
            return kPlan + std::to_string(held) +
                   " plans of this client are open already; close one (limit max-client-plans)";
          }};
}

ResourceQuota::Limit plans_of_all(std::uint64_t most) {
  return {most, wire::ErrorCode::kBusy, [](std::uint64_t held, std::uint64_t) {
            return kPlan + std::to_string(held) + " plans of all clients are open already (limit max-plans)";
          }};
}

std::string memory_needed(std::uint64_t bytes, std::uint64_t most) {
  return kPlan + ("it needs " + std::to_string(bytes)) + " bytes of the device's memory; of the " +
         std::to_string(most);
}

ResourceQuota::Limit bytes_of_client(std::uint64_t most) {
  return {most, wire::ErrorCode::kTooLarge, [most](std::uint64_t held, std::uint64_t more) {
            return memory_needed(more, most) + " that this client may take, its plans have " + std::to_string(held) +
                   " already (limit max-client-plan-mib)";
          }};
}

ResourceQuota::Limit bytes_of_all(std::uint64_t most) {
  return {most, wire::ErrorCode::kBusy, [most](std::uint64_t held, std::uint64_t more) {
            return memory_needed(more, most) + " of all clients, " + std::to_string(held) +
                   " are taken already (limit max-plan-mib)";
          }};
}

}  // namespace

DevicePlans::DevicePlans(const Limits& limits)
    : is_allowed_(limits.max_plans_of_client > 0),
      count_(plans_of_client(limits.max_plans_of_client), plans_of_all(limits.max_plans),
             ResourceQuota::Threads::kMany),
      bytes_(bytes_of_client(limits.max_plan_bytes_of_client), bytes_of_all(limits.max_plan_bytes),
             ResourceQuota::Threads::kMany) {}

PlanShare DevicePlans::begin(std::uint64_t client) {
  if (!is_allowed_)
    throw RejectedRequest{wire::ErrorCode::kNotSupported,
                          kPlan + std::string("this daemon opens none (limit max-client-plans = 0)")};
  count_.check(client, 1);
  return {count_.take(client, 1), bytes_.take(client, 0)};
}

DevicePlans::Open& DevicePlans::find(std::uint64_t client, std::uint64_t number) {
  const auto found = plans_.find(number);
  if (found == plans_.end() || found->second.client != client)
    throw RejectedRequest{wire::ErrorCode::kBadQuery,
                          "a plan on a device: this client has no plan " + std::to_string(number) + " open"};
  return found->second;
}

void DevicePlans::end_run(std::uint64_t number) {
  if (const auto found = plans_.find(number); found != plans_.end()) found->second.is_running = false;
}

void DevicePlans::close(std::uint64_t client, std::uint64_t number) {
  find(client, number);
  plans_.erase(number);
}

std::size_t DevicePlans::drop_gone() {
  return std::erase_if(plans_, [](const auto& plan) { return !plan.second.is_there(); });
}

std::vector<std::byte> PlanOpening::make(std::uint64_t number, std::uint64_t& ignored) {
  const OwnPayload payload = std::exchange(fetch_, nullptr)();
  std::vector<std::uint64_t> aligned_room;
  const wire::QueryParts parts = wire::parse_query(request_, aligned(payload.span(), aligned_room));
  ignored += parts.passed_over.size();
  answers_.check_epoch(request_, parts.epoch);
  const QueryOptions& asked = parts.options;
  if (asked.min_pose_stamp_ns != 0 || asked.deadline_ns != 0)
    throw RejectedRequest{wire::ErrorCode::kNotSupported,
                          "a plan on a device: without min_pose_stamp_ns and deadline_ns"};
  plan_ = {new SharedPlan(std::exchange(engine_, nullptr), view_of(parts, request_.scene_revision), limits_,
                          std::move(share_)),
           [free = free_](SharedPlan* plan) { free(std::shared_ptr<SharedPlan>(plan)); }};
  return plan_->description(number);
}

}  // namespace clearance
