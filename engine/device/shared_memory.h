// Device memory that another process of this machine maps: a plan's poses and rows, for who plans elsewhere.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace clearance::cuda {

/// What another process finds the memory by. It says nothing of rights: who knows it may read and write all of it.
struct MemoryHandle {
  std::array<std::byte, 64> ipc{};   ///< cudaIpcMemHandle_t
  std::array<std::byte, 16> uuid{};  ///< of the device, whose number may be another one over there
};

/// What the library of the kernels keeps of it.
struct SharedBlock {
  std::byte* data = nullptr;
  void* stream = nullptr;  ///< cudaStream_t
  MemoryHandle handle;
  int device = 0;
};

/// What makes such memory: functions of the library of the kernels, or what stands in for them.
struct SharedMemoryCalls {
  SharedBlock (*share)(int device, std::size_t bytes);
  void (*wait)(const SharedBlock& block);
  void (*release)(const SharedBlock& block);
  bool (*is_done)(const SharedBlock& block);
};
/// Throws DeviceError where there is no such library.
const SharedMemoryCalls& installed_memory();
/// The installed ones, or what stands in for them. Throws DeviceError.
const SharedMemoryCalls& memory_calls();

/// This process owns it: a process that maps it and dies, or never unmaps, takes nothing from it. While it lives its
/// bytes may change under whoever reads them here: nothing in it may be believed. When it goes, other mappings of it
/// end being of use.
class SharedMemory {
 public:
  /// CUDA maps whole pieces of so many bytes elsewhere, with whatever else lies there: it takes them whole.
  static constexpr std::size_t kPiece = std::size_t{2} << 20;

  /// All bytes are 0: they were somebody else's. Throws DeviceError, also where the device cannot share.
  /// \param device its number \param bytes at least one
  SharedMemory(int device, std::size_t bytes);
  /// Waits for what is under way in its stream.
  ~SharedMemory();
  SharedMemory(const SharedMemory&) = delete;
  SharedMemory& operator=(const SharedMemory&) = delete;

  std::byte* data() const { return block_.data; }
  /// That were taken.
  std::size_t size() const { return bytes_; }
  const MemoryHandle& handle() const { return block_.handle; }
  /// cudaStream_t of its own, which waits for no other.
  void* stream() const { return block_.stream; }
  /// For all that is in its stream. Then it is there for the other process, too. Throws DeviceError.
  void wait();
  /// Whether all that is in its stream is over, without waiting. Throws DeviceError.
  bool is_done();

 private:
  std::size_t bytes_;
  const SharedMemoryCalls* calls_;
  SharedBlock block_;
};

}  // namespace clearance::cuda
