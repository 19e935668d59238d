// Baseline of ZeroMQ: a DEALER here, a ROUTER in the echo process, two message parts each way.
#include <unistd.h>

#include <cstring>
#include <stdexcept>
#include <zmq.hpp>

#include "bench/latency/bench_floor.h"
#include "wire/protocol.h"

namespace clearance::cli {
namespace {

constexpr int kTimeoutMs = 5000;
constexpr std::uint64_t kHeader = sizeof(wire::FrameHeader);

/// Sends `bytes` as a header and a payload, copied as from memory outside ZeroMQ.
void send_parts(zmq::socket_t& socket, const std::vector<std::byte>& bytes) {
  socket.send(zmq::buffer(bytes.data(), kHeader), zmq::send_flags::sndmore);
  socket.send(zmq::buffer(bytes.data() + kHeader, bytes.size() - kHeader));
}

/// A temporary folder for an ipc:// endpoint.
class Folder {
 public:
  Folder() {
    char name[] = "/tmp/clearance-bench-XXXXXX";
    if (!::mkdtemp(name)) throw std::runtime_error(std::string("floor: mkdtemp: ") + std::strerror(errno));
    path_ = name;
  }
  ~Folder() {
    ::unlink((path_ + "/echo").c_str());
    ::rmdir(path_.c_str());
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  std::string endpoint() const { return "ipc://" + path_ + "/echo"; }

 private:
  std::string path_;
};

class ZmqFloor final : public Floor {
 public:
  ZmqFloor(const std::string& url, const EchoSize& size)
      : tcp_(url.rfind("tcp://", 0) == 0),
        request_(size.request_bytes),
        echo_({"zmq", tcp_ ? "tcp://127.0.0.1:*" : folder_.endpoint(), std::to_string(size.reply_bytes)}),
        socket_(context_, zmq::socket_type::dealer) {
    socket_.set(zmq::sockopt::linger, 0);
    socket_.set(zmq::sockopt::rcvtimeo, kTimeoutMs);
    socket_.connect(echo_.said());
  }

  bool exchange(std::chrono::nanoseconds held) override {
    request_to_hold(request_.data() + kHeader, held);
    send_parts(socket_, request_);
    for (int part = 0; part < 2; ++part)
      if (!socket_.recv(reply_)) throw std::runtime_error("floor: the echo process does not answer");
    return true;
  }
  std::string description() const override {
    return std::string("DEALER to ROUTER over ") + (tcp_ ? "tcp:// on the loopback interface" : "ipc://") +
           ", two parts each way";
  }

 private:
  bool tcp_;
  Folder folder_;
  std::vector<std::byte> request_;
  EchoProcess echo_;
  zmq::context_t context_;
  zmq::socket_t socket_;
  zmq::message_t reply_;
};

}  // namespace

std::unique_ptr<Floor> open_zmq_floor(const std::string& url, const EchoSize& size) {
  return std::make_unique<ZmqFloor>(url, size);
}

int run_zmq_echo(const std::vector<std::string>& arguments) {
  zmq::context_t context;
  zmq::socket_t socket(context, zmq::socket_type::router);
  socket.set(zmq::sockopt::linger, 0);
  socket.bind(arguments.at(0));
  const std::vector<std::byte> reply(std::stoull(arguments.at(1)));
  const std::string ready = "ready " + socket.get(zmq::sockopt::last_endpoint) + "\n";
  if (::write(STDOUT_FILENO, ready.data(), ready.size()) != static_cast<ssize_t>(ready.size())) return 1;
  ::close(STDOUT_FILENO);
  for (zmq::message_t identity, header, payload;;) {
    if (!socket.recv(identity) || !socket.recv(header) || !socket.recv(payload)) return 1;
    hold(payload.data<std::byte>());
    socket.send(identity, zmq::send_flags::sndmore);
    send_parts(socket, reply);
  }
}

}  // namespace clearance::cli
