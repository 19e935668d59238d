// A ZeroMQ server whose answers a test defines, to test the client's reaction.
#pragma once

#include <unistd.h>

#include <atomic>
#include <cstring>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <thread>
#include <vector>
#include <zmq.hpp>

#include "client/channel/channel.h"
#include "wire/wire.h"

namespace clearance {

class ScriptedServer {
 public:
  using Bytes = std::vector<std::byte>;
  /// Returns the frames to send for a request, in order. Called on the server's thread.
  using Answer = std::function<std::vector<Bytes>(const wire::FrameHeader& header, std::span<const std::byte> payload)>;

  /// \param greets answers the client library's own greetings and heartbeats; otherwise the script does
  explicit ScriptedServer(Answer answer, bool greets = true) : answer_(std::move(answer)), greets_(greets) {
    std::string folder = (std::filesystem::temp_directory_path() / "clearance-XXXXXX").string();
    folder_ = mkdtemp(folder.data());
    socket_.set(zmq::sockopt::linger, 0);
    socket_.bind(url());
    thread_ = std::thread([this] { run(); });
  }
  ~ScriptedServer() {
    stop();
    std::filesystem::remove_all(folder_);
  }
  ScriptedServer(const ScriptedServer&) = delete;

  std::string url() const { return "ipc://" + folder_ + "/socket"; }

  /// Ends like a daemon that is killed.
  void stop() {
    stopping_ = true;
    if (thread_.joinable()) thread_.join();
    socket_.close();
  }

 private:
  std::vector<Bytes> answers_to(const wire::FrameHeader& header, std::span<const std::byte> payload) {
    if (!greets_ || header.request_id < kOwnRequests) return answer_(header, payload);
    return {wire::FrameBuilder(wire::make_header(wire::FrameType::kPong, header.request_id, 0)).take()};
  }
  void run() {
    std::vector<zmq::pollitem_t> items{{socket_.handle(), 0, ZMQ_POLLIN, 0}};
    while (!stopping_) {
      if (!zmq::poll(items, std::chrono::milliseconds(10))) continue;
      zmq::message_t identity, head, payload;
      (void)socket_.recv(identity);
      (void)socket_.recv(head);
      (void)socket_.recv(payload);
      wire::FrameHeader header;
      std::memcpy(&header, head.data(), sizeof header);
      for (const Bytes& frame : answers_to(header, {payload.data<std::byte>(), payload.size()})) {
        zmq::message_t to;
        to.copy(identity);
        socket_.send(to, zmq::send_flags::sndmore);
        socket_.send(zmq::buffer(frame.data(), std::min(frame.size(), sizeof header)), zmq::send_flags::sndmore);
        socket_.send(zmq::buffer(frame.data() + sizeof header, frame.size() - sizeof header), zmq::send_flags::none);
      }
    }
  }

  Answer answer_;
  bool greets_;
  std::string folder_;
  zmq::context_t context_;
  zmq::socket_t socket_{context_, zmq::socket_type::router};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace clearance
