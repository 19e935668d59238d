// Limits and system calls of a gateway process.
#pragma once

#include <cstdint>
#include <string>

namespace clearance::gateway {

inline constexpr int kLinkFd = 3, kListenerFd = 4;

/// Limits memory and descriptors. The gateway is the first process to be killed when the machine is out of memory, and
/// ends with the daemon.
void limit_gateway(std::uint64_t memory_bytes, std::uint64_t descriptors);

/// Confines all threads of this process for good to accepting connections at its listener, reading and writing open
/// descriptors, taking memory and ending: no files, programs, processes, new threads or connections, and no descriptors
/// for the daemon. Returns the kernel's reason if it cannot; throws std::runtime_error (CallFilter::enforce()).
std::string confine_to_connections();

/// The same for a process that has yet to open LCM's sockets: UDP and threads are allowed.
std::string confine_to_datagrams();

}  // namespace clearance::gateway
