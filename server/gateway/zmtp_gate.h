// How much a connection may say before it has shown who it is.
//
// libzmq knows one limit for a message, and it counts before the CURVE handshake too: a stranger may announce 256 MiB
// and send them, over each of many connections. A client that follows the protocol (ZMTP 3,
// https://rfc.zeromq.org/spec/23, and CURVE, spec/26) says until then a greeting of 64 bytes and two commands, HELLO
// and INITIATE; libzmq reads no further before it has found the second one to be right.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace clearance::gateway {

/// One connection's beginning.
class ZmtpGate {
 public:
  static constexpr std::size_t kGreetingBytes = 64;
  static constexpr std::uint64_t kMaxCommandBytes = 4096;

  /// Takes the next bytes that the stranger sends, as they come. False: he is none of ours.
  bool pass(std::span<const std::byte> bytes);
  /// Whether both commands have passed; what comes then is libzmq's affair.
  bool is_open() const { return commands_ == 2; }

 private:
  bool pass_head(std::uint8_t byte);

  std::uint32_t at_ = 0;        // in the greeting, then in the head of a command
  std::uint32_t commands_ = 0;  // that have passed
  bool long_ = false, in_body_ = false;
  std::uint64_t left_ = 0;  // of a command's body
};

/// Has this process's connections looked at in that way: those that accept4() gives from here on. Without, none is.
void guard_connections();
/// Connections with descriptors from this one on are hung up on.
void refuse_connections_from(int descriptor);

}  // namespace clearance::gateway
