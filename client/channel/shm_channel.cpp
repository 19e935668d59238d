// A channel over shared memory. shm_layout.h specifies layout and protocol.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "client/channel/channel.h"
#include "client/channel/connection_errors.h"
#include "client/channel/reply_wait.h"
#include "client/channel/shm_options.h"
#include "client/channel/shm_segments.h"
#include "wire/fork_guard.h"
#include "wire/shm_layout.h"
#include "wire/shm_os.h"

namespace clearance {

namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
using shm::UniqueFd;
using State = ClientSegment::State;

/// Timeout of begin() for a larger segment, or for a slot with an abandoned reply.
constexpr std::chrono::seconds kBeginTimeout{5};

class ShmFrame final : public Frame {
 public:
  ShmFrame(SegmentPtr segment, std::uint32_t slot, const wire::FrameHeader& header)
      : segment_(std::move(segment)), slot_(slot), header_(header) {}
  ~ShmFrame() override { segment_->give_slot(slot_); }
  ShmFrame(const ShmFrame&) = delete;
  ShmFrame& operator=(const ShmFrame&) = delete;

  const wire::FrameHeader& header() const override { return header_; }
  std::span<const std::byte> payload() const override {
    return {segment_->reply_area(slot_) + sizeof header_, static_cast<std::size_t>(header_.payload_bytes)};
  }

 private:
  SegmentPtr segment_;
  std::uint32_t slot_;
  wire::FrameHeader header_;
};

/// Returns the size that a reply needs if it reports a lack of space, otherwise 0.
std::uint64_t bytes_needed(const Frame& frame) {
  wire::ErrorHeader error;
  if (frame.header().type != static_cast<std::uint16_t>(wire::FrameType::kError) ||
      frame.payload().size() < sizeof error)
    return 0;
  std::memcpy(&error, frame.payload().data(), sizeof error);
  return error.code == static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge) ? error.needed_bytes : 0;
}

class ShmChannel final : public Channel {
 public:
  ShmChannel(const std::string& target, const ShmOptions& options, Deadline deadline)
      : target_(target), socket_(url(), options), segments_(socket_, url()), wait_(options.spin) {
    ShmSocket::Fds fds = socket_.open(deadline);
    segments_.open(fds[0]);
    wake_ = std::move(fds[1]);
  }

  std::string url() const override { return "shm://" + target_; }
  bool lost() const override { return !socket_.lost().empty(); }
  bool signs_queue_up() const override { return false; }

  std::uint64_t sign_of_life() override {
    if (current().daemon_sleeps()) wake_daemon();
    return current().turns();
  }

  std::byte* begin(std::uint64_t frame_bytes, std::uint64_t reply_bytes) override {
    check_usable();
    abandon_begun();
    segments_.retire_outgrown();
    if (frame_bytes < sizeof(wire::FrameHeader))
      throw std::invalid_argument(url() + ": a frame begins with its header");
    if (frame_bytes > current().request_capacity()) {
      const Deadline deadline = Clock::now() + kBeginTimeout;
      std::string why;
      if (!grow(frame_bytes, reply_bytes, deadline, why) && !grow(frame_bytes, 0, deadline, why))
        throw RequestError(static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge),
                           url() + ": a request of " + std::to_string(frame_bytes) + " bytes does not fit: " + why);
    } else if (reply_bytes > current().reply_capacity() && reply_bytes < rejected_reply_) {
      std::string why;  // the size is an estimate; after a rejection, the reply reports the required size
      if (!grow(frame_bytes, reply_bytes, Clock::now() + kBeginTimeout, why)) rejected_reply_ = reply_bytes;
    }
    begun_.slot = take_slot();
    begun_.segment = segments_.current();
    return current().request_area(static_cast<std::uint32_t>(begun_.slot));
  }

  void send() override {
    check_usable();
    if (!begun_.segment) throw std::logic_error(url() + ": send() without begin()");
    const SegmentPtr segment = std::exchange(begun_.segment, nullptr);
    const auto index = static_cast<std::uint32_t>(std::exchange(begun_.slot, -1));
    wire::FrameHeader header;
    std::memcpy(&header, segment->request_area(index), sizeof header);
    if (header.payload_bytes > segment->request_capacity() - sizeof header) {
      segment->give_slot(index);
      throw std::invalid_argument(url() + ": the frame is larger than the memory that begin() gave");
    }
    ClientSegment::Slot& slot = segment->slots()[index];
    slot.request_id = header.request_id;
    slot.request_bytes = sizeof header + header.payload_bytes;
    post(*segment, index);
  }

  std::unique_ptr<Frame> receive(std::uint64_t request_id, Deadline deadline) override {
    check_fork();
    auto [segment, index] = segments_.find(request_id);
    if (!segment) throw ConnectionError(url() + ": no request " + std::to_string(request_id) + " is under way");
    Deadline began{};
    for (;;) {
      collect();
      const State state = segment->slots()[index].state;
      if (state == State::kArrived) {
        if (began != Deadline{}) wait_.replied(segment->slots()[index].request_bytes, began);
        std::unique_ptr<Frame> frame = take_reply(segment, index);
        if (!send_again(segment, index, *frame)) return frame;
        std::tie(segment, index) = segments_.find(request_id);
        continue;
      }
      if (state == State::kDropped) {
        segment->slots()[index].state = State::kIdle;
        segment->give_slot(index);
        throw ConnectionError(url() + ": the daemon dropped request " + std::to_string(request_id));
      }
      check_daemon();
      if (wait_.look() >= deadline) return nullptr;
      if (began == Deadline{}) began = wait_.last_look();
      wait(*segment, segment->slots()[index].request_bytes, deadline);
      shm::prefetch_to_read(segment->reply_area(index));
    }
  }

  void forget(std::uint64_t request_id) override {
    check_fork();
    const auto [segment, index] = segments_.find(request_id);
    if (!segment) return;
    ClientSegment::Slot& slot = segment->slots()[index];
    slot.forgotten = true;  // the reply will return its slot
    if (slot.state != State::kPosted) {
      slot.state = State::kIdle;
      segment->give_slot(index);
    }
  }

 private:
  struct TakenSlot {
    SegmentPtr segment;
    int slot = -1;
  };

  void check_fork() const {
    if (guard_.forked())
      throw ConnectionError(url() +
                            ": this connection belongs to the process that forked; open a new one in the child");
  }
  void check_daemon() const {
    if (!socket_.lost().empty()) throw ConnectionError(socket_.lost());
  }
  void check_usable() const {
    check_fork();
    check_daemon();
  }

  // --- segments and slots

  bool grow(std::uint64_t request_bytes, std::uint64_t reply_bytes, Deadline deadline, std::string& why) {
    return segments_.grow(request_bytes, reply_bytes, deadline, [this] { return watch(); }, why);
  }
  ClientSegment& current() const { return *segments_.current(); }

  void abandon_begun() {
    if (begun_.segment) begun_.segment->give_slot(static_cast<std::uint32_t>(begun_.slot));
    begun_ = {};
  }

  int take_slot() {
    for (Deadline deadline{};;) {
      collect();
      if (const int slot = current().take_slot(); slot >= 0) return slot;
      std::size_t posted = 0, arrived = 0, forgotten = 0;
      for (const auto& slot : current().slots()) {
        posted += slot.state == State::kPosted && !slot.forgotten;
        arrived += slot.state == State::kArrived || slot.state == State::kDropped;
        forgotten += slot.state == State::kPosted && slot.forgotten;
      }
      const std::size_t count = current().slots().size();
      if (forgotten == 0)
        throw ConnectionError(url() + ": all " + std::to_string(count) + " slots are taken: " + std::to_string(posted) +
                              " requests under way, " + std::to_string(arrived) + " replies not yet received, " +
                              std::to_string(count - posted - arrived) + " replies still held; release some");
      check_daemon();
      const Deadline now = wait_.look();
      if (deadline == Deadline{}) deadline = now + kBeginTimeout;
      if (now >= deadline)
        throw TimeoutError(url() + ": the daemon has not given back the slot of an abandoned request");
      wait(current(), 0, std::min(deadline, watch()));
    }
  }

  // --- requests and replies

  void post(ClientSegment& segment, std::uint32_t slot) {
    if (segment.post(slot)) wake_daemon();
  }

  void wake_daemon() {
    const std::uint64_t one = 1;
    while (::write(wake_.get(), &one, sizeof one) < 0 && errno == EINTR) {
    }
  }

  void collect() {
    if (!segments_.collect()) socket_.lose("the shared segment is corrupted");
  }

  void wait(ClientSegment& segment, std::uint64_t request_bytes, Deadline deadline) {
    if (wait_.wait(segment, request_bytes, deadline)) socket_.look();
  }

  std::unique_ptr<Frame> take_reply(const SegmentPtr& segment, std::uint32_t index) {
    ClientSegment::Slot& slot = segment->slots()[index];
    slot.state = State::kIdle;
    wire::FrameHeader header;
    std::memcpy(&header, segment->reply_area(index), sizeof header);
    auto frame = std::make_unique<ShmFrame>(segment, index, header);
    if (header.magic != wire::kMagic || header.version != wire::kVersion || header.request_id != slot.request_id ||
        header.payload_bytes != slot.reply_bytes - sizeof header)
      throw ConnectionError(url() + ": the reply to request " + std::to_string(slot.request_id) + " is corrupted");
    return frame;
  }

  /// Sends the request again from a larger segment if the reply reports a lack of space. The frame still leases the
  /// slot, so that the request is intact. Returns false to accept the reply.
  bool send_again(const SegmentPtr& segment, std::uint32_t index, const Frame& reply) {
    const ClientSegment::Slot old = segment->slots()[index];
    const std::uint64_t needed = bytes_needed(reply);
    if (needed <= segment->reply_capacity() || needed > wire::kMaxFrameBytes || old.retried || !socket_.lost().empty())
      return false;
    std::string why;
    if ((needed > current().reply_capacity() || old.request_bytes > current().request_capacity()) &&
        !grow(old.request_bytes, needed, Clock::now() + kBeginTimeout, why))
      return false;
    const int slot = current().take_slot();
    if (slot < 0) return false;
    const auto again = static_cast<std::uint32_t>(slot);
    std::memcpy(current().request_area(again), segment->request_area(index), old.request_bytes);
    ClientSegment::Slot& fresh = current().slots()[again];
    fresh.request_id = old.request_id;
    fresh.request_bytes = old.request_bytes;
    fresh.retried = true;
    post(current(), again);
    return true;
  }

  std::string target_;
  ForkGuard guard_;
  ShmSocket socket_;
  ShmSegments segments_;
  UniqueFd wake_;                                     ///< eventfd that wakes the daemon
  TakenSlot begun_;                                   ///< memory given by begin(), until send()
  std::uint64_t rejected_reply_ = ~std::uint64_t{0};  ///< a reply capacity that the daemon has rejected
  ReplyWait wait_;
};

}  // namespace

std::unique_ptr<Channel> open_shm_channel(const std::string& socket_path, Deadline deadline) {
  return std::make_unique<ShmChannel>(socket_path, parse_shm_options(socket_path), deadline);
}

}  // namespace clearance
