// Asked by libzmq whether a key may come in: ZeroMQ's authentication protocol (https://rfc.zeromq.org/spec/27). It
// passes the question on, and tells of handshakes that fail.
#pragma once

#include <functional>
#include <string>
#include <zmq.hpp>

namespace clearance::gateway {

/// Made before a socket of the same context listens.
class ZapHandler {
 public:
  struct Core {
    std::function<void(const std::string& address, const std::string& key)> knock;  ///< to be answered by verdict()
    std::function<void(const std::string& endpoint)> handshake_failed;
  };
  ZapHandler(zmq::context_t& context, Core core);

  /// Has a socket (not yet listening) take encrypted connections alone, and tell of those that fail.
  void guard(zmq::socket_t& socket, const std::string& secret_key);
  zmq::socket_t& knocks() { return socket_; }
  zmq::socket_t& events() { return monitor_; }
  /// Takes what both have, a bounded number. One who knocks is asked about at a time.
  void serve();
  void verdict(bool come_in);

 private:
  void read_knock();
  void read_event();

  Core core_;
  zmq::socket_t socket_, monitor_;
  std::string request_, key_;  // of who waits at the door
  bool waits_ = false;
};

/// The key with which the sender of a message came in; empty if it has none.
std::string key_of(const zmq::message_t& message);

}  // namespace clearance::gateway
