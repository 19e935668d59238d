#include "server/limits/plan_ledger.h"

#include <string>

#include "server/base/rejected_request.h"

namespace clearance {
namespace {

[[noreturn]] void refuse_plan(wire::ErrorCode code, const std::string& text) {
  throw RejectedRequest{code, "a plan on a device: " + text};
}

}  // namespace

PlanLedger::Share PlanLedger::begin(std::uint64_t client) {
  const std::lock_guard lock(mutex_);
  if (limits_.max_plans_of_client == 0)
    refuse_plan(wire::ErrorCode::kNotSupported, "this daemon opens none (limit max-client-plans = 0)");
  const auto held = clients_.find(client);
  if (held != clients_.end() && held->second.plans >= limits_.max_plans_of_client)
    refuse_plan(wire::ErrorCode::kBusy,
                std::to_string(held->second.plans) +
                    " plans of this client are open already; close one (limit max-client-plans)");
  if (all_.plans >= limits_.max_plans)
    refuse_plan(wire::ErrorCode::kBusy,
                std::to_string(all_.plans) + " plans of all clients are open already (limit max-plans)");
  Share share;
  share.ledger_ = shared_from_this();
  share.client_ = client;
  ++clients_[client].plans;
  ++all_.plans;
  return share;
}

void PlanLedger::Share::take(std::uint64_t bytes) {
  const Limits& limits = ledger_->limits_;
  const std::lock_guard lock(ledger_->mutex_);
  Held& own = ledger_->clients_.at(client_);
  const auto too_many = [bytes](std::uint64_t most, std::uint64_t taken) {
    return taken > most || bytes > most - taken;
  };
  const std::string needs = "it needs " + std::to_string(bytes) + " bytes of the device's memory; ";
  if (too_many(limits.max_plan_bytes_of_client, own.bytes))
    refuse_plan(wire::ErrorCode::kTooLarge, needs + "of the " + std::to_string(limits.max_plan_bytes_of_client) +
                                                " that this client may take, its plans have " +
                                                std::to_string(own.bytes) + " already (limit max-client-plan-mib)");
  if (too_many(limits.max_plan_bytes, ledger_->all_.bytes))
    refuse_plan(wire::ErrorCode::kBusy, needs + "of the " + std::to_string(limits.max_plan_bytes) +
                                            " of all clients, " + std::to_string(ledger_->all_.bytes) +
                                            " are taken already (limit max-plan-mib)");
  own.bytes += bytes;
  ledger_->all_.bytes += bytes;
  bytes_ += bytes;
}

PlanLedger::Share::~Share() {
  if (!ledger_) return;
  const std::lock_guard lock(ledger_->mutex_);
  const auto own = ledger_->clients_.find(client_);
  own->second.bytes -= bytes_;
  ledger_->all_.bytes -= bytes_;
  --ledger_->all_.plans;
  if (--own->second.plans == 0) ledger_->clients_.erase(own);
}

std::uint64_t PlanLedger::plans() const {
  const std::lock_guard lock(mutex_);
  return all_.plans;
}
std::uint64_t PlanLedger::bytes() const {
  const std::lock_guard lock(mutex_);
  return all_.bytes;
}

}  // namespace clearance
