#include "server/tasks/device_plans.h"

#include <string>
#include <utility>

namespace clearance {

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
