// Parallel copy of host memory in order, so that its first part can be used before the last part is copied.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace clearance::cuda {

/// Next reader of the copy. A device reads data written by several cores twice as fast from memory as from their
/// caches.
enum class CopyReader : std::uint8_t { kHost, kDevice };

class OrderedCopy {
 public:
  /// \param to aligned to 16 bytes if a device reads it
  OrderedCopy(const void* from, void* to, std::size_t bytes, CopyReader reader)
      : from_(static_cast<const std::byte*>(from)),
        to_(static_cast<std::byte*>(to)),
        bytes_(bytes),
        past_caches_(reader == CopyReader::kDevice && is_worth_help(bytes)),
        done_((bytes + kBlock - 1) / kBlock) {}

  std::size_t bytes() const { return bytes_; }
  static bool is_worth_help(std::size_t bytes) { return bytes >= 3 * kShare; }
  /// \param most threads
  static int helpers_for(std::size_t bytes, int most) {
    return is_worth_help(bytes) ? static_cast<int>(std::min(bytes / kShare, static_cast<std::size_t>(most))) : 0;
  }
  /// Copies the next unclaimed block. \returns false if none is left
  bool copy_block() {
    const std::size_t block = next_.fetch_add(1, std::memory_order_relaxed);
    if (block >= done_.size()) return false;
    const std::size_t at = block * kBlock, size = std::min(kBlock, bytes_ - at);
    if (past_caches_)
      copy_past_caches(from_ + at, to_ + at, size);
    else
      std::memcpy(to_ + at, from_ + at, size);
    done_[block].store(true, std::memory_order_release);
    return true;
  }
  /// Copies blocks until the first `bytes` are copied. For one thread only.
  void wait_for(std::size_t bytes) {
    const std::size_t wanted = (bytes + kBlock - 1) / kBlock;
    while (there_ < wanted)
      if (done_[there_].load(std::memory_order_acquire))
        ++there_;
      else
        copy_block();
  }

 private:
  static constexpr std::size_t kBlock = 1u << 16;
  static constexpr std::size_t kShare = 1u << 18;  // bytes for each helper

  static void copy_past_caches(const std::byte* from, std::byte* to, std::size_t bytes) {
    std::size_t at = 0;
#ifdef __SSE2__
    for (; at + 64 <= bytes; at += 64)
      for (std::size_t i = at; i < at + 64; i += 16)
        _mm_stream_si128(reinterpret_cast<__m128i*>(to + i),
                         _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + i)));
    _mm_sfence();
#endif
    std::memcpy(to + at, from + at, bytes - at);
  }

  const std::byte* from_;
  std::byte* to_;
  std::size_t bytes_;
  bool past_caches_;
  std::vector<std::atomic<bool>> done_;  // per block
  std::atomic<std::size_t> next_{0};
  std::size_t there_ = 0;  // blocks that wait_for() has seen finished
};

}  // namespace clearance::cuda
