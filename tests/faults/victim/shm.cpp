// A victim over shared memory that implements wire/shm_layout.h itself.
#include <sys/mman.h>

#include <chrono>
#include <thread>

#include "tests/faults/victim/victim.h"
#include "tests/server/shm/raw_shm_client.h"
#include "wire/wire.h"

namespace clearance::faults {
namespace {

/// An additional segment of a connection, mapped until the end.
struct Grown {
  explicit Grown(shm::UniqueFd fd) : memfd(std::move(fd)) {
    const auto bytes = static_cast<std::size_t>(::lseek(memfd.get(), 0, SEEK_END));
    base = static_cast<std::byte*>(::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memfd.get(), 0));
    if (base == MAP_FAILED) throw std::runtime_error("cannot map the second segment");
    header = reinterpret_cast<shm::SegmentHeader*>(base);
  }
  shm::UniqueFd memfd;
  std::byte* base;
  shm::SegmentHeader* header;
};

std::byte* request_area(std::byte* base, const shm::SegmentHeader& header, std::uint32_t slot) {
  return base + header.request_offset + slot * header.request_capacity;
}

/// Waits until this many replies have been posted.
void await_replies(const RawClient& client, const shm::SegmentHeader& header, std::uint32_t count) {
  while (header.reply_head.load(std::memory_order_acquire) < count) {
    pollfd hung_up{client.socket.get(), POLLIN, 0};
    if (::poll(&hung_up, 1, 1) > 0) throw std::runtime_error("the daemon hung up");
  }
}

/// Checks that a slot's reply belongs to the request in it.
void check_reply(const std::byte* base, const shm::SegmentHeader& header, std::uint32_t slot, std::uint64_t id) {
  wire::FrameHeader reply;
  std::memcpy(&reply, base + header.reply_offset + slot * header.reply_capacity, sizeof reply);
  if (reply.request_id != id || reply.type != static_cast<std::uint16_t>(wire::FrameType::kReply))
    throw std::runtime_error("request " + std::to_string(id) + " was answered by " + wire::type_name(reply.type) +
                             " to request " + std::to_string(reply.request_id));
}

}  // namespace

void talk_shm(const std::string& socket_path, const Fate& fate, std::mt19937_64& random) {
  RawClient client(socket_path, false);
  fate.at("connected");
  client.send(RawClient::make(shm::MessageKind::kHello));
  fate.at("hello_sent");
  client.take_segment();
  fate.at("segment_received");
  client.map();
  fate.at("mapped");

  shm::SegmentHeader& header = *client.header;
  const auto first = request_of(100, 3, random);
  std::byte* room = request_area(client.base, header, 0);
  std::memcpy(room, first.data(), first.size() / 2);
  fate.at("frame_half_written");
  std::memcpy(room, first.data(), first.size());
  fate.at("frame_written");
  header.requests[0].ticket.store(shm::pack_ticket(0, 1));
  header.requests[0].frame_bytes.store(first.size());
  fate.at("entry_written");
  header.request_head.store(++client.posted);
  fate.at("posted");
  client.wake_daemon();
  fate.at("woken");

  await_replies(client, header, 1);
  fate.at("reply_there");
  check_reply(client.base, header, 0, 100);
  const auto bytes = static_cast<std::size_t>(header.replies[0].frame_bytes.load());
  std::vector<std::byte> reply(bytes);
  const std::byte* from = client.base + header.reply_offset;
  std::memcpy(reply.data(), from, bytes / 2);
  fate.at("reply_half_read");

  // Large requests in seven slots, the first of them in a slot that was used before.
  std::uint32_t posted = 1;
  for (std::uint32_t slot = 0; slot < 7; ++slot) {
    const auto frame = large_request(200 + slot);
    std::memcpy(request_area(client.base, header, slot), frame.data(), frame.size());
    client.post(shm::pack_ticket(slot, slot == 0 ? 2 : 1), frame.size(), ++posted);
  }
  fate.at("many_posted");
  shm::Message grow = RawClient::make(shm::MessageKind::kGrow);
  grow.reply_capacity = std::uint64_t{3} << 20;
  client.send(grow);
  fate.at("grow_sent");
  std::array<shm::UniqueFd, shm::kMaxPassedFds> fds;
  const shm::Message answer = client.receive(&fds);
  if (answer.kind != static_cast<std::uint32_t>(shm::MessageKind::kSegment)) throw std::runtime_error(answer.text);
  Grown second(std::move(fds[0]));
  fate.at("grown");
  const auto frame = large_request(300);
  std::memcpy(request_area(second.base, *second.header, 0), frame.data(), frame.size());
  second.header->requests[0].ticket.store(shm::pack_ticket(0, 1));
  second.header->requests[0].frame_bytes.store(frame.size());
  second.header->request_head.store(1);
  client.wake_daemon();
  fate.at("posted_in_second");
  await_replies(client, header, 8);
  await_replies(client, *second.header, 1);
  fate.at("all_there");
  for (std::uint32_t slot = 0; slot < 7; ++slot) check_reply(client.base, header, slot, 200 + slot);
  check_reply(second.base, *second.header, 0, 300);
  client.send(RawClient::make(shm::MessageKind::kRetire));  // segment 0
  fate.at("retired");
}

}  // namespace clearance::faults
