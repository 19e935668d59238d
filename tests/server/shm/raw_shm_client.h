// A shared-memory client without the client library, for tests that break the rules, or that die between any two steps.
#pragma once

#include <poll.h>
#include <sys/mman.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>

#include "wire/protocol.h"
#include "wire/shm_layout.h"
#include "wire/shm_os.h"

namespace clearance {

/// Completes the handshake and maps the segment; all further steps are up to the test.
class RawClient {
 public:
  explicit RawClient(const std::string& path, bool hello = true) {
    sockaddr_un address;
    shm::socket_address(path.c_str(), address);
    socket.reset(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error(std::string("connect: ") + std::strerror(errno));
    if (!hello) return;
    send(make(shm::MessageKind::kHello));
    take_segment();
    map();
  }
  /// Receives the answer to a hello: the segment's descriptor and the eventfd.
  void take_segment() {
    std::array<shm::UniqueFd, shm::kMaxPassedFds> fds;
    const shm::Message answer = receive(&fds);
    if (answer.kind != static_cast<std::uint32_t>(shm::MessageKind::kSegment)) throw std::runtime_error(answer.text);
    memfd = std::move(fds[0]);
    wake = std::move(fds[1]);
  }
  void map() {
    bytes = static_cast<std::size_t>(::lseek(memfd.get(), 0, SEEK_END));
    base = static_cast<std::byte*>(::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memfd.get(), 0));
    header = reinterpret_cast<shm::SegmentHeader*>(base);
  }
  ~RawClient() {
    if (base) ::munmap(base, bytes);
  }

  static shm::Message make(shm::MessageKind kind) {
    shm::Message message;
    message.wire_version = wire::kVersion;
    message.kind = static_cast<std::uint32_t>(kind);
    return message;
  }
  void send(const shm::Message& message, std::size_t size = sizeof(shm::Message)) {
    if (::send(socket.get(), &message, size, MSG_NOSIGNAL) != static_cast<ssize_t>(size))
      throw std::runtime_error(std::string("send: ") + std::strerror(errno));
  }
  /// The next message; its kind is 0 if the daemon hung up.
  shm::Message receive(std::array<shm::UniqueFd, shm::kMaxPassedFds>* fds = nullptr) {
    for (;;) {
      pollfd readable{socket.get(), POLLIN, 0};
      if (::poll(&readable, 1, 30000) != 1) throw std::runtime_error("the daemon is silent");
      shm::Message message;
      const ssize_t received = shm::receive_message(socket.get(), message, fds);
      if (received < 0 && errno == ECONNRESET) continue;
      if (received <= 0) return shm::Message{};
      return message;
    }
  }
  /// Posts a request, with valid or arbitrary values.
  void post(std::uint64_t ticket, std::uint64_t frame_bytes, std::uint32_t head) {
    header->requests[posted % shm::kRingEntries].ticket.store(ticket);
    header->requests[posted % shm::kRingEntries].frame_bytes.store(frame_bytes);
    ++posted;
    header->request_head.store(head);
    wake_daemon();
  }
  void wake_daemon() {
    const std::uint64_t one = 1;
    [[maybe_unused]] const ssize_t written = ::write(wake.get(), &one, sizeof one);
  }

  shm::UniqueFd socket, memfd, wake;
  std::byte* base = nullptr;
  std::size_t bytes = 0;
  shm::SegmentHeader* header = nullptr;
  std::uint32_t posted = 0;
};

}  // namespace clearance
