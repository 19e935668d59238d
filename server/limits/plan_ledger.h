// How many plans clients have open in a device's memory, and how much of it they take: what is more is refused, so that
// no client takes the device for itself.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <utility>

namespace clearance {

/// From any thread: plans are made and freed beside the loop.
class PlanLedger : public std::enable_shared_from_this<PlanLedger> {
 public:
  struct Limits {
    std::uint32_t max_plans_of_client = 8;                            ///< 0: no plans are opened
    std::uint32_t max_plans = 64;                                     ///< of all clients
    std::uint64_t max_plan_bytes_of_client = std::uint64_t{2} << 30;  ///< more: kTooLarge
    std::uint64_t max_plan_bytes = std::uint64_t{8} << 30;            ///< of all clients; more: kBusy
  };

  /// What one plan takes; given back when this ends.
  class Share {
   public:
    Share() = default;
    Share(Share&& other) noexcept
        : ledger_(std::move(other.ledger_)), client_(other.client_), bytes_(std::exchange(other.bytes_, 0)) {}
    Share& operator=(Share&&) = delete;
    ~Share();

    /// Counts bytes of a device's memory. Throws a Refusal where that is too many.
    void take(std::uint64_t bytes);

   private:
    friend class PlanLedger;
    std::shared_ptr<PlanLedger> ledger_;
    std::uint64_t client_ = 0, bytes_ = 0;
  };

  explicit PlanLedger(const Limits& limits) : limits_(limits) {}

  /// Counts a plan. Throws a Refusal where there are too many.
  [[nodiscard]] Share begin(std::uint64_t client);
  std::uint64_t plans() const;
  std::uint64_t bytes() const;

 private:
  struct Held {
    std::uint32_t plans = 0;
    std::uint64_t bytes = 0;
  };

  Limits limits_;
  mutable std::mutex mutex_;
  std::unordered_map<std::uint64_t, Held> clients_;
  Held all_;
};

}  // namespace clearance
