#include "server/limits/quotas.h"

#include <algorithm>
#include <string>

#include "server/base/rejected_request.h"

namespace clearance {
namespace {

/// Clients that are remembered though nothing of theirs is under way: one that asks again and again allocates nothing.
constexpr std::size_t kIdleClientsKept = 256;

[[noreturn]] void refuse(const std::string& text) {
  throw RejectedRequest{wire::ErrorCode::kBusy, text};
}

}  // namespace

Quotas::Share::Share(Quotas& quotas, Usage& usage, ServiceClass service, std::uint64_t bytes)
    : quotas_(&quotas), usage_(&usage), service_(service), bytes_(bytes) {
  ++usage.requests;
  usage.bytes += bytes;
  quotas.bytes_of(service) += bytes;
}

void Quotas::Share::give_back() {
  Quotas* quotas = std::exchange(quotas_, nullptr);
  if (!quotas) return;
  --usage_->requests;
  usage_->bytes -= bytes_;
  quotas->bytes_of(service_) -= bytes_;
}

Quotas::Usage Quotas::of(std::uint64_t client) const {
  const auto found = clients_.find(client);
  return found == clients_.end() ? Usage() : found->second;
}

void Quotas::check_requests(std::uint64_t client) const {
  const std::uint32_t requests = of(client).requests;
  if (requests >= limits_.max_waiting_per_client)
    refuse(std::to_string(requests) + " queries of this client are under way already; ask again (limit max-waiting)");
}

std::uint64_t Quotas::check_bytes(std::uint64_t client, ServiceClass service, std::uint64_t bytes,
                                  std::uint64_t unsent) const {
  const std::uint64_t taken = of(client).bytes + unsent;
  if (taken && taken + bytes > limits_.max_client_bytes)
    refuse("the requests and replies of this client under way take " + std::to_string(taken) +
           " bytes already; ask again (limit max-client-mib)");
  check_all_bytes(service, bytes);
  return limits_.max_client_bytes - std::min(limits_.max_client_bytes, taken + bytes);
}

/// What the others have taken never keeps the class control from what is kept for it.
void Quotas::check_all_bytes(ServiceClass service, std::uint64_t bytes) const {
  const bool is_control = service == ServiceClass::kControl;
  const auto [control, planning] = bytes_;
  if (is_control && control + bytes <= limits_.kept_for_control) return;
  const std::uint64_t kept = is_control ? 0 : limits_.kept_for_control;
  const std::uint64_t taken = is_control ? control + planning : planning + (control > kept ? control - kept : 0);
  if (taken && taken + bytes > limits_.max_waiting_bytes - std::min(kept, limits_.max_waiting_bytes))
    refuse("the requests and replies under way take " + std::to_string(control + planning) +
           " bytes already; ask again");
}

Quotas::Share Quotas::take(std::uint64_t client, ServiceClass service, std::uint64_t bytes) {
  return Share(*this, clients_[client], service, bytes);
}

void Quotas::forget_idle() {
  if (clients_.size() > kIdleClientsKept)
    std::erase_if(clients_, [](const auto& client) { return client.second.requests == 0; });
}

}  // namespace clearance
