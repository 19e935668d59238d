#include "server/limits/resource_quota.h"

#include "server/base/rejected_request.h"

namespace clearance {
namespace {

/// Idle clients whose accounts are kept, so that a client's repeated requests do not allocate.
constexpr std::size_t kIdleClientsKept = 256;

void check_limit(const ResourceQuota::Limit& limit, std::uint64_t held, std::uint64_t more) {
  if (held > limit.most || more > limit.most - held) throw RejectedRequest{limit.code, limit.text(held, more)};
}

}  // namespace

ResourceQuota::Share& ResourceQuota::Share::operator=(Share&& other) noexcept {
  release();
  quota_ = std::exchange(other.quota_, nullptr);
  account_ = other.account_;
  amount_ = other.amount_;
  return *this;
}

void ResourceQuota::Share::grow(std::uint64_t more) {
  const auto guard = quota_->lock();
  quota_->check_limits(account_->second.held, more);
  account_->second.held += more;
  quota_->total_ += more;
  amount_ += more;
}

void ResourceQuota::Share::release() {
  ResourceQuota* quota = std::exchange(quota_, nullptr);
  if (!quota) return;
  const auto guard = quota->lock();
  quota->total_ -= amount_;
  account_->second.held -= amount_;
  if (--account_->second.shares == 0 && quota->clients_.size() > kIdleClientsKept)
    quota->clients_.erase(quota->clients_.find(account_->first));
}

void ResourceQuota::check_limits(std::uint64_t held, std::uint64_t more) const {
  check_limit(of_client_, held, more);
  check_limit(of_all_, total_, more);
}

void ResourceQuota::check(std::uint64_t client, std::uint64_t more) const {
  const auto guard = lock();
  const auto found = clients_.find(client);
  check_limits(found == clients_.end() ? 0 : found->second.held, more);
}

ResourceQuota::Share ResourceQuota::take(std::uint64_t client, std::uint64_t amount) {
  const auto guard = lock();
  Accounts::value_type& account = *clients_.try_emplace(client).first;
  ++account.second.shares;
  account.second.held += amount;
  total_ += amount;
  return {*this, account, amount};
}

std::uint64_t ResourceQuota::of(std::uint64_t client) const {
  const auto guard = lock();
  const auto found = clients_.find(client);
  return found == clients_.end() ? 0 : found->second.held;
}

std::uint64_t ResourceQuota::total() const {
  const auto guard = lock();
  return total_;
}

}  // namespace clearance
