// Unauthenticated peers at a TCP endpoint, with ZMTP 3 (https://rfc.zeromq.org/spec/23) implemented without a library.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "wire/shm_os.h"

namespace clearance {

class RawTcp {
 public:
  /// \param url tcp://127.0.0.1:PORT
  explicit RawTcp(const std::string& url) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(url.substr(url.rfind(':') + 1))));
    if (::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error(std::string("connect: ") + std::strerror(errno));
  }

  /// Sends bytes. Returns whether all were accepted before the other end hung up.
  bool send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t sent = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent < 0 && errno == EINTR) continue;
      if (sent <= 0) return false;
      bytes.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }
  /// Sends as much as the other end accepts at once. Returns false if it has hung up.
  bool send_some(std::string_view bytes) {
    const ssize_t sent = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    return sent >= 0 || errno == EAGAIN || errno == EINTR;
  }
  /// Waits until the other end has hung up, and discards its data. Returns false if it has not in that time.
  bool is_hung_up(std::chrono::milliseconds patience) {
    const auto deadline = std::chrono::steady_clock::now() + patience;
    for (char sink[4096];;) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
      pollfd readable{socket_.get(), POLLIN, 0};
      if (left.count() <= 0 || ::poll(&readable, 1, static_cast<int>(left.count())) == 0) return false;
      const ssize_t got = ::recv(socket_.get(), sink, sizeof sink, 0);
      if (got == 0 || (got < 0 && errno != EINTR)) return true;
    }
  }

  /// \param mechanism "NULL" or "CURVE"
  static std::string greeting(std::string_view mechanism) {
    std::string bytes(64, '\0');
    bytes[0] = '\xFF';
    bytes[9] = '\x7F';
    bytes[10] = 3;
    std::memcpy(bytes.data() + 12, mechanism.data(), mechanism.size());
    return bytes;
  }
  /// The head of a frame with a size of eight bytes.
  /// \param flags 1 if more parts follow, 4 for a command
  static std::string head(unsigned flags, std::uint64_t bytes) {
    std::string text(1, static_cast<char>(flags | 2));
    for (int shift = 56; shift >= 0; shift -= 8) text += static_cast<char>(bytes >> shift);
    return text;
  }
  /// Bytes that a client without keys sends before its first message.
  static std::string handshake() {
    using namespace std::string_literals;
    const std::string ready = "\5READY\13Socket-Type\0\0\0\6DEALER\10Identity\0\0\0\0"s;
    return greeting("NULL") + head(4, ready.size()) + ready;
  }

 private:
  shm::UniqueFd socket_;
};

}  // namespace clearance
