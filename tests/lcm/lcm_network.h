// A private LCM network, with an unused port and a sender that bypasses liblcm.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "wire/lcm/lcm_bus.h"

namespace clearance {

inline constexpr const char* kTestGroup = "239.255.76.67";

/// An unused UDP port.
inline std::uint16_t free_udp_port() {
  std::random_device random;
  for (int attempt = 0; attempt < 100; ++attempt) {
    const auto port = static_cast<std::uint16_t>(20000 + random() % 40000);
    sockaddr_in place{};
    place.sin_family = AF_INET;
    place.sin_port = htons(port);
    const int fd = ::socket(AF_INET, SOCK_DGRAM, 0);
    const bool free = ::bind(fd, reinterpret_cast<sockaddr*>(&place), sizeof place) == 0;
    ::close(fd);
    if (free) return port;
  }
  throw std::runtime_error("no free UDP port");
}

/// The address of a private network on this host, or nothing if packets do not come back.
/// \param name begins the prefix of its channels
inline std::optional<LcmAddress> own_lcm_address(const std::string& name) {
  LcmAddress address;
  address.prefix = name + std::to_string(draw_lcm_id()) + "_";
  address.port = free_udp_port();
  try {
    check_multicast(address);
  } catch (const std::runtime_error&) {
    return std::nullopt;
  }
  return address;
}

/// A UDP socket that sends to the test's group without liblcm.
class RawSender {
 public:
  explicit RawSender(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    const unsigned char ttl = 0;
    ::setsockopt(fd_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
    to_.sin_family = AF_INET;
    to_.sin_port = htons(port);
    inet_pton(AF_INET, kTestGroup, &to_.sin_addr);
  }
  ~RawSender() { ::close(fd_); }
  RawSender(const RawSender&) = delete;

  void send(std::span<const std::byte> packet) {
    const auto sent = ::sendto(fd_, packet.data(), packet.size(), 0, reinterpret_cast<sockaddr*>(&to_), sizeof to_);
    if (sent != static_cast<ssize_t>(packet.size())) throw std::runtime_error("cannot send a raw packet");
  }
  /// The datagram of a short LCM message.
  static std::vector<std::byte> datagram(const std::string& channel, std::span<const std::byte> payload) {
    std::vector<std::byte> packet = big_endian({0x4c433032, 1});
    for (const char c : channel) packet.push_back(static_cast<std::byte>(c));
    packet.push_back(std::byte{0});
    packet.insert(packet.end(), payload.begin(), payload.end());
    return packet;
  }
  static std::vector<std::byte> big_endian(std::initializer_list<std::uint32_t> words) {
    std::vector<std::byte> bytes;
    for (const std::uint32_t word : words) {
      for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<std::byte>(word >> shift));
    }
    return bytes;
  }

 private:
  int fd_;
  sockaddr_in to_{};
};

}  // namespace clearance
