// A small server for tests of the shared-memory transport that echoes, delays or drops frames, as configured.
#pragma once

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "client/channel/channel.h"
#include "client/client.h"
#include "server/shm/shm_transport.h"
#include "tests/temporary_folder.h"
#include "wire/shm_os.h"

namespace clearance {

using namespace std::chrono_literals;

inline Deadline soon() {
  return std::chrono::steady_clock::now() + 30s;
}

/// Answers kPing with the same payload, or, if the header's scene_revision is not 0, with a pattern of that many bytes.
class EchoRequestHandler final : public RequestHandler {
 public:
  enum class Mode { kEcho, kHold, kDrop };
  struct Held {
    wire::FrameHeader header;
    std::vector<std::byte> payload;
    std::unique_ptr<ReplySink> sink;
  };

  void on_frame(const wire::FrameHeader& header, std::span<const std::byte> payload,
                std::unique_ptr<ReplySink> sink) override {
    ++frames;
    if (mode == Mode::kHold || frames > hold_after)
      held.push_back({header, {payload.begin(), payload.end()}, std::move(sink)});
    else if (mode == Mode::kEcho)
      answer(header, payload, *sink);
  }
  PoseUpdateResult on_poses(std::span<const BodyPose>, std::int64_t, std::int64_t, std::uint64_t) override {
    return {};
  }
  PoseUpdateResult on_joints(std::span<const JointPosition>, std::int64_t, std::int64_t, std::uint64_t) override {
    return {};
  }
  std::uint64_t& counter(const std::string& name) override { return counters[name]; }
  engine::Engine& engine() override { throw std::logic_error("this server has no engine"); }

  void answer_held(std::size_t i) { answer(held[i].header, held[i].payload, *held[i].sink); }

  static void answer(const wire::FrameHeader& requested, std::span<const std::byte> payload, ReplySink& sink) {
    wire::FrameHeader header;
    header.request_id = requested.request_id;
    header.type = static_cast<std::uint16_t>(wire::FrameType::kPong);
    header.payload_bytes = requested.scene_revision ? requested.scene_revision : payload.size();
    const std::uint64_t bytes = sizeof header + header.payload_bytes;
    std::byte* room = sink.reserve(bytes);
    if (!room) {
      wire::ErrorHeader error;
      error.code = static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge);
      error.needed_bytes = bytes;
      header.type = static_cast<std::uint16_t>(wire::FrameType::kError);
      header.payload_bytes = sizeof error;
      room = sink.reserve(sizeof header + sizeof error);
      std::memcpy(room, &header, sizeof header);
      std::memcpy(room + sizeof header, &error, sizeof error);
      return sink.publish(sizeof header + sizeof error);
    }
    std::memcpy(room, &header, sizeof header);
    if (requested.scene_revision)
      std::memset(room + sizeof header, static_cast<int>(requested.request_id & 0xFF), header.payload_bytes);
    else if (!payload.empty())
      std::memcpy(room + sizeof header, payload.data(), payload.size());
    sink.publish(bytes);
  }

  Mode mode = Mode::kEcho;
  std::uint64_t hold_after = ~std::uint64_t{0};  ///< frames beyond this number are held back in any mode
  std::vector<Held> held;
  std::uint64_t frames = 0;
  std::map<std::string, std::uint64_t> counters;
};

/// A transport and its handler, with a loop that sleeps like the daemon's. Run it directly, or as an EchoThread.
class EchoServer {
 public:
  explicit EchoServer(const std::string& path, const ShmLimits& limits = {})
      : transport(make_shm_transport(path, limits)) {}

  /// Serves all pending requests.
  void serve() {
    while (transport->poll(handler) > 0) {
    }
    transport->tick(handler);
  }
  /// Sleeps until there is something to serve. Returns false if nothing came within `timeout`.
  /// \param extra a descriptor to wait for as well; -1 for none
  bool sleep(std::chrono::milliseconds timeout, int extra = -1) {
    if (transport->prepare_sleep()) return true;
    std::vector<pollfd> waiting;
    for (const int fd : transport->descriptors()) waiting.push_back({fd, POLLIN, 0});
    if (extra >= 0) waiting.push_back({extra, POLLIN, 0});
    const int ready = ::poll(waiting.data(), waiting.size(), static_cast<int>(timeout.count()));
    transport->finish_sleep();
    return ready != 0;
  }
  /// Serves until `done`, which is tested before every sleep. Fails the test if nothing happens for a long time.
  template <class Done>
  void run_until(Done done, int extra = -1) {
    for (;;) {
      serve();
      if (done()) return;
      if (!sleep(30s, extra)) {
        ADD_FAILURE() << "nothing happened for 30 s";
        return;
      }
    }
  }

  std::unique_ptr<Transport> transport;
  EchoRequestHandler handler;
};

/// An EchoServer in its own thread.
class EchoThread {
 public:
  explicit EchoThread(const std::string& path, const ShmLimits& limits = {})
      : server_(path, limits), wake_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)), thread_([this] { run(); }) {}
  ~EchoThread() { stop(); }

  /// Runs `task` on the server's thread and waits for it.
  template <class Task>
  auto call(Task task) {
    std::packaged_task<decltype(task(std::declval<EchoServer&>()))(EchoServer&)> packaged(std::move(task));
    auto result = packaged.get_future();
    {
      const std::lock_guard lock(mutex_);
      tasks_.push_back([&packaged](EchoServer& server) { packaged(server); });
    }
    wake();
    return result.get();
  }
  void set_mode(EchoRequestHandler::Mode mode) {
    call([mode](EchoServer& s) { s.handler.mode = mode; });
  }
  /// Waits until this many requests are held back.
  void await_held(std::size_t count) {
    while (call([](EchoServer& s) { return s.handler.held.size(); }) < count) std::this_thread::yield();
  }
  std::uint64_t counter(const std::string& name) {
    return call([&](EchoServer& s) { return s.handler.counters[name]; });
  }
  /// Sleeps of the loop that timed out: each is a lost wake-up.
  int idle_timeouts() const { return idle_timeouts_; }
  void stop() {
    if (!thread_.joinable()) return;
    stopping_ = true;
    wake();
    thread_.join();
  }

 private:
  void wake() {
    const std::uint64_t one = 1;
    ASSERT_EQ(::write(wake_.get(), &one, sizeof one), ssize_t{sizeof one});
  }
  void run() {
    while (!stopping_) {
      std::vector<std::function<void(EchoServer&)>> tasks;
      {
        const std::lock_guard lock(mutex_);
        tasks.swap(tasks_);
      }
      for (auto& task : tasks) task(server_);
      server_.serve();
      if (!server_.sleep(20s, wake_.get())) ++idle_timeouts_;
      std::uint64_t count;
      [[maybe_unused]] const ssize_t drained = ::read(wake_.get(), &count, sizeof count);
    }
  }

  EchoServer server_;
  shm::UniqueFd wake_;
  std::mutex mutex_;
  std::vector<std::function<void(EchoServer&)>> tasks_;
  std::atomic<bool> stopping_{false};
  std::atomic<int> idle_timeouts_{0};
  std::thread thread_;
};

inline std::vector<std::byte> random_bytes(std::size_t size, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<std::byte> bytes(size);
  std::size_t i = 0;
  for (; i + 8 <= size; i += 8) {
    const std::uint64_t word = random();
    std::memcpy(bytes.data() + i, &word, 8);
  }
  for (; i < size; ++i) bytes[i] = static_cast<std::byte>(random());
  return bytes;
}

/// Sends a kPing.
/// \param reply_bytes if not 0, the size of the payload to return (EchoRequestHandler)
/// \param hint expected reply size for begin()
inline void send_ping(Channel& channel, std::uint64_t id, std::span<const std::byte> payload,
                      std::uint64_t reply_bytes = 0, std::uint64_t hint = 0) {
  wire::FrameHeader header;
  header.type = static_cast<std::uint16_t>(wire::FrameType::kPing);
  header.request_id = id;
  header.payload_bytes = payload.size();
  header.scene_revision = reply_bytes;
  std::byte* room = channel.begin(sizeof header + payload.size(), hint);
  std::memcpy(room, &header, sizeof header);
  if (!payload.empty()) std::memcpy(room + sizeof header, payload.data(), payload.size());
  channel.send();
}

/// Returns whether the reply to a ping came with `payload`.
inline ::testing::AssertionResult echoes(Channel& channel, std::uint64_t id, std::span<const std::byte> payload) {
  const auto frame = channel.receive(id, soon());
  if (!frame) return ::testing::AssertionFailure() << "no reply to " << id;
  if (frame->header().request_id != id) return ::testing::AssertionFailure() << "the reply is another's";
  if (frame->header().type != static_cast<std::uint16_t>(wire::FrameType::kPong))
    return ::testing::AssertionFailure() << "reply of type " << frame->header().type;
  const auto got = frame->payload();
  if (reinterpret_cast<std::uintptr_t>(got.data()) % 64 != 0)
    return ::testing::AssertionFailure() << "payload is not aligned";
  if (got.size() != payload.size() || (!got.empty() && std::memcmp(got.data(), payload.data(), got.size()) != 0))
    return ::testing::AssertionFailure() << "other bytes came back: " << got.size() << " for " << payload.size();
  return ::testing::AssertionSuccess();
}

/// Open descriptors of this process.
inline std::size_t open_descriptors() {
  const std::filesystem::directory_iterator all("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(all), end(all)));
}

/// Mapped segments of this process.
inline std::size_t mapped_segments() {
  std::ifstream maps("/proc/self/maps");
  std::size_t count = 0;
  for (std::string line; std::getline(maps, line);) count += line.find("clearance-shm") != std::string::npos;
  return count;
}

}  // namespace clearance
