// Pool of memory for replies. Fresh memory costs a page fault per 4 KiB, which for a large reply takes longer than
// computing it.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdlib>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <new>
#include <utility>

namespace clearance::python {

/// Allocates uninitialised memory on a 64-byte boundary. Throws std::bad_alloc.
inline std::shared_ptr<void> allocate_block(std::size_t bytes) {
  constexpr std::size_t kAlignment = 64;
  std::size_t room = bytes + kAlignment;  // aligned_alloc() takes longer than malloc() for small blocks
  void* block = std::malloc(room);
  if (!block) throw std::bad_alloc();
  const std::shared_ptr<void> owner(block, std::free);
  return {owner, std::align(kAlignment, bytes, block, room)};
}

/// Blocks of memory that return to the pool with the last array over them. Thread-safe. A pool must outlive its blocks,
/// so make it static, and never destroy it.
class BlockPool {
 public:
  using Allocate = std::function<std::shared_ptr<void>(std::size_t bytes)>;
  static constexpr std::size_t kFewBytes = 128 << 10;  ///< smaller blocks are left to the heap, which reuses them
  static constexpr std::size_t kMostKept = 512 << 20;  ///< maximum size of the unused blocks, in bytes

  explicit BlockPool(Allocate allocate) : allocate_(std::move(allocate)) {}

  /// Returns uninitialised memory on a 64-byte boundary. Throws the exceptions of `allocate`.
  std::shared_ptr<void> take(std::size_t bytes) {
    if (bytes < kFewBytes) return allocate_block(bytes);
    const std::size_t size = size_class(bytes);
    std::shared_ptr<void> block = take_kept(size);
    if (!block) block = allocate_(size);
    void* const memory = block.get();
    return {memory, [this, size, block = std::move(block)](void*) mutable { keep(size, std::move(block)); }};
  }

 private:
  struct Kept {
    std::size_t size;
    std::shared_ptr<void> block;
  };

  // Eight sizes per power of two, so that replies of similar size share blocks.
  static std::size_t size_class(std::size_t bytes) {
    const std::size_t step = std::bit_floor(bytes) / 8;
    return (bytes + step - 1) / step * step;
  }
  std::shared_ptr<void> take_kept(std::size_t size) {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(kept_.begin(), kept_.end(), [&](const Kept& k) { return k.size == size; });
    if (found == kept_.end()) return {};
    std::shared_ptr<void> block = std::move(found->block);
    kept_.erase(found);
    kept_bytes_ -= size;
    return block;
  }
  void keep(std::size_t size, std::shared_ptr<void> block) {
    std::list<Kept> too_much;  // freed without the lock
    const std::lock_guard lock(mutex_);
    kept_.push_front({size, std::move(block)});
    kept_bytes_ += size;
    while (kept_bytes_ > kMostKept) {
      kept_bytes_ -= kept_.back().size;
      too_much.splice(too_much.end(), kept_, std::prev(kept_.end()));
    }
  }

  Allocate allocate_;
  std::mutex mutex_;
  std::list<Kept> kept_;  // most recently returned first
  std::size_t kept_bytes_ = 0;
};

/// The pool of ordinary memory.
inline BlockPool& plain_blocks() {
  static BlockPool& pool = *new BlockPool(allocate_block);
  return pool;
}

}  // namespace clearance::python
