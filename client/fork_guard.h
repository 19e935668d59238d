// Notices that this process is a fork of the one that opened a connection.
//
// A connection belongs to one process: its threads, sockets and shared slots are the parent's. The child must neither
// use nor close them, and connect anew.
#pragma once

#include <cstdint>

namespace clearance {

/// Remembers the process that made it.
class ForkGuard {
 public:
  ForkGuard() : generation_(current()) {}
  /// True in a child that was forked since. As cheap as a load: no system call.
  bool forked() const { return generation_ != current(); }

 private:
  static std::uint64_t current();
  std::uint64_t generation_;
};

}  // namespace clearance
