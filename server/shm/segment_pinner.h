// Pins segments, so that a GPU writes its replies straight into them. Both pinning and the end of it take milliseconds:
// a thread does it, while queries go on with a copy on the host.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <thread>

namespace clearance {

/// Mapped memory, unmapped at the end.
class Mapping {
 public:
  Mapping(std::byte* begin, std::size_t bytes) : begin_(begin), bytes_(bytes) {}
  ~Mapping();
  Mapping(const Mapping&) = delete;
  Mapping& operator=(const Mapping&) = delete;
  std::byte* begin() const { return begin_; }
  std::size_t bytes() const { return bytes_; }

 private:
  std::byte* begin_;
  std::size_t bytes_;
};

class SegmentPinner {
 public:
  /// Pins memory for as long as what it returns lives; throws std::exception where that cannot be.
  using Pin = std::function<std::shared_ptr<void>(std::byte* begin, std::size_t bytes)>;
  /// A mapping that was given in.
  struct Ticket {
    std::shared_ptr<Mapping> mapping;
    std::shared_ptr<void> pinned;
    bool waits = true;  ///< to be pinned
    bool done = false;  ///< to be unpinned and let go of
  };

  /// \param budget bytes that may be pinned at a time; a mapping that is too much stays as it is.
  explicit SegmentPinner(std::uint64_t budget) : SegmentPinner(budget, pin_for_device) {}
  SegmentPinner(std::uint64_t budget, Pin pin) : budget_(budget), pin_(std::move(pin)) {}
  ~SegmentPinner();  ///< after all mappings were let go of
  SegmentPinner(const SegmentPinner&) = delete;
  SegmentPinner& operator=(const SegmentPinner&) = delete;

  /// Has the mapping pinned soon. Null, and counted as refused, where the machine has no thread or memory for that.
  Ticket* pin(std::shared_ptr<Mapping> mapping) noexcept;
  /// Has the mapping unpinned and then let go of, which must be the last hold on it.
  void let_go(Ticket* ticket) noexcept;

  std::uint64_t bytes() const { return bytes_; }        ///< pinned now
  std::uint64_t refusals() const { return refusals_; }  ///< mappings that stayed as they were

 private:
  static std::shared_ptr<void> pin_for_device(std::byte* begin, std::size_t bytes);
  void work();
  std::shared_ptr<void> try_to_pin(const Mapping& mapping);

  const std::uint64_t budget_;
  const Pin pin_;
  std::atomic<std::uint64_t> bytes_{0}, refusals_{0};
  std::mutex mutex_;  // of what follows
  std::condition_variable wake_;
  std::list<Ticket> tickets_;
  bool ending_ = false;
  std::thread thread_;  // since the first ticket
};

}  // namespace clearance
