// A client that overwrites every byte it shares with the daemon, randomly and deliberately, while the daemon uses it.
#include <atomic>
#include <chrono>
#include <thread>

#include "tests/faults/victim/victim.h"
#include "tests/server/shm/raw_shm_client.h"
#include "wire/wire.h"

namespace clearance::faults {
namespace {

/// The memory that a session overwrites. The first two keep the rules of the rings, so that the daemon continues to
/// answer from changing memory; the others break them. kToggle switches the ring's checked values between valid and
/// invalid as fast as possible, to catch a value that is loaded again after its check.
enum class Target { kRequests, kReplies, kRings, kEverything, kToggle };

/// Values near those that checks compare with, and random ones.
std::uint64_t nasty_word(const shm::SegmentHeader& header, std::mt19937_64& random) {
  const std::uint64_t values[] = {
      0,
      1,
      2,
      header.slot_count - 1,
      header.slot_count,
      shm::kRingEntries,
      sizeof(wire::FrameHeader),
      sizeof(wire::FrameHeader) + sizeof(wire::QueryHeader),
      header.request_capacity,
      header.request_capacity + 1,
      header.reply_capacity,
      header.segment_bytes,
      0x7FFFFFFF,
      0x80000000,
      0xFFFFFFFF,
      0x7FFFFFFFFFFFFFFF,
      ~std::uint64_t{0},
      0x7FF8000000000000,  // NaN
      0x7FF0000000000000,  // inf
      shm::pack_ticket(random() % 16, 1 + random() % 4),
      std::uint64_t{wire::kMagic} | std::uint64_t{wire::kVersion} << 32 | (1 + random() % 8) << 48};
  const std::uint64_t drawn = random();
  return drawn % 4 == 0 ? random() : values[drawn / 4 % std::size(values)];
}

/// Toggles the entries that the daemon takes next from the request ring, until `done`.
void toggle(const RawClient& client, const std::atomic<bool>& done, std::mt19937_64& random) {
  shm::SegmentHeader& header = *client.header;
  const std::uint64_t far = std::uint64_t{1} << 40;
  while (!done) {
    shm::RingEntry& entry = header.requests[(header.request_head.load() + random() % 2) % shm::kRingEntries];
    for (int i = 0; i < 500; ++i) {
      std::uint64_t bytes = entry.frame_bytes.load(), ticket = entry.ticket.load();
      // Does not restore an old value over one that the client has posted meanwhile.
      if (bytes != far && entry.frame_bytes.compare_exchange_strong(bytes, far)) {
        std::uint64_t wrong = far;
        entry.frame_bytes.compare_exchange_strong(wrong, bytes);
      }
      // Valid for longer than invalid, so that a first check passes and a second one might not.
      for (int pause = 0; pause < 10; ++pause) shm::cpu_relax();
      const std::uint64_t elsewhere = ticket | 0xFFFFFF00;
      if (ticket != elsewhere && entry.ticket.compare_exchange_strong(ticket, elsewhere)) {
        std::uint64_t wrong = elsewhere;
        entry.ticket.compare_exchange_strong(wrong, ticket);
      }
      for (int pause = 0; pause < 10; ++pause) shm::cpu_relax();
    }
  }
}

void write_over(const RawClient& client, Target target, const std::atomic<bool>& done, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  if (target == Target::kToggle) return toggle(client, done, random);
  const shm::SegmentHeader& header = *client.header;
  const std::uint64_t slots = header.slot_count, request = header.request_capacity, reply = header.reply_capacity;
  const auto words = reinterpret_cast<std::atomic<std::uint64_t>*>(client.base);
  std::uint64_t begin = 0, end = client.bytes / 8;
  if (target == Target::kRequests) begin = shm::kPage / 8, end = (shm::kPage + slots * request) / 8;
  if (target == Target::kReplies) begin = (shm::kPage + slots * request) / 8;
  if (target == Target::kRings) end = sizeof(shm::SegmentHeader) / 8;
  // Most writes go to the first words of each area, which have the checked values.
  const std::uint64_t area = target == Target::kReplies ? reply / 8 : request / 8;
  for (std::uint64_t i = 0; !done; ++i) {
    std::uint64_t at = begin + random() % (end - begin);
    if (target == Target::kRequests || target == Target::kReplies)
      if (random() % 4) at = begin + random() % 4 * area + random() % 40;
    words[at].store(nasty_word(header, random), std::memory_order_relaxed);
    if (i % 4096 == 0 && target == Target::kEverything)  // every byte
      for (std::uint64_t w = begin; w < end && !done; ++w) words[w].store(random(), std::memory_order_relaxed);
  }
}

/// One connection: valid requests while another thread overwrites the segment. Ends when the daemon hangs up.
void session(const std::string& socket_path, std::mt19937_64& random) {
  RawClient client(socket_path);
  const std::uint64_t request_capacity = client.header->request_capacity;
  const std::uint32_t slots = client.header->slot_count;
  // Toggling ends a connection soonest, so it gets more sessions.
  constexpr Target kTargets[] = {Target::kRequests, Target::kReplies, Target::kRings,  Target::kEverything,
                                 Target::kToggle,   Target::kToggle,  Target::kToggle, Target::kToggle};
  const Target target = kTargets[random() % std::size(kTargets)];
  std::vector<std::vector<std::byte>> frames;
  for (std::uint64_t id = 1; id <= 4; ++id) frames.push_back(id % 2 ? request_of(id, 40, random) : large_request(id));
  std::atomic<bool> done{false};
  std::thread writer([&, seed = random()] { write_over(client, target, done, seed); });
  std::vector<std::uint32_t> generation(slots);
  std::uint32_t answered = 0;
  const auto hung_up = [&](int wait_ms) {
    pollfd readable{client.socket.get(), POLLIN, 0};
    return ::poll(&readable, 1, wait_ms) > 0;
  };
  for (std::uint32_t posted = 0; posted < 60 && !hung_up(0);) {
    // Four slots in turn; the next one must have been returned.
    if (posted - answered < 4) {
      const std::uint32_t slot = posted % 4;
      const auto& frame = frames[posted % frames.size()];
      std::byte* room = client.base + shm::kPage + slot * request_capacity;
      std::memcpy(room, frame.data(), frame.size());
      // Some queries are invalid before the daemon reads them, because the other thread rarely corrupts one in time on
      // a busy machine.
      if (target == Target::kRequests && posted % 8 == 7) {
        const std::uint64_t word = nasty_word(*client.header, random);
        const std::uint64_t at = random() % (sizeof(wire::QueryHeader) / sizeof word) * sizeof word;
        std::memcpy(room + sizeof(wire::FrameHeader) + at, &word, sizeof word);
      }
      client.post(shm::pack_ticket(slot, ++generation[slot]), frame.size(), ++posted);
    } else {
      // Replies come in any order: all four must have arrived before the first slot is reused.
      while (client.header->reply_head.load(std::memory_order_acquire) != posted && !hung_up(1)) {
        client.wake_daemon();
        if (target == Target::kRings || target == Target::kEverything) break;  // the word may have any value
      }
      answered = posted;
    }
  }
  done = true;
  writer.join();
}

}  // namespace

void scribble(const std::string& socket_path, std::mt19937_64& random) {
  for (;;) {
    try {
      session(socket_path, random);
    } catch (const std::runtime_error&) {
      std::this_thread::yield();  // rejected, or closed during the handshake: repeat
    }
  }
}

}  // namespace clearance::faults
