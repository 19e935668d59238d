// The daemon's side of shared segments: memory, budget and rings.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/shm/segment_pinner.h"
#include "server/shm/shm_transport.h"
#include "wire/aligned_buffer.h"
#include "wire/shm_layout.h"
#include "wire/shm_os.h"

namespace clearance {

/// Address space for all segments. Shared by the transport and every live segment.
struct SegmentBudget {
  std::uint64_t limit = 0;
  std::uint64_t kept_for_control = 0;  ///< part of `limit` for clients of that class
  std::atomic<std::uint64_t> used{0};
  /// Frees a segment's memory on a worker. If empty, it is freed at once.
  std::function<void(std::shared_ptr<void>)> drop;
};

/// Private memory on a 64-byte boundary, reused from request to request.
class ScratchBuffer {
 public:
  /// Returns memory for at least `bytes`, without the former contents. Throws std::bad_alloc.
  std::byte* reserve(std::size_t bytes);
  /// Frees memory beyond `bytes`.
  void trim(std::size_t bytes);

 private:
  AlignedBytes data_;
  std::size_t capacity_ = 0;
};

/// A segment of one client, never given to another one. It lives as long as the client and its requests under way.
class Segment {
 public:
  /// A request taken from the ring: its frame in private memory, or only the header of a large one.
  struct Request {
    std::uint32_t slot = 0;
    std::uint32_t generation = 0;
    std::span<const std::byte> frame;
    std::uint64_t frame_bytes = 0;
  };
  enum class Take { kNothing, kRequest, kViolation };

  /// Makes and maps a segment whose slots hold at least the given capacities, with as many slots as the limits allow.
  /// If the limits or the machine forbid it, returns null and sets `why`.
  /// @param pinner or null if the segment is never pinned
  static std::shared_ptr<Segment> make(std::shared_ptr<SegmentBudget> budget, std::shared_ptr<SegmentPinner> pinner,
                                       const ShmLimits& limits, ServiceClass service, std::uint32_t id,
                                       std::uint64_t request_capacity, std::uint64_t reply_capacity, std::string& why);
  ~Segment();
  Segment(const Segment&) = delete;
  Segment& operator=(const Segment&) = delete;

  /// Takes the next request, if there is one. After kViolation (see why()) the client must be disconnected.
  Take take(ScratchBuffer& scratch, Request& request);
  /// Copies the payload of a request that has not been answered. From any thread. Throws std::bad_alloc.
  OwnPayload copy_payload(std::uint32_t slot, std::uint64_t payload_bytes) const;
  /// Whether a request waits. Sequentially consistent, for the check after set_sleeping(true).
  bool has_request() const;
  void set_sleeping(bool sleeping);
  /// Publishes the number of the loop's turns to the client.
  void show_turns(std::uint64_t turns) { header_->turns.store(turns, std::memory_order_relaxed); }

  /// Memory for a slot's reply.
  std::byte* reply_area(std::uint32_t slot);
  /// Pins the segment, so that a device writes later replies without a copy.
  void pin();
  /// Posts a reply and wakes the client. With 0 bytes the slot is returned without a reply.
  void post_reply(std::uint32_t slot, std::uint32_t generation, std::uint64_t frame_bytes);

  std::uint32_t id() const { return id_; }
  int memfd() const { return memfd_.get(); }
  std::uint64_t request_capacity() const { return request_capacity_; }
  std::uint64_t reply_capacity() const { return reply_capacity_; }
  const char* why() const { return why_; }

 private:
  struct Slot {
    std::uint32_t generation = 0;  ///< of the last request taken
    bool busy = false;             ///< a request was taken and not answered
  };

  Segment() = default;
  void write_header();
  Take violation(const char* why);

  // All state for the daemon's decisions is in private memory.
  std::shared_ptr<SegmentBudget> budget_;
  std::shared_ptr<SegmentPinner> pinner_;
  shm::UniqueFd memfd_;
  std::shared_ptr<Mapping> mapping_;
  std::byte* base_ = nullptr;
  shm::SegmentHeader* header_ = nullptr;
  std::uint64_t request_capacity_ = 0, reply_capacity_ = 0, request_offset_ = 0, reply_offset_ = 0;
  std::uint32_t id_ = 0;
  std::uint32_t request_tail_ = 0;  ///< requests taken
  std::uint32_t reply_head_ = 0;    ///< replies posted
  std::uint32_t last_slot_ = 0;     ///< of the last request taken
  std::vector<Slot> slots_;
  bool pin_requested_ = false;
  SegmentPinner::Ticket* pin_ = nullptr;
  const char* why_ = "";
};

}  // namespace clearance
