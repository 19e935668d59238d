// Calls of libzmq that are repeated after a signal (EINTR), so that SIGHUP does not lose the second half of a message,
// and SIGTERM does not end in an error.
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

/// Whether a message is available.
inline bool has_input(const zmq::socket_t& socket) {
  return uninterrupted([&] { return (socket.get(zmq::sockopt::events) & ZMQ_POLLIN) != 0; });
}

/// Returns false if there is no message; only with zmq::recv_flags::dontwait.
inline bool receive(zmq::socket_t& socket, zmq::message_t& part, zmq::recv_flags flags) {
  return uninterrupted([&] { return socket.recv(part, flags).has_value(); });
}

/// Returns false if it cannot be sent now; only with zmq::send_flags::dontwait.
inline bool send(zmq::socket_t& socket, zmq::message_t& part, zmq::send_flags flags) {
  return uninterrupted([&] { return socket.send(part, flags).has_value(); });
}

}  // namespace clearance
