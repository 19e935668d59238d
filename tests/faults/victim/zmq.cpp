// A victim over ZeroMQ that implements ZMTP 3.0 (rfc.zeromq.org/spec/23) on a Unix socket, to stop between any two
// bytes.
#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "tests/faults/victim/victim.h"
#include "wire/protocol.h"
#include "wire/shm_os.h"

namespace clearance::faults {
namespace {

using Bytes = std::vector<std::byte>;

class Stream {
 public:
  explicit Stream(const std::string& path) {
    sockaddr_un address;
    shm::socket_address(path.c_str(), address);
    socket_.reset(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    if (::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error(std::string("connect: ") + std::strerror(errno));
  }
  void write(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t sent = ::send(socket_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent < 0 && errno == EINTR) continue;
      if (sent <= 0) throw std::runtime_error(std::string("send: ") + std::strerror(errno));
      bytes = bytes.subspan(static_cast<std::size_t>(sent));
    }
  }
  Bytes read(std::size_t count) {
    Bytes bytes(count);
    for (std::size_t at = 0; at < count;) {
      pollfd readable{socket_.get(), POLLIN, 0};
      const int ready = ::poll(&readable, 1, 30000);
      if (ready < 0 && errno == EINTR) continue;
      if (ready == 0) throw std::runtime_error("the daemon is silent");
      const ssize_t got = ::recv(socket_.get(), bytes.data() + at, count - at, 0);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) throw std::runtime_error("the daemon hung up");
      at += static_cast<std::size_t>(got);
    }
    return bytes;
  }
  /// Returns the flags of the next frame, and its size in `bytes`.
  unsigned read_frame_head(std::uint64_t& bytes) {
    const auto flags = std::to_integer<unsigned>(read(1)[0]);
    bytes = 0;
    for (const std::byte b : read(flags & 2 ? 8 : 1)) bytes = bytes << 8 | std::to_integer<std::uint64_t>(b);
    return flags;
  }

 private:
  shm::UniqueFd socket_;
};

Bytes bytes_of(std::string_view text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

Bytes greeting() {
  Bytes bytes(64);
  bytes[0] = std::byte{0xFF};
  bytes[9] = std::byte{0x7F};
  bytes[10] = std::byte{3};
  std::memcpy(bytes.data() + 12, "NULL", 4);
  return bytes;
}

/// A frame of ZMTP: flags, size, body.
Bytes framed(unsigned flags, std::span<const std::byte> body) {
  Bytes bytes{static_cast<std::byte>(flags | 2)};
  for (int shift = 56; shift >= 0; shift -= 8) bytes.push_back(static_cast<std::byte>(body.size() >> shift));
  bytes.insert(bytes.end(), body.begin(), body.end());
  return bytes;
}

Bytes ready_command() {
  using namespace std::string_view_literals;
  return framed(4, bytes_of("\5READY\13Socket-Type\0\0\0\6DEALER\10Identity\0\0\0\0"sv));
}

std::span<const std::byte> half(const Bytes& bytes) {
  return std::span(bytes).first(bytes.size() / 2);
}
std::span<const std::byte> other_half(const Bytes& bytes) {
  return std::span(bytes).subspan(bytes.size() / 2);
}

}  // namespace

void talk_zmq(const std::string& socket_path, const Fate& fate, std::mt19937_64& random) {
  Stream stream(socket_path);
  fate.at("connected");
  const Bytes hello = greeting(), ready = ready_command();
  stream.write(half(hello));
  fate.at("greeting_cut");
  stream.write(other_half(hello));
  stream.read(64);
  fate.at("greeted");
  stream.write(half(ready));
  fate.at("ready_cut");
  stream.write(other_half(ready));
  std::uint64_t bytes = 0;
  if (!(stream.read_frame_head(bytes) & 4)) throw std::runtime_error("the daemon answers with no command");
  stream.read(bytes);
  fate.at("ready");

  const auto parts_of = [](const Bytes& frame) {
    const std::span all(frame);
    return std::pair{framed(1, all.first(sizeof(wire::FrameHeader))),
                     framed(0, all.subspan(sizeof(wire::FrameHeader)))};
  };
  // Reads a message's header part and the start of its payload. Returns the number of remaining bytes.
  const auto begin_reply = [&](std::uint64_t id) {
    std::uint64_t size = 0;
    if (stream.read_frame_head(size) != 1 || size != sizeof(wire::FrameHeader))
      throw std::runtime_error("a reply begins with no header");
    const Bytes head = stream.read(size);
    wire::FrameHeader header;
    std::memcpy(&header, head.data(), sizeof header);
    if (header.type != static_cast<std::uint16_t>(wire::FrameType::kReply) || (id && header.request_id != id))
      throw std::runtime_error("a reply to another request, or none");
    stream.read_frame_head(size);
    return size;
  };
  const auto [head, payload] = parts_of(request_of(100, 3, random));
  stream.write(half(head));
  fate.at("header_cut");
  stream.write(other_half(head));
  fate.at("header_sent");
  stream.write(half(payload));
  fate.at("payload_cut");
  stream.write(other_half(payload));
  fate.at("sent");
  stream.read(begin_reply(100));

  const auto send = [&](std::uint64_t id) {
    const auto [h, p] = parts_of(large_request(id));
    stream.write(h);
    stream.write(p);
  };
  send(200);
  std::uint64_t left = begin_reply(200);
  fate.at("reply_begun");
  stream.read(left / 2);
  fate.at("reply_cut");
  stream.read(left - left / 2);
  fate.at("reply_read");
  for (std::uint64_t id = 300; id < 308; ++id) send(id);
  fate.at("many_sent");
  left = begin_reply(0);
  fate.at("many_begun");
  stream.read(left);
  for (int i = 1; i < 8; ++i) stream.read(begin_reply(0));
}

}  // namespace clearance::faults
