// The ROUTER socket that clients connect to, in the daemon or in a gateway.
#pragma once

#include <cstdint>
#include <zmq.hpp>

namespace clearance {

/// Messages that may wait inside ZeroMQ, per client: requests not yet taken and replies not yet sent. A client may send
/// many requests before it reads a reply, and ZeroMQ's thread may be late, so each needs a place for its reply (clients
/// stop there, too). A gateway must have memory for small messages of all connections.
inline constexpr int kZmqReceiveQueue = 64;
inline constexpr int kZmqSendQueue = 1024;
/// Backlog of the listener, as in libzmq.
inline constexpr int kZmqBacklog = 100;
/// Larger replies are handed over instead of copied into the message.
inline constexpr std::uint64_t kZmqCopyBytes = 256;

inline void set_router_options(zmq::socket_t& socket, std::uint64_t max_message_bytes) {
  socket.set(zmq::sockopt::linger, 0);
  socket.set(zmq::sockopt::router_mandatory, 1);
  socket.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(max_message_bytes));
  socket.set(zmq::sockopt::rcvhwm, kZmqReceiveQueue);
  socket.set(zmq::sockopt::sndhwm, kZmqSendQueue);
}

}  // namespace clearance
