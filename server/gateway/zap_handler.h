// ZeroMQ's authentication protocol (https://rfc.zeromq.org/spec/27): passes libzmq's requests on to the daemon, and
// reports failed handshakes.
#pragma once

#include <functional>
#include <string>
#include <zmq.hpp>

namespace clearance::gateway {

/// Made before a socket of the same context listens.
class ZapHandler {
 public:
  struct Callbacks {
    std::function<void(const std::string& address, const std::string& key)> authenticate;  ///< answered by finish()
    std::function<void(const std::string& endpoint)> handshake_failed;
  };
  ZapHandler(zmq::context_t& context, Callbacks callbacks);

  /// Restricts a socket, before it listens, to encrypted connections, and reports failed handshakes.
  void guard(zmq::socket_t& socket, const std::string& secret_key);
  zmq::socket_t& requests() { return socket_; }
  zmq::socket_t& events() { return monitor_; }
  /// Handles a bounded number of requests and events. One peer is authenticated at a time.
  void serve();
  void finish(bool is_authorized);

 private:
  void read_request();
  void read_event();

  Callbacks callbacks_;
  zmq::socket_t socket_, monitor_;
  std::string request_, key_;  // of the peer being authenticated
  bool waits_ = false;
};

/// Key of a message's sender, or empty.
std::string key_of(const zmq::message_t& message);

}  // namespace clearance::gateway
