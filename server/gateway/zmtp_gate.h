// Bounds the data that a connection may send before it is authenticated.
//
// libzmq's limit for a message applies before the CURVE handshake, too: an unauthenticated peer may announce and send
// 256 MiB over each of many connections. A client that follows the protocol (ZMTP 3, https://rfc.zeromq.org/spec/23,
// and CURVE, spec/26) sends until then a greeting of 64 bytes and two commands, HELLO and INITIATE, and libzmq reads no
// further before it has accepted the second.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace clearance::gateway {

/// The beginning of one connection.
class ZmtpGate {
 public:
  static constexpr std::size_t kGreetingBytes = 64;
  static constexpr std::uint64_t kMaxCommandBytes = 4096;

  /// Checks the peer's next bytes. Returns false if they break the protocol.
  bool pass(std::span<const std::byte> bytes);
  /// Whether both commands have passed. libzmq checks the rest.
  bool is_open() const { return commands_ == 2; }

 private:
  bool pass_head(std::uint8_t byte);

  std::uint32_t at_ = 0;        // in the greeting, then in the head of a command
  std::uint32_t commands_ = 0;  // passed so far
  bool long_ = false, in_body_ = false;
  std::uint64_t left_ = 0;  // of a command's body
};

/// Guards the connections of this process that accept4() returns from here on.
void guard_connections();
/// Closes connections with descriptors from this one on.
void reject_connections_from(int descriptor);

}  // namespace clearance::gateway
