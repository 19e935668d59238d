// The ROUTER that clients connect to, in the daemon or outside of it.
#pragma once

#include <cstdint>
#include <zmq.hpp>

namespace clearance {

/// Messages that may wait inside ZeroMQ, per client: requests not yet taken, replies not yet sent.
/// A client may ask many things before it reads the first reply, and ZeroMQ's thread may be late: room for a reply to
/// each (clients stop there, too). What small ones take of all connections, a process outside has to have in memory.
inline constexpr int kZmqReceiveQueue = 64;
inline constexpr int kZmqSendQueue = 1024;
/// Connections that wait to be taken, as libzmq's own.
inline constexpr int kZmqBacklog = 100;
/// Replies up to this size are copied into the message, larger ones handed over.
inline constexpr std::uint64_t kZmqCopyBytes = 256;

inline void set_router_options(zmq::socket_t& socket, std::uint64_t max_message_bytes) {
  socket.set(zmq::sockopt::linger, 0);
  socket.set(zmq::sockopt::router_mandatory, 1);
  socket.set(zmq::sockopt::maxmsgsize, static_cast<std::int64_t>(max_message_bytes));
  socket.set(zmq::sockopt::rcvhwm, kZmqReceiveQueue);
  socket.set(zmq::sockopt::sndhwm, kZmqSendQueue);
}

}  // namespace clearance
