// What a process outside of the core may still ask of the kernel.
#pragma once

#include <cstdint>
#include <string>

namespace clearance::gateway {

inline constexpr int kLinkFd = 3, kListenerFd = 4;

/// Limits of memory and descriptors; the first to be ended when the machine has no memory left; ended with the core.
void limit_gateway(std::uint64_t memory_bytes, std::uint64_t descriptors);

/// From here on this process may take connections at its listener, read and write what is open, take memory and end: no
/// file, no program, no process or thread of its own, no other connection, and no descriptor for the core. For all of
/// its threads, and for good. Returns why the kernel refuses that; throws std::runtime_error (CallFilter::enforce()).
std::string confine_to_connections();

/// The same of a process that has yet to open LCM's sockets: UDP, and threads.
std::string confine_to_datagrams();

}  // namespace clearance::gateway
