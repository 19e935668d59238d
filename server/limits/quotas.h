// How many requests and bytes each client has under way, and how many all have together: what is more is refused with
// kBusy, so that no client takes the daemon's memory or its time for itself.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <utility>

#include "server/base/service_class.h"

namespace clearance {

class Quotas {
 private:
  struct Usage {
    std::uint32_t requests = 0;
    std::uint64_t bytes = 0;
  };

 public:
  struct Limits {
    std::uint32_t max_waiting_per_client = 64;                 ///< requests of one client under way
    std::uint64_t max_waiting_bytes = std::uint64_t{4} << 30;  ///< of all clients' requests and replies under way
    std::uint64_t max_client_bytes = std::uint64_t{2} << 30;   ///< of one client's
    std::uint64_t kept_for_control = 0;                        ///< of max_waiting_bytes: for that class alone
  };

  /// What one request under way takes; given back when this ends. Ends before the quotas do.
  class Share {
   public:
    Share() = default;
    Share(Share&& other) noexcept
        : quotas_(std::exchange(other.quotas_, nullptr)),
          usage_(other.usage_),
          service_(other.service_),
          bytes_(other.bytes_) {}
    Share& operator=(Share&& other) noexcept {
      std::swap(quotas_, other.quotas_);
      std::swap(usage_, other.usage_);
      std::swap(service_, other.service_);
      std::swap(bytes_, other.bytes_);
      return *this;
    }
    ~Share() { give_back(); }
    void give_back();

   private:
    friend class Quotas;
    Share(Quotas& quotas, Usage& usage, ServiceClass service, std::uint64_t bytes);
    Quotas* quotas_ = nullptr;
    Usage* usage_ = nullptr;
    ServiceClass service_ = ServiceClass::kPlanning;
    std::uint64_t bytes_ = 0;
  };

  explicit Quotas(const Limits& limits) : limits_(limits) {}
  Quotas(const Quotas&) = delete;
  Quotas& operator=(const Quotas&) = delete;

  /// Throws a Refusal (kBusy) if as many requests of this client are under way as may be.
  void check_requests(std::uint64_t client) const;
  /// Throws a Refusal (kBusy) if so many bytes more are too many for this client or for all. One request may always be
  /// under way, whatever its size.
  /// \param unsent bytes of replies that have left the quotas, but not the daemon.
  /// \returns how many bytes the client may take beside these.
  std::uint64_t check_bytes(std::uint64_t client, ServiceClass service, std::uint64_t bytes,
                            std::uint64_t unsent) const;
  /// Counts a request, whether or not the checks would let it pass.
  [[nodiscard]] Share take(std::uint64_t client, ServiceClass service, std::uint64_t bytes);
  /// Forgets clients that have nothing under way, once there are many. Called now and then.
  void forget_idle();

 private:
  Usage of(std::uint64_t client) const;
  std::uint64_t& bytes_of(ServiceClass service) { return bytes_[static_cast<int>(service)]; }
  void check_all_bytes(ServiceClass service, std::uint64_t bytes) const;

  Limits limits_;
  std::unordered_map<std::uint64_t, Usage> clients_;    // of what is here, shares keep references
  std::array<std::uint64_t, kServiceClasses> bytes_{};  // of all, by class
};

}  // namespace clearance
