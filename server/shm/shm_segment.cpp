#include "server/shm/shm_segment.h"

#include <fcntl.h>
#include <linux/memfd.h>
#include <sys/mman.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <optional>

#include "engine/narrow/work_meter.h"
#include "wire/protocol.h"

namespace clearance {

namespace {

/// Address space up to which a grown segment gets as many slots as the limits allow. Larger slots are fewer.
constexpr std::uint64_t kRoomyBytes = std::uint64_t{256} << 20;
/// A client that keeps one reply during its next request needs two slots.
constexpr std::uint32_t kFewestSlots = 2;
constexpr std::uint32_t kGrownSlots = 4;
/// Fraction of all shared memory for first segments of the usual size, so that a few large clients do not shut out new
/// ones.
constexpr std::uint64_t kKeptForNewcomers = 4;

#ifndef MFD_NOEXEC_SEAL
constexpr unsigned MFD_NOEXEC_SEAL = 0x0008U;
#endif

shm::UniqueFd make_sealed_memfd(std::uint64_t bytes, std::string& why) {
  constexpr unsigned kFlags = MFD_CLOEXEC | MFD_ALLOW_SEALING;
  shm::UniqueFd fd(::memfd_create("clearance-shm", kFlags | MFD_NOEXEC_SEAL));
  if (!fd) fd.reset(::memfd_create("clearance-shm", kFlags));  // kernels before 6.3
  if (!fd) {
    why = std::string("memfd_create: ") + std::strerror(errno);
    return {};
  }
  // The client can neither shrink the file under our mapping (SIGBUS) nor add seals.
  if (::ftruncate(fd.get(), static_cast<off_t>(bytes)) != 0 ||
      ::fcntl(fd.get(), F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_SEAL) != 0) {
    why = "a segment of " + std::to_string(bytes) + " bytes: " + std::strerror(errno);
    return {};
  }
  return fd;
}

/// Sizes of a segment.
struct Sizes {
  std::uint32_t slots;
  std::uint64_t request_bytes, reply_bytes;  // of each slot
  std::uint64_t bytes() const { return shm::segment_bytes(slots, request_bytes, reply_bytes); }
};

/// Sizes for a client's request, with as many slots as the limits allow. If the limits forbid it, returns nothing and
/// sets `why`.
std::optional<Sizes> plan_segment(const ShmLimits& limits, std::uint64_t request_capacity, std::uint64_t reply_capacity,
                                  std::string& why) {
  // The sizes are a client's: compared before adding, so that nothing overflows.
  if (request_capacity > wire::kMaxRequestBytes) {
    why = "a request of " + std::to_string(request_capacity) + " bytes; the limit is " +
          std::to_string(wire::kMaxRequestBytes);
    return std::nullopt;
  }
  if (reply_capacity > wire::kMaxFrameBytes) {
    why =
        "a reply of " + std::to_string(reply_capacity) + " bytes; the limit is " + std::to_string(wire::kMaxFrameBytes);
    return std::nullopt;
  }
  const std::uint64_t request_bytes = shm::round_to_page(std::max(request_capacity, limits.request_capacity));
  const std::uint64_t reply_bytes =
      shm::round_to_page(std::max({reply_capacity, limits.reply_capacity, shm::kMinReplyCapacity}));
  const std::uint64_t slot_bytes = request_bytes + reply_bytes;
  const std::uint64_t most = limits.max_segment_bytes / slot_bytes;
  if (most < kFewestSlots) {
    why = "a request of " + std::to_string(request_capacity) + " and a reply of " + std::to_string(reply_capacity) +
          " bytes need a segment of " + std::to_string(shm::segment_bytes(kFewestSlots, request_bytes, reply_bytes)) +
          " bytes; this daemon's limit is " + std::to_string(limits.max_segment_bytes);
    return std::nullopt;
  }
  const std::uint64_t ceiling = std::min<std::uint64_t>({limits.slots, shm::kMaxSlots, most});
  const std::uint64_t roomy = std::max<std::uint64_t>(kRoomyBytes / slot_bytes, kGrownSlots);
  return Sizes{static_cast<std::uint32_t>(std::max<std::uint64_t>(std::min(ceiling, roomy), 1)), request_bytes,
               reply_bytes};
}

}  // namespace

std::byte* ScratchBuffer::reserve(std::size_t bytes) {
  if (bytes > capacity_) {
    data_.reset();
    capacity_ = 0;
    const std::size_t wanted = std::bit_ceil(std::max<std::size_t>(bytes, 4096));
    data_ = aligned_bytes(wanted);
    capacity_ = wanted;
  }
  return data_.get();
}

void ScratchBuffer::trim(std::size_t bytes) {
  if (capacity_ <= bytes) return;
  data_.reset();
  capacity_ = 0;
}

std::shared_ptr<Segment> Segment::make(std::shared_ptr<SegmentBudget> budget, std::shared_ptr<SegmentPinner> pinner,
                                       const ShmLimits& limits, ServiceClass service, std::uint32_t id,
                                       std::uint64_t request_capacity, std::uint64_t reply_capacity, std::string& why) {
  const std::optional<Sizes> plan = plan_segment(limits, request_capacity, reply_capacity, why);
  if (!plan) return nullptr;
  const std::uint64_t bytes = plan->bytes();
  // Segments that grow leave memory for new clients.
  const bool is_usual =
      id == 0 && request_capacity <= limits.request_capacity && reply_capacity <= limits.reply_capacity;
  const std::uint64_t open = budget->limit - (service == ServiceClass::kControl ? 0 : budget->kept_for_control);
  const std::uint64_t limit = open - (is_usual ? 0 : open / kKeptForNewcomers);
  if (bytes > limit - std::min(budget->used.load(), limit)) {
    why = "no room for a segment of " + std::to_string(bytes) + " bytes: " + std::to_string(budget->used.load()) +
          " of " + std::to_string(limit) + " bytes of shared memory are allocated to clients";
    return nullptr;
  }
  shm::UniqueFd memfd = make_sealed_memfd(bytes, why);
  if (!memfd) return nullptr;
  void* base = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, memfd.get(), 0);
  if (base == MAP_FAILED) {
    why = "mapping a segment of " + std::to_string(bytes) + " bytes: " + std::strerror(errno);
    return nullptr;
  }

  auto mapping = std::make_shared<Mapping>(static_cast<std::byte*>(base), bytes);
  std::shared_ptr<Segment> segment(new Segment);
  segment->mapping_ = std::move(mapping);
  segment->base_ = segment->mapping_->begin();
  segment->budget_ = std::move(budget);
  segment->budget_->used += bytes;
  segment->pinner_ = std::move(pinner);
  segment->memfd_ = std::move(memfd);
  segment->request_capacity_ = plan->request_bytes;
  segment->reply_capacity_ = plan->reply_bytes;
  segment->request_offset_ = shm::kPage;
  segment->reply_offset_ = shm::kPage + plan->slots * plan->request_bytes;
  segment->id_ = id;
  segment->slots_.resize(plan->slots);
  segment->write_header();
  return segment;
}

/// Writes the layout, with the version last, after which the client may read the rest.
void Segment::write_header() {
  header_ = new (base_) shm::SegmentHeader{};  // begins the objects' lifetime in the zeroed file
  header_->magic = shm::kMagic;
  header_->segment_id = id_;
  header_->slot_count = static_cast<std::uint32_t>(slots_.size());
  header_->ring_entries = shm::kRingEntries;
  header_->segment_bytes = mapping_->bytes();
  header_->request_capacity = request_capacity_;
  header_->reply_capacity = reply_capacity_;
  header_->request_offset = request_offset_;
  header_->reply_offset = reply_offset_;
  header_->version.store(shm::kLayoutVersion, std::memory_order_release);
}

Segment::~Segment() {
  assert(budget_->used >= mapping_->bytes());
  if (pin_) {
    budget_->used -= mapping_->bytes();
    mapping_.reset();
    pinner_->let_go(pin_);
  } else if (budget_->drop) {  // unmapping gigabytes takes tenths of a second
    struct Last {
      std::shared_ptr<SegmentBudget> budget;
      std::shared_ptr<Mapping> mapping;
      ~Last() {
        const std::uint64_t bytes = mapping->bytes();
        mapping.reset();
        budget->used -= bytes;
      }
    };
    budget_->drop(
        std::shared_ptr<Last>(new Last{budget_, std::move(mapping_)}));  // clang 14 cannot make the aggregate in place
  } else {
    budget_->used -= mapping_->bytes();
  }
}

Segment::Take Segment::violation(const char* why) {
  why_ = why;
  return Take::kViolation;
}

Segment::Take Segment::take(ScratchBuffer& scratch, Request& request) {
  const std::uint32_t head = header_->request_head.load(std::memory_order_acquire);
  const std::uint32_t waiting = head - request_tail_;
  if (waiting == 0) return Take::kNothing;
  if (waiting > slots_.size()) return violation("request_head ran ahead of the slots");
  shm::prefetch_to_read(base_ + request_offset_ +
                        last_slot_ * request_capacity_);  // a guess, as mostly the same slot is used again
  const shm::RingEntry& entry = header_->requests[request_tail_ % shm::kRingEntries];
  const std::uint64_t ticket = entry.ticket.load(std::memory_order_relaxed);
  const std::uint64_t bytes = entry.frame_bytes.load(std::memory_order_relaxed);
  const std::uint32_t index = shm::ticket_slot(ticket);
  const std::uint32_t generation = shm::ticket_generation(ticket);
  if (index >= slots_.size()) return violation("a slot that does not exist");
  Slot& slot = slots_[index];
  if (slot.busy) return violation("a slot that is still being answered");
  if (generation != slot.generation + 1) return violation("a generation out of order");
  if (bytes < sizeof(wire::FrameHeader) || bytes > request_capacity_) return violation("a frame size that cannot be");

  const bool is_large = bytes > sizeof(wire::FrameHeader) + kLargePayload;
  const std::uint64_t copied = is_large ? sizeof(wire::FrameHeader) : bytes;
  std::byte* copy = scratch.reserve(copied);
  std::memcpy(copy, base_ + request_offset_ + index * request_capacity_, copied);
  count_copied(copied);
  // Keeps the compiler from reading the shared bytes again instead of the copy.
  std::atomic_signal_fence(std::memory_order_seq_cst);

  ++request_tail_;
  slot.busy = true;
  slot.generation = generation;
  last_slot_ = index;
  shm::prefetch_to_write(reply_area(index));  // while the request is answered
  request = {index, generation, {copy, copied}, bytes};
  return Take::kRequest;
}

OwnPayload Segment::copy_payload(std::uint32_t slot, std::uint64_t payload_bytes) const {
  assert(slot < slots_.size() && sizeof(wire::FrameHeader) + payload_bytes <= request_capacity_);
  const std::shared_ptr<std::byte> copy(aligned_bytes(payload_bytes).release(), FreeDeleter());
  std::memcpy(copy.get(), base_ + request_offset_ + slot * request_capacity_ + sizeof(wire::FrameHeader),
              payload_bytes);
  std::atomic_signal_fence(std::memory_order_seq_cst);  // as in take()
  count_copied(payload_bytes);
  return {copy, payload_bytes};
}

bool Segment::has_request() const {
  return header_->request_head.load(std::memory_order_seq_cst) != request_tail_;
}

void Segment::set_sleeping(bool sleeping) {
  if (sleeping)
    header_->daemon_sleeping.store(1, std::memory_order_seq_cst);
  else
    header_->daemon_sleeping.store(0, std::memory_order_relaxed);
}

std::byte* Segment::reply_area(std::uint32_t slot) {
  assert(slot < slots_.size());
  return base_ + reply_offset_ + slot * reply_capacity_;
}

void Segment::pin() {
  if (pin_requested_ || !pinner_) return;
  pin_requested_ = true;
  pin_ = pinner_->pin(mapping_);
}

void Segment::post_reply(std::uint32_t slot, std::uint32_t generation, std::uint64_t frame_bytes) {
  assert(slot < slots_.size() && slots_[slot].busy && slots_[slot].generation == generation);
  slots_[slot].busy = false;
  shm::RingEntry& entry = header_->replies[reply_head_ % shm::kRingEntries];
  entry.ticket.store(shm::pack_ticket(slot, generation), std::memory_order_relaxed);
  entry.frame_bytes.store(frame_bytes, std::memory_order_relaxed);
  header_->reply_head.store(++reply_head_, std::memory_order_seq_cst);
  // A client with a wrong flag costs only a system call for each of its own requests.
  if (header_->client_waiting.load(std::memory_order_seq_cst) != 0) shm::futex_wake(header_->reply_head);
}

}  // namespace clearance
