#include "server/limits/quotas.h"

#include <algorithm>
#include <string>

#include "server/base/rejected_request.h"

namespace clearance {
namespace {

[[noreturn]] void reject_bytes(const std::string& text) {
  throw RejectedRequest{wire::ErrorCode::kBusy, "the requests and replies " + text};
}

ResourceQuota::Limit limit_of_requests(const Quotas::Limits& limits) {
  return {limits.max_waiting_per_client, wire::ErrorCode::kBusy, [](std::uint64_t held, std::uint64_t) {
            return std::to_string(held) +
                   " queries of this client are under way already; retry later (limit max-waiting)";
          }};
}

}  // namespace

Quotas::Quotas(const Limits& limits) : limits_(limits), requests_(limit_of_requests(limits), {}) {}

void Quotas::check_bytes(std::uint64_t client, ServiceClass service, std::uint64_t bytes, std::uint64_t unsent) const {
  std::uint64_t taken = unsent;
  for (const ResourceQuota& of_class : bytes_) taken += of_class.of(client);
  if (taken && taken + bytes > limits_.max_client_bytes)
    reject_bytes("of this client under way take " + std::to_string(taken) +
                 " bytes already; retry later (limit max-client-mib)");
  check_all_bytes(service, bytes);
}

/// Other classes never use up the part that is kept for the class control.
void Quotas::check_all_bytes(ServiceClass service, std::uint64_t bytes) const {
  const bool is_control = service == ServiceClass::kControl;
  const std::uint64_t control = bytes_[static_cast<int>(ServiceClass::kControl)].total(),
                      planning = bytes_[static_cast<int>(ServiceClass::kPlanning)].total();
  if (is_control && control + bytes <= limits_.kept_for_control) return;
  const std::uint64_t kept = is_control ? 0 : limits_.kept_for_control;
  const std::uint64_t taken = is_control ? control + planning : planning + (control > kept ? control - kept : 0);
  if (taken && taken + bytes > limits_.max_waiting_bytes - std::min(kept, limits_.max_waiting_bytes))
    reject_bytes("under way take " + std::to_string(control + planning) + " bytes already; retry later");
}

}  // namespace clearance
