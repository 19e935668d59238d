// A channel over shared memory. shm_layout.h specifies layout and protocol.
#include <poll.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "client/channel.h"
#include "client/client.h"
#include "client/reply_spin.h"
#include "client/shm_client_segment.h"
#include "client/shm_options.h"
#include "wire/fork_guard.h"
#include "wire/shm_layout.h"
#include "wire/shm_os.h"

namespace clearance {

namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
using shm::Message;
using shm::MessageKind;
using shm::UniqueFd;
using SegmentPtr = std::shared_ptr<ClientSegment>;
using State = ClientSegment::State;

/// Interval between reads of the socket while waiting, and so the maximum delay to detect a daemon's death.
constexpr std::chrono::nanoseconds kNap = 10ms;
/// Timeout of begin() for a larger segment, or for a slot with an abandoned reply.
constexpr std::chrono::seconds kBeginTimeout{5};
constexpr int kSpinsPerClockLook = 16;
/// Part of a long spin after which it checks whether another thread needs the core.
constexpr std::chrono::nanoseconds kSpinSlice = 50us;

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
std::uint64_t room_needed(const Frame& frame) {
  wire::ErrorHeader error;
  if (frame.header().type != static_cast<std::uint16_t>(wire::FrameType::kError) ||
      frame.payload().size() < sizeof error)
    return 0;
  std::memcpy(&error, frame.payload().data(), sizeof error);
  return error.code == static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge) ? error.needed_bytes : 0;
}

class ShmChannel final : public Channel {
 public:
  ShmChannel(const std::string& target, Deadline deadline)
      : target_(target),
        options_(parse_shm_options(target)),
        // On one CPU, spinning would block the daemon.
        spins_(std::thread::hardware_concurrency() == 1 ? 0ns : options_.spin) {
    open(deadline);
  }

  std::string url() const override { return "shm://" + target_; }
  bool lost() const override { return !dead_.empty(); }
  bool signs_queue_up() const override { return false; }

  std::uint64_t sign_of_life() override {
    if (current_->daemon_sleeps()) wake_daemon();
    return current_->turns();
  }

  std::byte* begin(std::uint64_t frame_bytes, std::uint64_t reply_bytes) override {
    check_usable();
    give_up_room();
    retire_outgrown();
    if (frame_bytes < sizeof(wire::FrameHeader))
      throw std::invalid_argument(url() + ": a frame begins with its header");
    if (frame_bytes > current_->request_capacity()) {
      const Deadline deadline = Clock::now() + kBeginTimeout;
      std::string why;
      if (!grow(frame_bytes, reply_bytes, deadline, why) && !grow(frame_bytes, 0, deadline, why))
        throw RequestError(static_cast<std::uint16_t>(wire::ErrorCode::kTooLarge),
                           url() + ": a request of " + std::to_string(frame_bytes) + " bytes does not fit: " + why);
    } else if (reply_bytes > current_->reply_capacity() && reply_bytes < rejected_reply_) {
      std::string why;  // the size is an estimate; after a rejection, the reply reports the required size
      if (!grow(frame_bytes, reply_bytes, Clock::now() + kBeginTimeout, why)) rejected_reply_ = reply_bytes;
    }
    room_.slot = take_slot();
    room_.segment = current_;
    return current_->request_area(static_cast<std::uint32_t>(room_.slot));
  }

  void send() override {
    check_usable();
    if (!room_.segment) throw std::logic_error(url() + ": send() without begin()");
    const SegmentPtr segment = std::exchange(room_.segment, nullptr);
    const auto index = static_cast<std::uint32_t>(std::exchange(room_.slot, -1));
    wire::FrameHeader header;
    std::memcpy(&header, segment->request_area(index), sizeof header);
    if (header.payload_bytes > segment->request_capacity() - sizeof header) {
      segment->give_slot(index);
      throw std::invalid_argument(url() + ": the frame is larger than the room that begin() gave");
    }
    ClientSegment::Slot& slot = segment->slots()[index];
    slot.request_id = header.request_id;
    slot.request_bytes = sizeof header + header.payload_bytes;
    post(*segment, index);
  }

  std::unique_ptr<Frame> receive(std::uint64_t request_id, Deadline deadline) override {
    check_fork();
    auto [segment, index] = find(request_id);
    if (!segment) throw ConnectionError(url() + ": no request " + std::to_string(request_id) + " is under way");
    Deadline began{};
    for (;;) {
      collect();
      const State state = segment->slots()[index].state;
      if (state == State::kArrived) {
        if (began != Deadline{}) spins_.replied(segment->slots()[index].request_bytes, last_look_ - began);
        std::unique_ptr<Frame> frame = take_reply(segment, index);
        if (!send_again(segment, index, *frame)) return frame;
        std::tie(segment, index) = find(request_id);
        continue;
      }
      if (state == State::kDropped) {
        segment->slots()[index].state = State::kIdle;
        segment->give_slot(index);
        throw ConnectionError(url() + ": the daemon dropped request " + std::to_string(request_id));
      }
      if (!dead_.empty()) throw ConnectionError(dead_);
      last_look_ = Clock::now();
      if (last_look_ >= deadline) return nullptr;
      if (began == Deadline{}) began = last_look_;
      wait(*segment, segment->slots()[index].request_bytes, deadline);
      shm::prefetch_to_read(segment->reply_area(index));
    }
  }

  void forget(std::uint64_t request_id) override {
    check_fork();
    const auto [segment, index] = find(request_id);
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
  void check_usable() const {
    check_fork();
    if (!dead_.empty()) throw ConnectionError(dead_);
  }

  // --- the socket

  void open(Deadline deadline) {
    sockaddr_un address;
    if (!shm::socket_address(options_.path.c_str(), address))
      throw ConnectionError(url() + ": a socket's path has 1 to " + std::to_string(sizeof address.sun_path - 1) +
                            " bytes");
    socket_.reset(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    if (!socket_) throw ConnectionError(url() + ": socket: " + std::strerror(errno));
    const auto left = std::max<std::chrono::nanoseconds>(deadline - Clock::now(), 1ms);
    const timeval timeout{std::chrono::duration_cast<std::chrono::seconds>(left).count(),
                          std::chrono::duration_cast<std::chrono::microseconds>(left % 1s).count()};
    ::setsockopt(socket_.get(), SOL_SOCKET, SO_SNDTIMEO, &timeout, sizeof timeout);
    if (::connect(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      const int error = errno;
      if (error == EAGAIN || error == EINPROGRESS)
        throw TimeoutError(url() + ": the daemon does not take the connection");
      throw ConnectionError(url() + ": " +
                            (error == ENOENT         ? std::string("there is no socket: is clearanced running?")
                             : error == ECONNREFUSED ? std::string("no process listens there: the daemon is gone")
                             : error == EPROTOTYPE   ? std::string("the socket there is not clearanced's")
                             : error == EACCES
                                 ? std::string("the socket belongs to another user, or its folder is not accessible")
                                 : std::strerror(error)));
    }
    ucred peer{};
    socklen_t length = sizeof peer;
    if (::getsockopt(socket_.get(), SOL_SOCKET, SO_PEERCRED, &peer, &length) != 0 ||
        peer.uid != options_.user.value_or(::geteuid()))
      throw ConnectionError(url() + ": the socket is user " + std::to_string(peer.uid) + "'s, not " +
                            (options_.user ? "user " + std::to_string(*options_.user) + "'s"
                                           : "ours (user " + std::to_string(::geteuid()) +
                                                 "); add ?user=NAME for the daemon of another user"));
    Message hello;
    hello.wire_version = wire::kVersion;
    hello.kind = static_cast<std::uint32_t>(MessageKind::kHello);
    shm::send_message(socket_.get(), hello);  // on failure, the daemon has rejected us, and its reason follows
    std::array<UniqueFd, shm::kMaxPassedFds> fds;
    const Message answer = await_answer(deadline, fds);
    if (static_cast<MessageKind>(answer.kind) == MessageKind::kRejected)
      throw ConnectionError(url() + ": rejected: " + answer.text);
    if (!fds[0] || !fds[1]) throw ConnectionError(url() + ": the daemon's greeting lacks the segment");
    current_ = std::make_shared<ClientSegment>(fds[0], url());
    wake_ = std::move(fds[1]);
  }

  /// Returns the daemon's next message, kSegment or kRejected. Throws ConnectionError, TimeoutError, DaemonHung.
  Message await_answer(Deadline deadline, std::array<UniqueFd, shm::kMaxPassedFds>& fds) {
    for (bool reset = false;;) {
      Message message;
      const ssize_t received = shm::receive_message(socket_.get(), message, &fds);
      if (received < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
        const Deadline until = std::min(deadline, watch());
        const auto left = std::max(std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()), 0ms);
        if (Clock::now() >= deadline) throw TimeoutError(url() + ": the daemon does not answer on its socket");
        pollfd waiting{socket_.get(), POLLIN, 0};
        ::poll(&waiting, 1, static_cast<int>(std::min<std::chrono::milliseconds>(left, 1h).count()));
        continue;
      }
      // The daemon closed the socket with unread data. Its last message can still be received.
      if (received < 0 && errno == ECONNRESET && !std::exchange(reset, true)) continue;
      if (received <= 0) die(received < 0 ? std::strerror(errno) : "the daemon closed the connection");
      message.text[sizeof message.text - 1] = '\0';
      if (static_cast<std::size_t>(received) < shm::kMessagePrefixBytes || message.magic != shm::kMagic)
        die("what listens there is not clearanced");
      const auto kind = static_cast<MessageKind>(message.kind);
      if (kind == MessageKind::kRejected) return message;
      if (message.layout_version != shm::kLayoutVersion || message.wire_version != wire::kVersion)
        die("the daemon speaks another version of the shared-memory layout");
      if (kind == MessageKind::kSegment) return message;
      die("the daemon sent a message of unknown kind");
    }
  }

  [[noreturn]] void die(const std::string& why) {
    dead_ = url() + ": " + why;
    throw ConnectionError(dead_);
  }

  /// Detects the loss of the daemon. Replies that it had posted can still be received.
  void look_at_socket() {
    Message message;
    const ssize_t received = shm::receive_message(socket_.get(), message);
    if (received < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
    message.text[sizeof message.text - 1] = '\0';
    if (received > 0 && static_cast<MessageKind>(message.kind) == MessageKind::kRejected)
      dead_ = url() + ": " + message.text;
    else
      dead_ = url() + ": the daemon is gone";
  }

  // --- segments and slots

  /// Changes to a segment with slots of this size. Returns false and sets `why` if the daemon rejects it.
  bool grow(std::uint64_t request_bytes, std::uint64_t reply_bytes, Deadline deadline, std::string& why) {
    // Doubling avoids a new segment for every slightly larger batch; near the limits, sizes are exact.
    const auto doubled = [](std::uint64_t bytes, std::uint64_t limit) {
      return bytes > limit / 2 ? bytes : std::bit_ceil(bytes);
    };
    return request_segment(doubled(request_bytes, wire::kMaxRequestBytes), doubled(reply_bytes, wire::kMaxFrameBytes),
                           deadline, why) ||
           request_segment(request_bytes, reply_bytes, deadline, why);
  }

  bool request_segment(std::uint64_t request_bytes, std::uint64_t reply_bytes, Deadline deadline, std::string& why) {
    Message wanted;
    wanted.wire_version = wire::kVersion;
    wanted.kind = static_cast<std::uint32_t>(MessageKind::kGrow);
    wanted.request_capacity = std::max(request_bytes, current_->request_capacity());
    wanted.reply_capacity = std::max(reply_bytes, current_->reply_capacity());
    if (!shm::send_message(socket_.get(), wanted)) {
      look_at_socket();
      if (dead_.empty()) dead_ = url() + ": the daemon takes no messages";
      throw ConnectionError(dead_);
    }
    std::array<UniqueFd, shm::kMaxPassedFds> fds;
    Message answer;
    try {
      answer = await_answer(deadline, fds);
    } catch (const ConnectionError& error) {
      if (dead_.empty()) dead_ = error.what();  // a late answer would be assigned to another request
      throw;
    }
    if (static_cast<MessageKind>(answer.kind) == MessageKind::kRejected) {
      why = answer.text;
      return false;
    }
    auto larger = std::make_shared<ClientSegment>(fds[0], url());
    if (larger->request_capacity() < wanted.request_capacity || larger->reply_capacity() < wanted.reply_capacity)
      die("the daemon handed over a smaller segment than requested");
    outgrown_.push_back(std::exchange(current_, std::move(larger)));
    retire_outgrown();
    return true;
  }

  /// Releases outgrown segments without requests, replies or frames.
  void retire_outgrown() {
    std::erase_if(outgrown_, [this](const SegmentPtr& segment) {
      if (!segment->all_free()) return false;
      Message retire;
      retire.wire_version = wire::kVersion;
      retire.kind = static_cast<std::uint32_t>(MessageKind::kRetire);
      retire.segment_id = segment->id();
      return shm::send_message(socket_.get(), retire);
    });
  }

  /// Returns segment and slot of a pending request; a null segment if there is none.
  std::pair<SegmentPtr, std::uint32_t> find(std::uint64_t request_id) const {
    const auto look = [&](const SegmentPtr& segment) -> int {
      const auto& slots = segment->slots();
      for (std::size_t i = 0; i < slots.size(); ++i)
        if (slots[i].request_id == request_id && slots[i].state != State::kIdle && !slots[i].forgotten)
          return static_cast<int>(i);
      return -1;
    };
    if (const int slot = look(current_); slot >= 0) return {current_, slot};
    for (const SegmentPtr& segment : outgrown_)
      if (const int slot = look(segment); slot >= 0) return {segment, slot};
    return {nullptr, 0};
  }

  void give_up_room() {
    if (room_.segment) room_.segment->give_slot(static_cast<std::uint32_t>(room_.slot));
    room_ = {};
  }

  int take_slot() {
    for (Deadline deadline{};;) {
      collect();
      if (const int slot = current_->take_slot(); slot >= 0) return slot;
      std::size_t posted = 0, arrived = 0, forgotten = 0;
      for (const auto& slot : current_->slots()) {
        posted += slot.state == State::kPosted && !slot.forgotten;
        arrived += slot.state == State::kArrived || slot.state == State::kDropped;
        forgotten += slot.state == State::kPosted && slot.forgotten;
      }
      const std::size_t count = current_->slots().size();
      if (forgotten == 0)
        throw ConnectionError(url() + ": all " + std::to_string(count) + " slots are taken: " + std::to_string(posted) +
                              " requests under way, " + std::to_string(arrived) + " replies not yet received, " +
                              std::to_string(count - posted - arrived) + " replies still held; release some");
      if (!dead_.empty()) throw ConnectionError(dead_);
      const auto now = Clock::now();
      if (deadline == Deadline{}) deadline = now + kBeginTimeout;
      if (now >= deadline)
        throw TimeoutError(url() + ": the daemon has not given back the slot of an abandoned request");
      last_look_ = now;
      wait(*current_, 0, std::min(deadline, watch()));
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
    bool sane = current_->collect();
    for (const SegmentPtr& segment : outgrown_) sane = segment->collect() && sane;
    if (!sane && dead_.empty()) dead_ = url() + ": the shared segment is corrupted";
  }

  /// Waits for a new entry in `segment` from last_look_ on, for a limited time.
  /// \param request_bytes size of the request that waits, which predicts the time
  void wait(ClientSegment& segment, std::uint64_t request_bytes, Deadline deadline) {
    const auto spin = spins_.next(request_bytes);
    if (spin > 0ns) {
      const bool arrived = spins_.is_long(spin) ? spin_long(segment, std::min<Deadline>(last_look_ + spin, deadline))
                                                : spin_until(segment, std::min<Deadline>(last_look_ + spin, deadline));
      spins_.spun(spin, arrived);
      if (arrived) return;
    }
    segment.sleep(std::min<std::chrono::nanoseconds>(kNap, deadline - last_look_));
    last_look_ = Clock::now();
    if (segment.nothing_new()) look_at_socket();
  }

  /// Returns whether a new entry arrived before `end`. Sets last_look_.
  bool spin_until(ClientSegment& segment, Deadline end) {
    do {
      for (int i = 0; i < kSpinsPerClockLook; ++i) {
        if (!segment.nothing_new()) return true;
        shm::cpu_relax();
      }
      last_look_ = Clock::now();
    } while (last_look_ < end);
    return false;
  }

  /// As spin_until(), but ends early if another thread needed this core.
  bool spin_long(ClientSegment& segment, Deadline end) {
    const long before = shm::preemptions();
    bool arrived = false;
    while (!arrived && last_look_ < end) {
      arrived = spin_until(segment, std::min(end, last_look_ + kSpinSlice));
      if (shm::preemptions() == before) continue;
      spins_.preempted();
      break;
    }
    return arrived;
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
    const std::uint64_t needed = room_needed(reply);
    if (needed <= segment->reply_capacity() || needed > wire::kMaxFrameBytes || old.retried || !dead_.empty())
      return false;
    std::string why;
    if ((needed > current_->reply_capacity() || old.request_bytes > current_->request_capacity()) &&
        !grow(old.request_bytes, needed, Clock::now() + kBeginTimeout, why))
      return false;
    const int slot = current_->take_slot();
    if (slot < 0) return false;
    const auto again = static_cast<std::uint32_t>(slot);
    std::memcpy(current_->request_area(again), segment->request_area(index), old.request_bytes);
    ClientSegment::Slot& fresh = current_->slots()[again];
    fresh.request_id = old.request_id;
    fresh.request_bytes = old.request_bytes;
    fresh.retried = true;
    post(*current_, again);
    return true;
  }

  std::string target_;
  ShmOptions options_;
  ForkGuard guard_;
  UniqueFd socket_;
  UniqueFd wake_;  ///< eventfd that wakes the daemon
  SegmentPtr current_;
  std::vector<SegmentPtr> outgrown_;
  TakenSlot room_;                                    ///< memory given by begin(), until send()
  std::string dead_;                                  ///< reason that the connection is unusable, or empty
  std::uint64_t rejected_reply_ = ~std::uint64_t{0};  ///< a reply capacity that the daemon has rejected
  ReplySpin spins_;
  Deadline last_look_{};  ///< last read of the clock during a wait
};

}  // namespace

std::unique_ptr<Channel> open_shm_channel(const std::string& socket_path, Deadline deadline) {
  return std::make_unique<ShmChannel>(socket_path, deadline);
}

}  // namespace clearance
