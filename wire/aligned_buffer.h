// Buffers aligned to 64 bytes, as payloads and in-place frames require.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <new>

namespace clearance {

struct FreeDeleter {
  void operator()(void* memory) const { std::free(memory); }
};
using AlignedBytes = std::unique_ptr<std::byte, FreeDeleter>;

/// Allocates `bytes` uninitialised bytes on a 64-byte boundary. Throws std::bad_alloc. Free release()d memory with
/// std::free().
inline AlignedBytes aligned_bytes(std::size_t bytes) {
  void* memory = std::aligned_alloc(64, (bytes + 63) / 64 * 64);
  if (!memory && bytes) throw std::bad_alloc();
  return AlignedBytes(static_cast<std::byte*>(memory));
}

}  // namespace clearance
