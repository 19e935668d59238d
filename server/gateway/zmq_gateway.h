// ZeroMQ over TCP, outside of the core: connections, handshakes and libzmq's memory are here.
#pragma once

#include "server/gateway/link.h"

namespace clearance::gateway {

/// Serves the listener (confine.h) as the core's kStart says, until the core has gone (Broken).
[[noreturn]] void serve_zmq(Link& link, const Message& start);

}  // namespace clearance::gateway
