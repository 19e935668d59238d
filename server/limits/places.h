// Places that many share: nobody may take them all.
#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>

#include "server/base/service_class.h"

namespace clearance {

/// Who sits in places, by user and process. The last quarter is for users who hold less than a quarter, and the quarter
/// before it for processes who hold less than a sixteenth: a program that takes places and never leaves them shuts out
/// neither another user's programs nor, started anew, those of its own. Of fewer than four places anybody may take all.
/// Some may be kept for the class control, which may take any.
class Places {
 public:
  explicit Places(std::uint64_t places, std::uint64_t kept_for_control = 0)
      : places_(places), kept_for_control_(kept_for_control) {}

  /// Why somebody may not have another one; empty: he may. \param what "shared-memory clients".
  std::string why_not(const ucred& who, const char* what, ServiceClass service = ServiceClass::kPlanning) const;
  void take(const ucred& who);
  void leave(const ucred& who);
  std::uint64_t taken() const { return taken_; }

 private:
  static std::uint64_t count(const std::unordered_map<std::uint64_t, std::uint64_t>& counts, std::uint64_t of);

  std::uint64_t places_, kept_for_control_, taken_ = 0;
  std::unordered_map<std::uint64_t, std::uint64_t> by_user_, by_process_;
};

}  // namespace clearance
