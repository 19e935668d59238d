// Accepts connections even if no descriptor is left for them.
#pragma once

#include <functional>

namespace clearance {

/// Next connection of a non-blocking listening socket, as from accept4() with SOCK_CLOEXEC and SOCK_NONBLOCK, or -1.
/// Without a free descriptor a connection is accepted with one kept in reserve, passed to `reject`, and closed.
/// Otherwise it would wait and keep the loop awake.
int accept_or_reject(int listener, const std::function<void(int socket)>& reject);

/// Reserves a descriptor for that. libzmq's threads then accept in the same way, by the accept4() of accepting.cpp:
/// libzmq 4.3 ends the process if accept() of a Unix socket fails with EMFILE.
void reserve_descriptor();

}  // namespace clearance
