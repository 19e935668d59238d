// Device memory that another process of this machine can map: a device query's poses and rows, for planners in other
// processes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace clearance::cuda {

/// Identifies the memory to another process. It carries no access rights: any process that has it may read and write
/// all of the memory.
struct MemoryHandle {
  std::array<std::byte, 64> ipc{};   ///< cudaIpcMemHandle_t
  std::array<std::byte, 16> uuid{};  ///< of the device, whose number may differ in the other process
};

/// The kernel library's record of the memory.
struct SharedBlock {
  std::byte* data = nullptr;
  void* stream = nullptr;  ///< cudaStream_t
  MemoryHandle handle;
  int device = 0;
};

/// Functions that create such memory: those of the kernel library, or fakes.
struct SharedMemoryCalls {
  SharedBlock (*share)(int device, std::size_t bytes);
  void (*wait)(const SharedBlock& block);
  void (*release)(const SharedBlock& block);
  bool (*is_done)(const SharedBlock& block);
};
/// Throws DeviceError if the library is missing.
const SharedMemoryCalls& installed_memory();
/// The installed functions, or the fake ones. Throws DeviceError.
const SharedMemoryCalls& memory_calls();

/// Owned by this process: a client that dies or never unmaps it keeps nothing. During its lifetime its bytes may change
/// while this process reads them, so its contents are untrusted. Destruction invalidates all other mappings.
class SharedMemory {
 public:
  /// CUDA exports memory in whole blocks of this size, including unrelated data in the block. Allocations are therefore
  /// whole blocks.
  static constexpr std::size_t kConvexPart = std::size_t{2} << 20;

  /// Zero-filled, since the memory may have held other data. Throws DeviceError, also if the device cannot share
  /// memory.
  /// \param device its number
  /// \param bytes at least one
  SharedMemory(int device, std::size_t bytes);
  /// Waits for the work in its stream.
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  std::byte* data() const { return block_.data; }
  /// Bytes allocated.
  std::size_t size() const { return bytes_; }
  const MemoryHandle& handle() const { return block_.handle; }
  /// Its own cudaStream_t, which does not wait for other streams.
  void* stream() const { return block_.stream; }
  /// Waits for the work in its stream, after which the other process sees the results. Throws DeviceError.
  void wait();
  /// Whether the work in its stream is finished; does not wait. Throws DeviceError.
  bool is_done();

 private:
  std::size_t bytes_;
  const SharedMemoryCalls* calls_;
  SharedBlock block_;
};

}  // namespace clearance::cuda
