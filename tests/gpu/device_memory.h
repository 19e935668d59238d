// Memory, streams and graphs of the installed device, for tests without CUDA headers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <utility>
#include <vector>

namespace clearance::test {

/// The number of GPUs that this process sees.
int device_count();

/// Bytes on the device. Errors end the program: this is for tests and benchmarks only.
class DeviceMemory {
 public:
  explicit DeviceMemory(std::size_t bytes);
  ~DeviceMemory();
  DeviceMemory(const DeviceMemory&) = delete;
  DeviceMemory& operator=(const DeviceMemory&) = delete;

  std::byte* data() const { return data_; }
  std::size_t size() const { return bytes_; }
  void put(const void* from, std::size_t bytes);
  void fill(int byte);
  /// Returns all bytes.
  std::vector<std::byte> get() const;

 private:
  std::byte* data_ = nullptr;
  std::size_t bytes_;
};

/// Copies from and to memory that others own, and waits.
void copy_to_device(std::byte* to, const void* from, std::size_t bytes);
void copy_from_device(void* to, const std::byte* from, std::size_t bytes);

/// Memory of another process, mapped during this object's lifetime.
class MappedMemory {
 public:
  /// \param handle cudaIpcMemHandle_t
  /// \param uuid of its device, which becomes the thread's current one
  MappedMemory(std::span<const std::byte, 64> handle, std::span<const std::byte, 16> uuid);
  ~MappedMemory();
  MappedMemory(const MappedMemory&) = delete;
  MappedMemory& operator=(const MappedMemory&) = delete;

  std::byte* data() const { return data_; }
  void put(std::size_t offset, const void* from, std::size_t bytes);
  std::vector<std::byte> get(std::size_t offset, std::size_t bytes) const;
  /// Sum of the 64-bit words in a range, by a kernel that reads them all. Waits for it.
  std::uint64_t sum(std::size_t offset, std::size_t bytes);

 private:
  std::byte* data_ = nullptr;
  std::byte* sum_ = nullptr;
};

/// A stream, and the graph captured in it last.
class DeviceStream {
 public:
  DeviceStream();
  ~DeviceStream();
  DeviceStream(const DeviceStream&) = delete;
  DeviceStream& operator=(const DeviceStream&) = delete;

  void* get() const { return stream_; }
  void wait();
  /// Captures the work that `work` enqueues, without running it.
  void capture(const std::function<void()>& work);
  /// Runs the graph.
  void launch();

 private:
  void *stream_ = nullptr, *graph_ = nullptr;
};

}  // namespace clearance::test
