// A shared-memory daemon that violates the protocol: arbitrary greetings, segments and replies. The client gets a frame
// within its segment, or an error.
#include <sys/mman.h>
#include <sys/stat.h>

#include <array>
#include <thread>
#include <vector>

#include "client/channel/channel.h"
#include "client/client.h"
#include "tests/fuzz/frames.h"
#include "tests/fuzz/scratch_file.h"
#include "wire/shm_os.h"
#include "wire/wire.h"

namespace clearance::fuzz {
namespace {

constexpr std::uint32_t kSlots = 4;
constexpr std::uint64_t kCapacity = shm::kPage;
constexpr std::uint64_t kSegmentBytes = shm::segment_bytes(kSlots, kCapacity, kCapacity);

/// One message of the daemon, possibly with a segment.
struct Prelude {
  std::vector<std::byte> message;
  shm::UniqueFd segment;
};

/// A segment like a daemon's, possibly of an odd size, with a few bytes of its header changed.
shm::UniqueFd make_segment(Input& in) {
  shm::UniqueFd fd(::memfd_create("clearance-fuzz", MFD_CLOEXEC));
  std::uint64_t size = kSegmentBytes;
  if (const auto odd = in.number<std::uint8_t>()) size = std::uint64_t{odd} * 257;
  alignas(64) std::array<std::byte, shm::kPage> page{};
  auto* header = new (page.data()) shm::SegmentHeader{};
  header->magic = shm::kMagic;
  header->slot_count = kSlots;
  header->ring_entries = shm::kRingEntries;
  header->segment_bytes = size;
  header->request_capacity = header->reply_capacity = kCapacity;
  header->request_offset = shm::kPage;
  header->reply_offset = shm::kPage + kSlots * kCapacity;
  header->version.store(shm::kLayoutVersion);
  const int scribbles = in.number<std::uint8_t>() % 4;
  for (int i = 0; i < scribbles; ++i) {
    const std::size_t at = in.number<std::uint16_t>() % page.size();
    const Bytes bytes = in.take(in.number<std::uint8_t>());
    std::memcpy(page.data() + at, bytes.data(), std::min(bytes.size(), page.size() - at));
  }
  require(::ftruncate(fd.get(), static_cast<off_t>(size)) == 0 &&
              ::pwrite(fd.get(), page.data(), std::min<std::size_t>(page.size(), size), 0) >= 0,
          "a segment is made");
  return fd;
}

Prelude prepare(Input& in) {
  Prelude out;
  const auto how = in.number<std::uint8_t>();
  shm::Message message;
  message.wire_version = wire::kVersion;
  message.kind = static_cast<std::uint32_t>(how & 1 ? shm::MessageKind::kRejected : shm::MessageKind::kSegment);
  message.request_capacity = message.reply_capacity = kCapacity;
  wire::append(out.message, message);
  if (how & 2) {
    const std::size_t at = in.number<std::uint8_t>();
    const Bytes bytes = in.take(in.number<std::uint8_t>());
    std::memcpy(out.message.data() + at, bytes.data(), std::min(bytes.size(), out.message.size() - at));
  }
  if (how & 4) out.message.resize(in.number<std::uint8_t>());
  if (!(how & 8)) out.segment = make_segment(in);
  return out;
}

/// The daemon's mapping of its first segment, for writes while the client waits.
class Pen {
 public:
  explicit Pen(const std::vector<Prelude>& messages) {
    for (const Prelude& m : messages) {
      if (!m.segment) continue;
      const off_t size = ::lseek(m.segment.get(), 0, SEEK_END);
      if (size < static_cast<off_t>(kSegmentBytes)) return;
      base_ = static_cast<std::byte*>(
          ::mmap(nullptr, kSegmentBytes, PROT_READ | PROT_WRITE, MAP_SHARED, m.segment.get(), 0));
      require(base_ != MAP_FAILED, "a segment is mapped");
      return;
    }
  }
  ~Pen() {
    if (base_ != nullptr) ::munmap(base_, kSegmentBytes);
  }
  Pen(const Pen&) = delete;

  /// Posts replies, a head, or arbitrary bytes according to the input.
  void write(Input& in) {
    const auto how = in.number<std::uint8_t>();
    if (base_ == nullptr) return;
    auto& header = *reinterpret_cast<shm::SegmentHeader*>(base_);
    for (int i = 0; i < how % 4; ++i) {
      const auto slot = in.number<std::uint8_t>(), generation = in.number<std::uint8_t>();
      const std::vector<std::byte> frame = next_frame(in).bytes;
      std::memcpy(base_ + shm::kPage + (kSlots + slot % kSlots) * kCapacity, frame.data(),
                  std::min<std::size_t>(frame.size(), kCapacity));
      header.replies[posted_ % shm::kRingEntries].ticket.store(shm::pack_ticket(slot, generation));
      header.replies[posted_ % shm::kRingEntries].frame_bytes.store(frame.size());
      header.reply_head.store(++posted_);
    }
    if (how & 4) header.reply_head.store(in.number<std::uint32_t>());
    if (how & 8) {
      const std::size_t at = in.number<std::uint16_t>() % kSegmentBytes;
      const Bytes bytes = in.take(in.number<std::uint8_t>());
      std::memcpy(base_ + at, bytes.data(), std::min<std::size_t>(bytes.size(), kSegmentBytes - at));
    }
  }

 private:
  std::byte* base_ = nullptr;
  std::uint32_t posted_ = 0;
};

/// Listens for the client and sends its whole side of the communication at once, which makes it independent of timing.
class HandDaemon {
 public:
  explicit HandDaemon(const std::string& path) {
    sockaddr_un address;
    require(shm::socket_address(path.c_str(), address), "the socket's path is short");
    ::unlink(path.c_str());
    listener_.reset(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
    require(::bind(listener_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
                ::listen(listener_.get(), 1) == 0,
            "the socket listens");
  }
  void speak(const std::vector<Prelude>& messages) {
    const shm::UniqueFd socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
    const shm::UniqueFd wake(::memfd_create("clearance-fuzz-wake", MFD_CLOEXEC));
    for (const Prelude& m : messages) {
      iovec data{const_cast<std::byte*>(m.message.data()), m.message.size()};
      alignas(cmsghdr) std::byte control[CMSG_SPACE(2 * sizeof(int))] = {};
      msghdr header{};
      header.msg_iov = &data;
      header.msg_iovlen = 1;
      if (m.segment) {
        header.msg_control = control;
        header.msg_controllen = sizeof control;
        cmsghdr* c = CMSG_FIRSTHDR(&header);
        c->cmsg_level = SOL_SOCKET;
        c->cmsg_type = SCM_RIGHTS;
        c->cmsg_len = CMSG_LEN(2 * sizeof(int));
        const int fds[2] = {m.segment.get(), wake.get()};
        std::memcpy(CMSG_DATA(c), fds, sizeof fds);
      }
      ::sendmsg(socket.get(), &header, MSG_NOSIGNAL | MSG_DONTWAIT);
    }
  }  // hangs up, because no answer follows

 private:
  shm::UniqueFd listener_;
};

/// Sends three requests, the last of which does not fit. Counts the answers.
void talk(const std::string& path, Pen& pen, Input& in, int& answers) {
  using Clock = std::chrono::steady_clock;
  const auto channel = open_shm_channel(path + "?spin_us=0", Clock::now() + std::chrono::seconds(10));
  for (std::uint64_t id = 1; id <= 3; ++id) {
    const std::uint64_t payload = id == 3 ? 2 * kCapacity : 16;
    const wire::FrameHeader header = wire::make_header(wire::FrameType::kPing, id, payload);
    std::byte* room = channel->begin(sizeof header + payload, 0);
    std::memcpy(room, &header, sizeof header);
    std::memset(room + sizeof header, 1, payload);
    channel->send();
    pen.write(in);
    const auto frame = channel->receive(id, Clock::now());
    if (!frame) {
      channel->forget(id);
      continue;
    }
    require(frame->header().request_id == id && frame->payload().size() == frame->header().payload_bytes,
            "a reply is the one asked for");
    static volatile unsigned sink = 0;
    for (const std::byte b : frame->payload()) sink = sink + std::to_integer<unsigned>(b);
    ++answers;
  }
}

}  // namespace
}  // namespace clearance::fuzz

/// Number of the daemon's messages, 1 B; the messages, each with its segment; and the writes to the first segment after
/// each request. Accepted if two answers came.
CLEARANCE_FUZZ_TARGET(shm_client) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static const ScratchFolder folder;
  const std::string path = folder / "c";
  Input in(bytes);
  std::vector<Prelude> messages(in.number<std::uint8_t>() % 4);
  for (Prelude& message : messages) message = prepare(in);
  Pen pen(messages);
  HandDaemon daemon(path);
  std::jthread thread([&] { daemon.speak(messages); });
  int answers = 0;
  try {
    talk(path, pen, in, answers);
  } catch (const ConnectionError&) {
  } catch (const RequestError&) {
  }
  return answers >= 2;
}
