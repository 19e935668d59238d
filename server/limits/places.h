// A limited number of connections, shared fairly among users and processes.
#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <cstdint>
#include <string>

#include "server/base/service_class.h"
#include "server/limits/resource_quota.h"

namespace clearance {

/// Connections by user and process. The last quarter is for users with less than a quarter, and the quarter before it
/// for processes with less than a sixteenth, so that a program that leaks connections shuts out neither another user
/// nor, once restarted, its own. With fewer than four connections there is no such part.
class Places {
 public:
  /// Held by one connection.
  struct Share {
    ResourceQuota::Share user, process;
  };

  /// @param kept_for_control of `places`, which the class control alone may use
  explicit Places(std::uint64_t places, std::uint64_t kept_for_control = 0)
      : places_(places), kept_for_control_(kept_for_control) {}

  /// Reason to reject another connection, or empty.
  /// @param what in the message, such as "shared-memory clients"
  std::string why_not(const ucred& who, const char* what, ServiceClass service = ServiceClass::kPlanning) const;
  [[nodiscard]] Share take(const ucred& who) {
    return {users_.take(who.uid, 1), processes_.take(static_cast<std::uint64_t>(who.pid), 1)};
  }
  std::uint64_t taken() const { return users_.total(); }

 private:
  std::uint64_t places_, kept_for_control_;
  ResourceQuota users_, processes_;
};

}  // namespace clearance
