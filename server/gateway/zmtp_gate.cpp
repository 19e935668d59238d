#include "server/gateway/zmtp_gate.h"

#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <optional>
#include <vector>

namespace clearance::gateway {
namespace {

// Sized before libzmq's I/O thread begins, the only one that accepts and reads connections.
std::vector<std::optional<ZmtpGate>> gates;  // by descriptor, if guarded
bool guarded = false;
int first_rejected = INT_MAX;

}  // namespace

bool ZmtpGate::pass(std::span<const std::byte> bytes) {
  while (!bytes.empty() && !is_open()) {
    if (in_body_) {
      const std::uint64_t some = std::min<std::uint64_t>(left_, bytes.size());
      left_ -= some;
      bytes = bytes.subspan(some);
      in_body_ = left_ > 0;
      if (!in_body_) ++commands_;
      continue;
    }
    if (!pass_head(std::to_integer<std::uint8_t>(bytes[0]))) return false;
    bytes = bytes.subspan(1);
  }
  return true;
}

/// Passes a byte of the greeting or of a command's head: flags, then its size in one byte or eight.
bool ZmtpGate::pass_head(std::uint8_t byte) {
  constexpr std::uint8_t kCommand = 4, kLong = 2;
  constexpr std::uint32_t kMajorAt = 10;
  if (at_ < kGreetingBytes) {
    if ((at_ == 0 && byte != 0xff) || (at_ == kMajorAt && byte < 3)) return false;
    ++at_;
    return true;
  }
  if (at_ == kGreetingBytes) {
    if ((byte & ~kLong) != kCommand) return false;
    long_ = byte & kLong;
    left_ = 0;
  } else {
    left_ = left_ << 8 | byte;
  }
  if (at_++ < kGreetingBytes + (long_ ? 8 : 1)) return true;
  at_ = kGreetingBytes;
  in_body_ = true;
  return left_ > 0 && left_ <= kMaxCommandBytes;
}

void guard_connections() {
  guarded = true;
}

void reject_connections_from(int descriptor) {
  first_rejected = descriptor;
  gates.resize(static_cast<std::size_t>(descriptor));
}

}  // namespace clearance::gateway

// Replaces the C library's function for libzmq, which gets ECONNABORTED for a client that hung up before it was
// accepted.
extern "C" __attribute__((visibility("default"))) int accept4(int listener, sockaddr* address, socklen_t* length,
                                                              int flags) {
  using namespace clearance::gateway;
  const int socket = static_cast<int>(::syscall(SYS_accept4, listener, address, length, flags));
  if (socket < 0) return socket;
  if (socket >= first_rejected) {
    ::close(socket);
    errno = ECONNABORTED;
    return -1;
  }
  if (guarded) gates[static_cast<std::size_t>(socket)] = ZmtpGate();
  return socket;
}

extern "C" __attribute__((visibility("default"))) int accept(int listener, sockaddr* address, socklen_t* length) {
  return accept4(listener, address, length, 0);
}

// Replaces the C library's function for libzmq. A peer that breaks the protocol before its handshake appears to have
// hung up.
extern "C" __attribute__((visibility("default"))) ssize_t recv(int socket, void* buffer, std::size_t bytes, int flags) {
  using namespace clearance::gateway;
  const ssize_t got = ::syscall(SYS_recvfrom, socket, buffer, bytes, flags, nullptr, nullptr);
  if (got <= 0 || !guarded || socket >= first_rejected) return got;
  std::optional<ZmtpGate>& gate = gates[static_cast<std::size_t>(socket)];
  if (!gate) return got;
  if (!gate->pass({static_cast<const std::byte*>(buffer), static_cast<std::size_t>(got)})) return 0;
  if (gate->is_open()) gate.reset();
  return got;
}
