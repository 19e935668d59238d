// Calls of libzmq that a signal may interrupt (EINTR), made again until they are through: SIGHUP must not cost a
// message its second half, nor SIGTERM end in an error.
#pragma once

#include <cerrno>
#include <zmq.hpp>

namespace clearance {

template <class Call>
auto uninterrupted(Call call) {
  for (;;) try {
      return call();
    } catch (const zmq::error_t& error) {
      if (error.num() != EINTR) throw;
    }
}

/// Whether a message can be received.
inline bool has_input(const zmq::socket_t& socket) {
  return uninterrupted([&] { return (socket.get(zmq::sockopt::events) & ZMQ_POLLIN) != 0; });
}

/// False if there is none, and only with zmq::recv_flags::dontwait.
inline bool receive(zmq::socket_t& socket, zmq::message_t& part, zmq::recv_flags flags) {
  return uninterrupted([&] { return socket.recv(part, flags).has_value(); });
}

/// False if it cannot be sent now, and only with zmq::send_flags::dontwait.
inline bool send(zmq::socket_t& socket, zmq::message_t& part, zmq::send_flags flags) {
  return uninterrupted([&] { return socket.send(part, flags).has_value(); });
}

}  // namespace clearance
