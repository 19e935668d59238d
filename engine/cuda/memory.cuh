// Device and pinned memory that grows rarely and counts it, and CUDA errors as exceptions.
#pragma once

#include <cuda_runtime.h>

#include <atomic>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace clearance::cuda {

inline void check(cudaError_t error, const char* what) {
  if (error != cudaSuccess) throw std::runtime_error(std::string("CUDA: ") + what + ": " + cudaGetErrorString(error));
}

struct MemoryCounters {
  std::atomic<std::uint64_t> device_bytes{0}, pinned_bytes{0}, allocations{0};
};

/// Memory of one kind that is kept between queries. Growing loses the contents.
template <class Kind>
class Buffer {
 public:
  explicit Buffer(MemoryCounters& counters) : counters_(counters) {}
  ~Buffer() { release(); }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  /// Room for so many bytes, with some to spare when it has to grow.
  std::byte* reserve(std::size_t bytes) {
    if (bytes > bytes_) {
      release();
      const std::size_t wanted = bytes + bytes / 4;
      data_ = Kind::allocate(wanted);
      bytes_ = wanted;
      Kind::count(counters_) += bytes_;
      ++counters_.allocations;
    }
    return data_;
  }
  std::byte* data() const { return data_; }

  void release() {
    if (!data_) return;
    Kind::release(data_);
    Kind::count(counters_) -= bytes_;
    data_ = nullptr;
    bytes_ = 0;
  }

 private:
  MemoryCounters& counters_;
  std::byte* data_ = nullptr;
  std::size_t bytes_ = 0;
};

struct DeviceKind {
  static std::byte* allocate(std::size_t bytes) {
    void* p = nullptr;
    check(cudaMalloc(&p, bytes), ("device memory, " + std::to_string(bytes) + " bytes").c_str());
    return static_cast<std::byte*>(p);
  }
  static void release(std::byte* p) { cudaFree(p); }
  static std::atomic<std::uint64_t>& count(MemoryCounters& c) { return c.device_bytes; }
};
struct PinnedKind {
  static std::byte* allocate(std::size_t bytes) {
    void* p = nullptr;
    check(cudaMallocHost(&p, bytes), ("pinned memory, " + std::to_string(bytes) + " bytes").c_str());
    return static_cast<std::byte*>(p);
  }
  static void release(std::byte* p) { cudaFreeHost(p); }
  static std::atomic<std::uint64_t>& count(MemoryCounters& c) { return c.pinned_bytes; }
};
using DeviceBuffer = Buffer<DeviceKind>;
using PinnedBuffer = Buffer<PinnedKind>;

/// Arrays packed one after another in pinned memory and copied to the device in one go.
class Upload {
 public:
  explicit Upload(MemoryCounters& counters) : host_(counters), device_(counters) {}

  void clear() { arrays_.clear(), bytes_ = 0; }
  /// \returns the array's offset.
  template <class T>
  std::size_t add(std::span<const T> array) {
    const std::size_t at = bytes_;
    arrays_.push_back({array.data(), array.size_bytes(), at});
    bytes_ += (array.size_bytes() + 255) / 256 * 256;
    return at;
  }
  void send(cudaStream_t stream) {
    if (bytes_ == 0) return;
    std::byte* host = host_.reserve(bytes_);
    device_.reserve(bytes_);
    for (const Array& a : arrays_)
      if (a.bytes > 0) std::memcpy(host + a.at, a.data, a.bytes);
    check(cudaMemcpyAsync(device_.data(), host, bytes_, cudaMemcpyHostToDevice, stream),
          "copying a query to the device");
  }
  /// For what is sent once.
  void forget_host() { host_.release(); }
  template <class T>
  const T* at(std::size_t offset) const {
    return reinterpret_cast<const T*>(device_.data() + offset);
  }

 private:
  struct Array {
    const void* data;
    std::size_t bytes, at;
  };
  std::vector<Array> arrays_;
  std::size_t bytes_ = 0;
  PinnedBuffer host_;
  DeviceBuffer device_;
};

}  // namespace clearance::cuda
