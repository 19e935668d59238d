// Pins segments, so that a GPU writes replies straight into them. Pinning and unpinning take milliseconds and are done
// by a thread; until then replies are copied on the host.
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

/// Mapped memory, unmapped by the destructor.
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
  /// Pins memory for the lifetime of the result. Throws std::exception on failure.
  using Pin = std::function<std::shared_ptr<void>(std::byte* begin, std::size_t bytes)>;
  /// A mapping under the pinner's care.
  struct Ticket {
    std::shared_ptr<Mapping> mapping;
    std::shared_ptr<void> pinned;
    bool waits = true;  ///< to be pinned
    bool done = false;  ///< to be unpinned and freed
  };

  /// @param budget most bytes pinned at a time; mappings beyond it stay unpinned
  explicit SegmentPinner(std::uint64_t budget) : SegmentPinner(budget, pin_for_device) {}
  SegmentPinner(std::uint64_t budget, Pin pin) : budget_(budget), pin_(std::move(pin)) {}
  ~SegmentPinner();  ///< after let_go() of all mappings
  SegmentPinner(const SegmentPinner&) = delete;
  SegmentPinner& operator=(const SegmentPinner&) = delete;

  /// Pins the mapping soon. Returns null, and counts it, without a thread or memory for that.
  Ticket* pin(std::shared_ptr<Mapping> mapping) noexcept;
  /// Unpins and frees the mapping, whose last owner this must be.
  void let_go(Ticket* ticket) noexcept;

  std::uint64_t bytes() const { return bytes_; }            ///< pinned now
  std::uint64_t rejections() const { return rejections_; }  ///< mappings left unpinned

 private:
  static std::shared_ptr<void> pin_for_device(std::byte* begin, std::size_t bytes);
  void work();
  std::shared_ptr<void> try_to_pin(const Mapping& mapping);

  const std::uint64_t budget_;
  const Pin pin_;
  std::atomic<std::uint64_t> bytes_{0}, rejections_{0};
  std::mutex mutex_;  // guards the following
  std::condition_variable wake_;
  std::list<Ticket> tickets_;
  bool ending_ = false;
  std::thread thread_;  // since the first ticket
};

}  // namespace clearance
