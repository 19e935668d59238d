// Requests and bytes under way, per client and in total. Beyond the limits a request is rejected with kBusy.
#pragma once

#include <array>
#include <cstdint>

#include "server/base/service_class.h"
#include "server/limits/resource_quota.h"

namespace clearance {

class Quotas {
 public:
  struct Limits {
    std::uint32_t max_waiting_per_client = 64;                 ///< requests of one client under way
    std::uint64_t max_waiting_bytes = std::uint64_t{4} << 30;  ///< of all clients' requests and replies under way
    std::uint64_t max_client_bytes = std::uint64_t{2} << 30;   ///< of one client's
    std::uint64_t kept_for_control = 0;                        ///< part of max_waiting_bytes for that class only
  };

  /// Held by one request under way.
  struct Share {
    ResourceQuota::Share request, bytes;

    void give_back() {
      request.release();
      bytes.release();
    }
  };

  explicit Quotas(const Limits& limits);

  /// Throws RejectedRequest (kBusy) if the client has the most requests under way that it may have.
  void check_requests(std::uint64_t client) const { requests_.check(client, 1); }
  /// Throws RejectedRequest (kBusy) if `bytes` more exceed the limit of the client or of all. A client's only request
  /// passes whatever its size.
  /// @param unsent bytes of published replies that the daemon still holds
  void check_bytes(std::uint64_t client, ServiceClass service, std::uint64_t bytes, std::uint64_t unsent) const;
  /// Counts a request without a check.
  [[nodiscard]] Share take(std::uint64_t client, ServiceClass service, std::uint64_t bytes) {
    return {requests_.take(client, 1), bytes_[static_cast<int>(service)].take(client, bytes)};
  }

 private:
  void check_all_bytes(ServiceClass service, std::uint64_t bytes) const;

  Limits limits_;
  ResourceQuota requests_;
  std::array<ResourceQuota, kServiceClasses> bytes_;
};

}  // namespace clearance
