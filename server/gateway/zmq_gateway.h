// ZeroMQ over TCP, outside of the daemon: connections, handshakes and libzmq's memory.
#pragma once

#include "server/gateway/link.h"

namespace clearance::gateway {

/// Serves the listener (confine.h) as configured by kStart, until the daemon has gone (Broken).
[[noreturn]] void serve_zmq(Link& link, const Message& start);

}  // namespace clearance::gateway
