// Protocol of the shared-memory transport: one segment per client, and a few messages on a socket.
//
//   bytes   segment (a memfd of the daemon's, sealed against resizing)                              who writes
//       0   geometry: magic, slots, capacities, offsets; the version word is stored last            daemon, once
//      64   daemon_sleeping                                                                         daemon
//     128   request_head: requests posted so far                                                    client
//     192   reply_head: replies posted so far; the client waits on it (futex)                       daemon
//     256   client_waiting                                                                          client
//     320   request ring: kRingEntries x RingEntry                                                  client
//    1344   reply ring:   kRingEntries x RingEntry                                                  daemon
//    2368   turns: iterations of the daemon's loop so far                                           daemon
//    4096   request areas: slot_count x request_capacity, one frame in each                         client
//     ...   reply areas:   slot_count x reply_capacity, one frame in each                           daemon
//
// A slot contains one request and the space for its reply. The client writes a frame into the request area of a free
// slot, increments the slot's generation, posts {slot, generation, bytes} to the request ring and then stores
// request_head (release). The daemon copies the frame into private memory before parsing it, writes the reply in place,
// and posts {slot, generation, bytes} to the reply ring. The reply's bytes belong to the client until it reuses the
// slot. A reply of 0 bytes returns the slot without an answer: the daemon has dropped the request.
//
// Neither side reads its own stores back: head counters, slot states and generations are kept in private memory, and
// shared memory only publishes them. The daemon loads each value of the client (request_head, ring entries, frames)
// once and then validates it. It disconnects a client that violates the protocol, and never reuses its segment.
//
// To sleep without losing a wake-up, each side stores and then loads, all sequentially consistent:
//   daemon  daemon_sleeping = 1, load request_head, sleep        client  request_head = n, daemon_sleeping? eventfd
//   client  client_waiting = 1, load reply_head, sleep           daemon  reply_head = n, client_waiting? futex wake
//
// `turns` increases with every iteration of the daemon's loop. A sleeping loop can take 100 ms; a client that tests for
// progress wakes it. A daemon that does not count them leaves 0.
//
// A Unix socket (SOCK_SEQPACKET) carries Message structs in both directions and reports a peer's death.
//   client  kHello                      daemon  kSegment + memfd + eventfd, or kRejected and the end
//   client  kGrow (capacities wanted)   daemon  kSegment + memfd, or kRejected (the connection stays open)
//   client  kRetire (segment_id)        -       an outgrown segment without requests or replies
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace clearance::shm {

inline constexpr std::uint32_t kMagic = 0x4D534C43;  // "CLSM"
/// Changes with this header, except for new words whose previous value, 0, means "absent". Peers of another version are
/// rejected.
inline constexpr std::uint16_t kLayoutVersion = 1;

inline constexpr std::size_t kCacheLine = 64;
inline constexpr std::uint32_t kRingEntries = 64;          ///< a power of two
inline constexpr std::uint32_t kMaxSlots = kRingEntries;   ///< so that neither ring can overflow
inline constexpr std::uint64_t kPage = 4096;               ///< capacities and offsets are multiples of it
inline constexpr std::uint64_t kMinReplyCapacity = kPage;  ///< an error reply always fits

/// One posted request or reply.
struct RingEntry {
  std::atomic<std::uint64_t> ticket;       ///< pack_ticket(slot, generation)
  std::atomic<std::uint64_t> frame_bytes;  ///< header and payload; 0 in a reply to a dropped request
};

constexpr std::uint64_t pack_ticket(std::uint32_t slot, std::uint32_t generation) {
  return std::uint64_t{generation} << 32 | slot;
}
constexpr std::uint32_t ticket_slot(std::uint64_t ticket) {
  return static_cast<std::uint32_t>(ticket);
}
constexpr std::uint32_t ticket_generation(std::uint64_t ticket) {
  return static_cast<std::uint32_t>(ticket >> 32);
}

struct SegmentHeader {
  // Geometry, constant once the version word is stored.
  std::uint32_t magic;
  std::uint32_t segment_id;    ///< counts up within one connection
  std::uint32_t slot_count;    ///< 1 to kMaxSlots
  std::uint32_t ring_entries;  ///< kRingEntries
  std::uint64_t segment_bytes;
  std::uint64_t request_capacity;      ///< bytes of one request area
  std::uint64_t reply_capacity;        ///< bytes of one reply area
  std::uint64_t request_offset;        ///< of slot 0's request area, from the start of the segment
  std::uint64_t reply_offset;          ///< of slot 0's reply area
  std::atomic<std::uint32_t> version;  ///< kLayoutVersion, stored last (release); 0 until then

  alignas(kCacheLine) std::atomic<std::uint32_t> daemon_sleeping;
  alignas(kCacheLine) std::atomic<std::uint32_t> request_head;
  alignas(kCacheLine) std::atomic<std::uint32_t> reply_head;
  alignas(kCacheLine) std::atomic<std::uint32_t> client_waiting;

  alignas(kCacheLine) RingEntry requests[kRingEntries];
  alignas(kCacheLine) RingEntry replies[kRingEntries];

  alignas(kCacheLine) std::atomic<std::uint64_t> turns;
};

static_assert(std::atomic<std::uint32_t>::is_always_lock_free && std::atomic<std::uint64_t>::is_always_lock_free,
              "words shared between processes must be lock-free");
static_assert(sizeof(std::atomic<std::uint32_t>) == 4 && sizeof(std::atomic<std::uint64_t>) == 8);
static_assert((kRingEntries & (kRingEntries - 1)) == 0);
static_assert(sizeof(RingEntry) == 16);
static_assert(std::is_standard_layout_v<SegmentHeader> && std::is_trivially_destructible_v<SegmentHeader>);
static_assert(offsetof(SegmentHeader, version) == 56);
static_assert(offsetof(SegmentHeader, daemon_sleeping) == 64);
static_assert(offsetof(SegmentHeader, request_head) == 128);
static_assert(offsetof(SegmentHeader, reply_head) == 192);
static_assert(offsetof(SegmentHeader, client_waiting) == 256);
static_assert(offsetof(SegmentHeader, requests) == 320);
static_assert(offsetof(SegmentHeader, replies) == 1344);
static_assert(offsetof(SegmentHeader, turns) == 2368);
static_assert(sizeof(SegmentHeader) == 2432 && sizeof(SegmentHeader) <= kPage);

enum class MessageKind : std::uint32_t {
  // client to daemon
  kHello = 1,
  kGrow = 2,
  kRetire = 3,
  // daemon to client
  kSegment = 0x81,
  kRejected = 0x82,
};

/// One message on the socket. The first sixteen bytes and the offset of `text` are the same in every version.
struct Message {
  std::uint32_t magic = kMagic;
  std::uint16_t layout_version = kLayoutVersion;
  std::uint16_t wire_version = 0;  ///< wire::kVersion
  std::uint32_t kind = 0;          ///< MessageKind
  std::uint32_t segment_id = 0;
  std::uint64_t request_capacity = 0;  ///< requested in kHello, kGrow (0 for the daemon's choice); granted in kSegment
  std::uint64_t reply_capacity = 0;
  std::uint64_t reserved[4] = {};
  char text[192] = {};  ///< reason of kRejected; NUL-terminated UTF-8
};
static_assert(sizeof(Message) == 256 && std::is_trivially_copyable_v<Message> && offsetof(Message, text) == 64);
inline constexpr std::size_t kMessagePrefixBytes = 16;

/// Rounds up to whole pages.
constexpr std::uint64_t round_to_page(std::uint64_t bytes) {
  return (bytes + kPage - 1) & ~(kPage - 1);
}

/// Size of a segment in bytes. Capacities are multiples of kPage.
constexpr std::uint64_t segment_bytes(std::uint32_t slots, std::uint64_t request_capacity,
                                      std::uint64_t reply_capacity) {
  return kPage + slots * (request_capacity + reply_capacity);
}

}  // namespace clearance::shm
