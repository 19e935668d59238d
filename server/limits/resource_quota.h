// Amounts of one resource that clients hold, per client and in total, with limits.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <utility>

#include "wire/protocol.h"

namespace clearance {

/// Counts requests, bytes, points or connections. One client cannot take everything.
class ResourceQuota {
 private:
  struct Account {
    std::uint64_t held = 0;
    std::uint32_t shares = 0;
  };
  using Accounts = std::unordered_map<std::uint64_t, Account>;

 public:
  /// The most that may be held, and the error beyond it.
  struct Limit {
    std::uint64_t most = std::numeric_limits<std::uint64_t>::max();
    wire::ErrorCode code = wire::ErrorCode::kBusy;
    std::function<std::string(std::uint64_t held, std::uint64_t more)> text = nullptr;
  };
  enum class Threads { kOne, kMany };

  /// An amount that a client holds until this object ends, which must be before the quota does.
  class Share {
   public:
    Share() = default;
    Share(Share&& other) noexcept { *this = std::move(other); }
    Share& operator=(Share&& other) noexcept;
    ~Share() { release(); }
    /// Throws RejectedRequest beyond a limit.
    void grow(std::uint64_t more);
    void release();

   private:
    friend class ResourceQuota;
    Share(ResourceQuota& quota, Accounts::value_type& account, std::uint64_t amount)
        : quota_(&quota), account_(&account), amount_(amount) {}
    ResourceQuota* quota_ = nullptr;
    Accounts::value_type* account_ = nullptr;
    std::uint64_t amount_ = 0;
  };

  ResourceQuota() = default;
  ResourceQuota(Limit of_client, Limit of_all, Threads threads = Threads::kOne)
      : of_client_(std::move(of_client)),
        of_all_(std::move(of_all)),
        mutex_(threads == Threads::kMany ? std::make_unique<std::mutex>() : nullptr) {}
  ResourceQuota(const ResourceQuota&) = delete;
  ResourceQuota& operator=(const ResourceQuota&) = delete;

  /// Throws RejectedRequest if the client must not hold so much more.
  void check(std::uint64_t client, std::uint64_t more) const;
  /// Takes an amount without a check.
  [[nodiscard]] Share take(std::uint64_t client, std::uint64_t amount);
  std::uint64_t of(std::uint64_t client) const;
  std::uint64_t total() const;

 private:
  std::unique_lock<std::mutex> lock() const {
    return mutex_ ? std::unique_lock(*mutex_) : std::unique_lock<std::mutex>();
  }
  void check_limits(std::uint64_t held, std::uint64_t more) const;

  Limit of_client_, of_all_;
  std::unique_ptr<std::mutex> mutex_;  // null if one thread uses this
  Accounts clients_;                   // shares point to its elements
  std::uint64_t total_ = 0;
};

}  // namespace clearance
