// Asked by libzmq whether a key may come in: ZeroMQ's authentication protocol (https://rfc.zeromq.org/spec/27).
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>
#include <zmq.hpp>

#include "key_ring.h"
#include "transport.h"

namespace clearance {

/// Made before a socket of the same context listens. On the loop's thread.
class ZapHandler {
 public:
  ZapHandler(zmq::context_t& context, std::shared_ptr<KeyRing> keys);

  /// Has a socket (not yet listening) take encrypted connections of known keys alone, and tell of those that fail.
  void guard(zmq::socket_t& socket);
  /// Readable when serve() may have work.
  std::vector<int> descriptors() const;
  bool has_work() const;
  /// Answers those who knock.
  void serve(Inbox& inbox);
  /// What the sender of a message may do: by its key, as the list of keys is now.
  Rights rights_of(const zmq::message_t& message) const;
  /// Its key; empty if it has none.
  static std::string key_of(const zmq::message_t& message);
  /// Looks whether the list of keys has changed.
  void refresh();

 private:
  void answer(Inbox& inbox);
  void read_event(Inbox& inbox);
  void complain(Inbox& inbox, const std::string& what);

  zmq::socket_t socket_, monitor_;
  std::shared_ptr<KeyRing> keys_;
  std::chrono::steady_clock::time_point next_line_{};
  std::uint64_t unsaid_ = 0;
};

}  // namespace clearance
