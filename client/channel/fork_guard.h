// Detects that this process is a fork of the one that opened a connection.
//
// Threads, sockets and shared slots of a connection belong to the process that opened it. A child must neither use nor
// close them, and must connect again.
#pragma once

#include <cstdint>

namespace clearance {

/// Identifies the process that constructed it.
class ForkGuard {
 public:
  ForkGuard() : generation_(current()) {}
  /// True in a child forked since. Costs a load, without a system call.
  bool forked() const { return generation_ != current(); }

 private:
  static std::uint64_t current();
  std::uint64_t generation_;
};

}  // namespace clearance
