// The client's side of a shared segment: mapping, slots and rings.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "wire/fork_guard.h"
#include "wire/shm_layout.h"
#include "wire/shm_os.h"

namespace clearance {

/// A mapped segment with the client's state of its slots, shared by frames and the channel.
///
/// Not thread-safe, except give_slot(), since frames are freed on any thread.
class ClientSegment {
 public:
  enum class State : std::uint8_t {
    kIdle,     ///< free, being written to, or leased to a frame
    kPosted,   ///< posted to the daemon
    kArrived,  ///< with a reply that was not fetched yet
    kDropped,  ///< returned by the daemon without an answer
  };
  struct Slot {
    State state = State::kIdle;
    bool forgotten = false;  ///< whether the request was abandoned
    bool retried = false;    ///< whether the request was sent again because its reply did not fit
    std::uint32_t generation = 0;
    std::uint64_t request_id = 0;
    std::uint64_t request_bytes = 0;
    std::uint64_t reply_bytes = 0;
  };

  /// Maps the daemon's segment. Throws ConnectionError naming `url` if it does not have this layout.
  ClientSegment(const shm::UniqueFd& memfd, const std::string& url);
  ~ClientSegment();
  ClientSegment(const ClientSegment&) = delete;
  ClientSegment& operator=(const ClientSegment&) = delete;

  std::uint32_t id() const { return id_; }
  std::uint64_t request_capacity() const { return request_capacity_; }
  std::uint64_t reply_capacity() const { return reply_capacity_; }
  std::vector<Slot>& slots() { return slots_; }
  std::byte* request_area(std::uint32_t slot) { return requests_ + slot * request_capacity_; }
  const std::byte* reply_area(std::uint32_t slot) const { return replies_ + slot * reply_capacity_; }

  /// Takes the lowest free slot, whose pages are likely mapped and cached. Returns -1 if there is none.
  int take_slot();
  void give_slot(std::uint32_t slot) { free_.fetch_or(std::uint64_t{1} << slot, std::memory_order_release); }
  bool all_free() const { return free_.load(std::memory_order_acquire) == all_slots_; }

  /// Posts the frame in a slot's request area. Returns true if the caller must wake the daemon.
  bool post(std::uint32_t slot);
  /// Receives the newly posted replies. Returns false for an invalid entry.
  bool collect();
  /// Whether no reply was posted since the last collect().
  bool nothing_new() const { return header_->reply_head.load(std::memory_order_acquire) == reply_tail_; }
  /// Iterations of the daemon's loop so far, or 0 if it does not count them.
  std::uint64_t turns() const { return header_->turns.load(std::memory_order_relaxed); }
  bool daemon_sleeps() const { return header_->daemon_sleeping.load(std::memory_order_seq_cst) != 0; }
  /// Sleeps until a reply is posted, for at most `timeout`. May return early.
  void sleep(std::chrono::nanoseconds timeout);

 private:
  ForkGuard guard_;
  std::byte* base_ = nullptr;
  std::uint64_t bytes_ = 0;
  shm::SegmentHeader* header_ = nullptr;
  std::byte* requests_ = nullptr;
  const std::byte* replies_ = nullptr;
  std::uint32_t id_ = 0;
  std::uint64_t request_capacity_ = 0, reply_capacity_ = 0;
  std::vector<Slot> slots_;
  std::uint64_t all_slots_ = 0;
  std::atomic<std::uint64_t> free_{0};  ///< a bit per slot that is neither in use nor leased to a frame
  std::uint32_t request_head_ = 0;      ///< requests posted
  std::uint32_t reply_tail_ = 0;        ///< replies received
};

}  // namespace clearance
