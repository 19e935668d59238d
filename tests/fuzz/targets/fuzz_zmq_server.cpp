// A ZeroMQ client with arbitrary framing and names, and peers that do not use ZeroMQ at all: each message is answered
// once, by a frame that a client accepts, and the next client is served.
#include <sys/socket.h>
#include <sys/un.h>

#include <chrono>
#include <optional>
#include <utility>
#include <zmq.hpp>

#include "server/core/loop.h"
#include "tests/fuzz/frames.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/server/core/memory_transport.h"
#include "tests/server/test_scene.h"
#include "wire/shm_os.h"
#include "wire/zmq_calls.h"

namespace clearance::fuzz {
namespace {

class Dealer {
 public:
  Dealer(const std::string& url, Bytes identity) {
    static zmq::context_t context;
    socket_ = zmq::socket_t(context, zmq::socket_type::dealer);
    socket_.set(zmq::sockopt::linger, 0);
    // A name that begins with 0 is reserved for libzmq, which rejects it.
    if (!identity.empty() && identity[0] != std::byte{0})
      socket_.set(zmq::sockopt::routing_id,
                  std::string(reinterpret_cast<const char*>(identity.data()), identity.size()));
    socket_.connect(url);
  }
  void send(Bytes part, bool more) {
    zmq::message_t message(part.data(), part.size());
    clearance::send(socket_, message,
                    more ? zmq::send_flags::sndmore : zmq::send_flags::none);  // libFuzzer's clock sends signals
  }
  void send_frame(Bytes frame) {
    send(frame.first(sizeof(wire::FrameHeader)), true);
    send(frame.subspan(sizeof(wire::FrameHeader)), false);
  }
  /// Type of a reply, if one has arrived.
  std::optional<wire::FrameType> receive() {
    zmq::message_t head, payload;
    if (!clearance::receive(socket_, head, zmq::recv_flags::dontwait)) return std::nullopt;
    require(head.more() && head.size() == sizeof(wire::FrameHeader), "a reply begins with its header");
    clearance::receive(socket_, payload, zmq::recv_flags::none);
    require(!payload.more(), "a reply has two parts");
    wire::FrameHeader header;
    std::memcpy(&header, head.data(), sizeof header);
    wire::check_header(header, payload.size());
    return static_cast<wire::FrameType>(header.type);
  }

 private:
  zmq::socket_t socket_;
};

/// Serves until `dealer` has `count` replies. Returns whether none of them is an error.
bool serve(Loop& loop, Dealer& dealer, int count) {
  using Clock = std::chrono::steady_clock;
  Clock::duration waited{};  // excludes the time in which this process did not run
  auto last = Clock::now();
  bool good = true;
  for (int got = 0; got < count;) {
    loop.turn();
    while (const auto type = dealer.receive()) {
      require(++got <= count, "a message is answered once");
      good &= *type != wire::FrameType::kError;
    }
    const auto now = Clock::now();
    waited += std::min<Clock::duration>(now - std::exchange(last, now), std::chrono::milliseconds(10));
    require(waited < std::chrono::seconds(15), "each message is answered");
  }
  return good;
}

/// A peer at the same socket that sends these bytes and hangs up.
void say(const std::string& path, Bytes bytes) {
  sockaddr_un address;
  require(shm::socket_address(path.c_str(), address), "the socket's path is short");
  const shm::UniqueFd socket(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) return;
  [[maybe_unused]] const auto sent = ::send(socket.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
}

}  // namespace
}  // namespace clearance::fuzz

/// [name's length 1 B | name], then steps, [kind 1 B | its arguments]. Accepted if every message was a request that is
/// answered.
CLEARANCE_FUZZ_TARGET(zmq_server) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static const ScratchFolder folder;
  const std::string path = folder / "z", url = "ipc://" + path;
  engine::Engine::Options options;
  options.threads = 1;
  static const engine::Scene scene = small_scene();
  engine::Engine engine(scene, options);
  Loop loop(engine, on_one_thread());
  loop.add(make_zmq_transport(url));

  Input in(bytes);
  const Bytes name = in.take(in.number<std::uint8_t>());
  Dealer dealer(url, name);
  const wire::FrameHeader ping = wire::make_header(wire::FrameType::kPing, 1, 0);
  dealer.send_frame(std::as_bytes(std::span(&ping, 1)));
  serve(loop, dealer, 1);  // registers its name
  int sent = 0;
  bool polite = true;
  for (int step = 0; !in.empty() && step < 16; ++step) switch (in.number<std::uint8_t>() % 4) {
      case 0:
        dealer.send_frame(next_frame(in).bytes);
        ++sent;
        break;
      case 1: {  // arbitrary parts
        int parts = in.number<std::uint8_t>() % 6;
        for (; parts > 0; --parts) dealer.send(in.take(in.number<std::uint16_t>()), true);
        dealer.send(in.take(in.number<std::uint16_t>()), false);
        ++sent;
        break;
      }
      case 2:
        say(path, in.take(in.number<std::uint16_t>()));
        polite = false;
        break;
      case 3: {  // the same name again
        Dealer other(url, name);
        other.send_frame(next_frame(in).bytes);
        loop.turn();
        polite = false;
        break;
      }
    }
  const bool good = serve(loop, dealer, sent);
  Dealer next(url, {});
  next.send_frame(std::as_bytes(std::span(&ping, 1)));
  require(serve(loop, next, 1), "the next client is answered");
  return sent > 0 && good && polite;
}
