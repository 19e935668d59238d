#include "client/channel/shm_client_segment.h"

#include <sys/mman.h>
#include <sys/stat.h>

#include <bit>
#include <cerrno>
#include <cstring>

#include "client/channel/connection_errors.h"
#include "wire/protocol.h"

namespace clearance {

ClientSegment::ClientSegment(const shm::UniqueFd& memfd, const std::string& url) {
  struct stat file{};
  if (::fstat(memfd.get(), &file) != 0 || file.st_size < static_cast<off_t>(shm::kPage))
    throw ConnectionError(url + ": the daemon handed over something that is not a segment");
  bytes_ = static_cast<std::uint64_t>(file.st_size);
  void* base = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, memfd.get(), 0);
  if (base == MAP_FAILED)
    throw ConnectionError(url + ": mapping a segment of " + std::to_string(bytes_) + " bytes: " + std::strerror(errno));
  base_ = static_cast<std::byte*>(base);
  header_ = static_cast<shm::SegmentHeader*>(base);

  const std::uint32_t version = header_->version.load(std::memory_order_acquire);
  const std::uint32_t slots = header_->slot_count;
  request_capacity_ = header_->request_capacity;
  reply_capacity_ = header_->reply_capacity;
  if (version != shm::kLayoutVersion || header_->magic != shm::kMagic || header_->ring_entries != shm::kRingEntries ||
      slots == 0 || slots > shm::kMaxSlots || request_capacity_ > bytes_ || reply_capacity_ > bytes_ ||
      request_capacity_ % shm::kPage != 0 || reply_capacity_ % shm::kPage != 0 || reply_capacity_ == 0 ||
      header_->segment_bytes != bytes_ || shm::segment_bytes(slots, request_capacity_, reply_capacity_) != bytes_ ||
      header_->request_offset != shm::kPage || header_->reply_offset != shm::kPage + slots * request_capacity_) {
    ::munmap(base_, bytes_);
    throw ConnectionError(url + ": the daemon's segment has a layout unknown to this client");
  }
  ::madvise(base, bytes_, MADV_DONTFORK);  // a forked child cannot scribble over its parent's requests
  id_ = header_->segment_id;
  requests_ = base_ + header_->request_offset;
  replies_ = base_ + header_->reply_offset;
  slots_.resize(slots);
  all_slots_ = slots == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << slots) - 1;
  free_.store(all_slots_, std::memory_order_relaxed);
}

ClientSegment::~ClientSegment() {
  if (!guard_.forked()) ::munmap(base_, bytes_);  // a forked child has nothing there, or something of its own
}

int ClientSegment::take_slot() {
  const std::uint64_t free = free_.load(std::memory_order_acquire);
  if (free == 0) return -1;
  const int slot = std::countr_zero(free);
  free_.fetch_and(~(std::uint64_t{1} << slot), std::memory_order_relaxed);
  Slot& s = slots_[slot];
  s = Slot{.generation = s.generation};
  return slot;
}

bool ClientSegment::post(std::uint32_t slot) {
  Slot& s = slots_[slot];
  s.state = State::kPosted;
  ++s.generation;
  shm::RingEntry& entry = header_->requests[request_head_ % shm::kRingEntries];
  entry.ticket.store(shm::pack_ticket(slot, s.generation), std::memory_order_relaxed);
  entry.frame_bytes.store(s.request_bytes, std::memory_order_relaxed);
  header_->request_head.store(++request_head_, std::memory_order_seq_cst);
  return header_->daemon_sleeping.load(std::memory_order_seq_cst) != 0;
}

bool ClientSegment::collect() {
  const std::uint32_t head = header_->reply_head.load(std::memory_order_acquire);
  if (head - reply_tail_ > slots_.size()) return false;
  for (; reply_tail_ != head; ++reply_tail_) {
    const shm::RingEntry& entry = header_->replies[reply_tail_ % shm::kRingEntries];
    const std::uint64_t ticket = entry.ticket.load(std::memory_order_relaxed);
    const std::uint64_t bytes = entry.frame_bytes.load(std::memory_order_relaxed);
    const std::uint32_t index = shm::ticket_slot(ticket);
    if (index >= slots_.size() || bytes > reply_capacity_ || (bytes != 0 && bytes < sizeof(wire::FrameHeader)))
      return false;
    Slot& slot = slots_[index];
    if (slot.state != State::kPosted || shm::ticket_generation(ticket) != slot.generation) return false;
    slot.reply_bytes = bytes;
    if (slot.forgotten) {
      slot.state = State::kIdle;
      give_slot(index);
    } else {
      slot.state = bytes != 0 ? State::kArrived : State::kDropped;
    }
  }
  return true;
}

void ClientSegment::sleep(std::chrono::nanoseconds timeout) {
  header_->client_waiting.store(1, std::memory_order_seq_cst);
  if (header_->reply_head.load(std::memory_order_seq_cst) == reply_tail_)
    shm::futex_wait(header_->reply_head, reply_tail_, timeout);
  header_->client_waiting.store(0, std::memory_order_relaxed);
}

}  // namespace clearance
