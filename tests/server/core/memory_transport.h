// A transport inside the test's process: frames go into one queue, replies into another.
#pragma once

#include <sys/eventfd.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <deque>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "client/channel/channel.h"
#include "client/client.h"
#include "server/core/loop.h"
#include "server/requests/transport.h"
#include "wire/aligned_buffer.h"
#include "wire/wire.h"

namespace clearance {

/// A loop without workers, so that a test counts slices by its turns, and a turn without effect shows that it is idle.
inline Loop::Options on_one_thread() {
  Loop::Options options;
  options.worker_thread = false;
  return options;
}

/// A received frame.
class MemoryFrame final : public Frame {
 public:
  MemoryFrame(const std::byte* frame, std::uint64_t bytes) {
    wire::split_frame({frame, bytes}, header_);
    payload_ = aligned_bytes(header_.payload_bytes + 1);
    std::memcpy(payload_.get(), frame + sizeof header_, header_.payload_bytes);
  }
  const wire::FrameHeader& header() const override { return header_; }
  std::span<const std::byte> payload() const override { return {payload_.get(), header_.payload_bytes}; }
  /// The payload without its records.
  std::span<const std::byte> body() const { return wire::split_payload(header_, payload()).body; }
  wire::FrameType type() const { return static_cast<wire::FrameType>(header_.type); }

 private:
  wire::FrameHeader header_;
  AlignedBytes payload_;
};

/// A client controlled by the test.
struct MemoryClient {
  std::uint64_t id = next_client_id();
  bool alive = true;
  bool is_local = true;   ///< on the daemon's machine, according to the daemon
  bool sees_end = false;  ///< whether the daemon sees its end at once, and so keeps its queries
  Rights rights = kAllRights;
  std::uint64_t room = std::numeric_limits<std::uint64_t>::max();  ///< bytes of the largest frame that it accepts
  std::deque<std::unique_ptr<MemoryFrame>> replies;
  int sinks = 0;  ///< requests that have been neither answered nor dropped
};

/// Used from the loop's thread, except send(), wait_for_reply() and sleeps.
class MemoryTransport final : public Transport {
 public:
  MemoryTransport() : wake_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)), replied_(eventfd(0, EFD_CLOEXEC)) {}
  ~MemoryTransport() override {
    close(wake_);
    close(replied_);
  }

  void send(MemoryClient& client, std::vector<std::byte> frame) {
    const std::lock_guard lock(mutex_);
    arrived_.emplace_back(&client, std::move(frame));
    const std::uint64_t one = 1;
    if (write(wake_, &one, sizeof one) != sizeof one) std::abort();
  }
  /// Blocks until a reply was published.
  void wait_for_reply() const {
    std::uint64_t count;
    if (read(replied_, &count, sizeof count) != sizeof count) std::abort();
  }
  /// Number of times that the loop was about to sleep.
  std::atomic<int> sleeps{0};
  /// Payloads are passed at an odd address, as by a transport that aligns nothing.
  bool unaligned = false;

  std::string url() const override { return "memory://"; }
  std::vector<int> descriptors() const override { return {wake_}; }
  bool prepare_sleep() override {
    ++sleeps;
    return false;
  }
  int poll(RequestHandler& handler) override {
    std::uint64_t count;
    [[maybe_unused]] const auto got = read(wake_, &count, sizeof count);
    std::deque<std::pair<MemoryClient*, std::vector<std::byte>>> arrived;
    {
      const std::lock_guard lock(mutex_);
      arrived.swap(arrived_);
    }
    for (auto& [client, frame] : arrived) {
      wire::FrameHeader header;
      std::memcpy(&header, frame.data(), sizeof header);
      const std::size_t size = frame.size() - sizeof header;
      if (size > kLargePayload) {
        const auto own = std::make_shared<std::vector<std::byte>>(std::move(frame));
        const OwnPayload payload{{own, own->data() + sizeof header}, size};
        handler.on_large_frame(header, size, [payload] { return payload; }, std::make_unique<Sink>(*this, *client));
        continue;
      }
      const AlignedBytes copy = aligned_bytes(size + 1);
      std::memcpy(copy.get() + unaligned, frame.data() + sizeof header, size);
      handler.on_frame(header, {copy.get() + unaligned, size}, std::make_unique<Sink>(*this, *client));
    }
    return static_cast<int>(arrived.size());
  }

 private:
  class Sink final : public ReplySink {
   public:
    Sink(MemoryTransport& transport, MemoryClient& client) : transport_(transport), client_(client) { ++client_.sinks; }
    ~Sink() override { --client_.sinks; }
    std::byte* reserve(std::uint64_t frame_bytes) override {
      if (frame_bytes > client_.room) return nullptr;
      reserved_ = frame_bytes;
      room_ = aligned_bytes(frame_bytes);
      return room_.get();
    }
    void publish(std::uint64_t frame_bytes) override {
      if (frame_bytes > reserved_) std::abort();
      client_.replies.push_back(std::make_unique<MemoryFrame>(room_.get(), frame_bytes));
      const std::uint64_t one = 1;
      if (write(transport_.replied_, &one, sizeof one) != sizeof one) std::abort();
    }
    bool alive() const override { return client_.alive; }
    std::uint64_t client() const override { return client_.id; }
    Rights rights() const override { return client_.rights; }
    std::function<bool()> watch() const override {
      if (!client_.is_local) return nullptr;
      return [&client = client_] { return client.alive; };
    }
    bool sees_end() const override { return client_.sees_end; }

   private:
    MemoryTransport& transport_;
    MemoryClient& client_;
    AlignedBytes room_;
    std::uint64_t reserved_ = 0;
  };

  std::mutex mutex_;
  std::deque<std::pair<MemoryClient*, std::vector<std::byte>>> arrived_;
  int wake_, replied_;
};

/// The parts of a query as a client sends them.
struct TestQuery {
  wire::QueryHeader header;
  std::vector<IdPair> pairs;
  std::vector<std::uint32_t> bodies;
  std::vector<Pose7> configurations;
  std::vector<std::uint32_t> joints;
  std::vector<double> positions, weights;
  std::vector<std::byte> records;
  std::uint64_t scene_revision = 0, flags = 0;
  std::uint32_t plan_configurations = 0;  ///< for kOpenPlan, which has no configurations itself

  TestQuery() { header.max_distance = std::numeric_limits<double>::infinity(); }
  std::vector<std::byte> frame(std::uint64_t request_id, wire::FrameType type = wire::FrameType::kQuery) const {
    wire::QueryHeader q = header;
    q.all_pairs = q.all_pairs && pairs.empty();
    q.pair_count = static_cast<std::uint32_t>(pairs.size());
    q.body_count = static_cast<std::uint32_t>(bodies.size());
    const auto rows = [](std::size_t given, std::size_t each) {
      return static_cast<std::uint32_t>(each ? given / each : 0);
    };
    q.configuration_count = type == wire::FrameType::kOpenPlan ? plan_configurations
                                                               : std::max(rows(configurations.size(), bodies.size()),
                                                                          rows(positions.size(), joints.size()));
    const bool has_configurations = wire::has_configurations(type);
    const std::uint64_t payload =
        wire::query_payload_bytes(q.pair_count, q.body_count, has_configurations ? q.configuration_count : 0);
    std::vector<std::byte> all_records = records;
    wire::insert_inputs(
        all_records,
        {.joints = joints, .positions = std::span(positions).first(has_configurations ? positions.size() : 0)});
    if (!weights.empty())
      wire::insert_record(all_records, static_cast<std::uint16_t>(wire::QueryRecord::kWeights), wire::kRecordRequired,
                          std::as_bytes(std::span(weights)));
    std::vector<std::byte> bytes(sizeof(wire::FrameHeader) + payload + all_records.size());
    auto frame_header =
        wire::with_records(wire::make_header(type, request_id, payload, scene_revision), all_records.size());
    frame_header.flags = flags;
    wire::write_query(bytes.data(), frame_header, q, pairs.data(), bodies.data(), configurations.data(), all_records);
    return bytes;
  }
};

/// A frame whose payload is one record, or empty.
inline std::vector<std::byte> simple_frame(wire::FrameType type, std::uint64_t request_id,
                                           std::span<const std::byte> payload = {}) {
  return wire::FrameBuilder(wire::make_header(type, request_id, 0)).add_bytes(payload.data(), payload.size()).take();
}
/// The same request with records by tag behind its payload.
inline std::vector<std::byte> extended(std::span<const std::byte> frame, std::span<const std::byte> records) {
  wire::FrameHeader header;
  std::memcpy(&header, frame.data(), sizeof header);
  return wire::FrameBuilder(wire::with_records(header, records.size()))
      .add_bytes(frame.data() + sizeof header, frame.size() - sizeof header)
      .add_bytes(records.data(), records.size())
      .take();
}

}  // namespace clearance
