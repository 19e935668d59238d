// Device and pinned memory that grows rarely and is counted, and CUDA errors as exceptions.
#pragma once

#include <cuda_runtime.h>

#include <atomic>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "engine/device/device_error.h"

namespace clearance::cuda {

inline void check(cudaError_t error, const char* what) {
  if (error == cudaSuccess) return;
  const bool is_out_of_memory = error == cudaErrorMemoryAllocation;
  cudaGetLastError();  // clears the error, which this thread's next call, maybe for another device, would return too
  throw DeviceError(is_out_of_memory ? DeviceError::kNoMemory : DeviceError::kLost,
                    std::string("CUDA: ") + what + ": " + cudaGetErrorString(error));
}

struct Event {
  cudaEvent_t event{};
  Event() { check(cudaEventCreate(&event), "making an event"); }
  ~Event() { cudaEventDestroy(event); }
  Event(const Event&) = delete;
};

/// Number of blocks of `threads` threads for `count` elements.
inline unsigned blocks_of(std::uint64_t count, std::uint32_t threads) {
  return static_cast<unsigned>((count + threads - 1) / threads);
}

/// Number of blocks for a list whose length only the device knows: `on_each` for each multiprocessor of the current one.
inline unsigned blocks_for_device(unsigned on_each) {
  int device = 0, multiprocessors = 0;
  check(cudaGetDevice(&device), "getting the device");
  check(cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device), "counting multiprocessors");
  return on_each * static_cast<unsigned>(multiprocessors);
}

/// Makes a device the calling thread's current one during its lifetime. Kernels, events and memory then use it.
class OnDevice {
 public:
  explicit OnDevice(int number) {
    check(cudaGetDevice(&before_), "getting the device");
    if (number != before_) check(cudaSetDevice(number), "choosing a device");
    moved_ = number != before_;
  }
  ~OnDevice() {
    if (moved_) cudaSetDevice(before_);
  }
  OnDevice(const OnDevice&) = delete;
  OnDevice& operator=(const OnDevice&) = delete;

 private:
  int before_ = 0;
  bool moved_ = false;
};

/// Limit on device memory, shared by the scene and queries.
struct MemoryBudget {
  std::uint64_t limit = ~std::uint64_t{0};  ///< bytes
  std::atomic<std::uint64_t> used{0};
};

struct MemoryCounters {
  MemoryCounters() = default;
  explicit MemoryCounters(MemoryBudget& b) : budget(&b) {}

  MemoryBudget* budget = nullptr;  ///< null for no limit
  std::atomic<std::uint64_t> device_bytes{0}, pinned_bytes{0}, allocations{0};
};

/// Memory of one kind, kept between queries. Growing discards the contents.
template <class Kind>
class Buffer {
 public:
  explicit Buffer(MemoryCounters& counters) : counters_(counters) {}
  ~Buffer() { release(); }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  /// Ensures a capacity, with some spare if it has to grow.
  std::byte* reserve(std::size_t bytes) {
    if (bytes > bytes_) {
      release();
      std::size_t wanted = bytes + bytes / 4;
      if (!Kind::take(counters_, wanted)) {
        wanted = bytes;
        if (!Kind::take(counters_, wanted)) {
          const MemoryBudget& budget = *counters_.budget;
          throw DeviceError(DeviceError::kNoMemory, "device memory: " + std::to_string(budget.used + wanted) +
                                                        " bytes would be needed, and the budget is " +
                                                        std::to_string(budget.limit));
        }
      }
      try {
        data_ = Kind::allocate(wanted);
      } catch (...) {
        Kind::give_back(counters_, wanted);
        throw;
      }
      bytes_ = wanted;
      Kind::count(counters_) += bytes_;
      ++counters_.allocations;
    }
    return data_;
  }
  std::byte* data() const { return data_; }
  std::size_t size() const { return bytes_; }

  void release() {
    if (!data_) return;
    Kind::release(data_);
    Kind::give_back(counters_, bytes_);
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
  static bool take(MemoryCounters& c, std::size_t bytes) {
    if (!c.budget) return true;
    const std::uint64_t before = c.budget->used.fetch_add(bytes);
    if (before <= c.budget->limit && bytes <= c.budget->limit - before) return true;
    c.budget->used -= bytes;
    return false;
  }
  static void give_back(MemoryCounters& c, std::size_t bytes) {
    if (c.budget) c.budget->used -= bytes;
  }
  static std::atomic<std::uint64_t>& count(MemoryCounters& c) { return c.device_bytes; }
};
struct PinnedKind {
  static std::byte* allocate(std::size_t bytes) {
    void* p = nullptr;
    check(cudaMallocHost(&p, bytes), ("pinned memory, " + std::to_string(bytes) + " bytes").c_str());
    return static_cast<std::byte*>(p);
  }
  static void release(std::byte* p) { cudaFreeHost(p); }
  static bool take(MemoryCounters&, std::size_t) { return true; }
  static void give_back(MemoryCounters&, std::size_t) {}
  static std::atomic<std::uint64_t>& count(MemoryCounters& c) { return c.pinned_bytes; }
};
using DeviceBuffer = Buffer<DeviceKind>;
using PinnedBuffer = Buffer<PinnedKind>;

/// Arrays packed into pinned memory and copied to the device, in one transfer unless the device holds a part of them.
class Upload {
 public:
  explicit Upload(MemoryCounters& counters) : host_(counters), device_(counters) {}

  void clear() { arrays_.clear(), bytes_ = new_bytes_ = 0; }
  /// \param array a range of T, or of another type with the same bytes
  /// \param to send() sets it to the array in device memory
  template <class Range, class T>
  void add(const Range& array, const T*& to) {
    add_after(static_cast<const T*>(nullptr), 0, array, to);
  }
  /// The same for an array whose beginning is on this device already.
  /// \param held (count,) device memory, valid until send() has completed
  template <class Range, class T>
  void add_after(const T* held, std::size_t count, const Range& array, const T*& to) {
    const std::span<const std::byte> bytes = std::as_bytes(std::span(array));
    const std::size_t held_bytes = count * sizeof(T);
    const auto set = [](void* to_set, const std::byte* at) {
      *static_cast<const T**>(to_set) = reinterpret_cast<const T*>(at);
    };
    arrays_.push_back({bytes, new_bytes_, bytes_, held, held_bytes, &to, set});
    bytes_ += aligned(held_bytes + bytes.size());
    new_bytes_ += aligned(bytes.size());
  }
  void send(cudaStream_t stream) {
    if (bytes_ > 0) {
      std::byte* const host = host_.reserve(new_bytes_);
      device_.reserve(bytes_);
      for (const Array& a : arrays_)
        if (!a.bytes.empty()) std::memcpy(host + a.at_host, a.bytes.data(), a.bytes.size());
      copy_all(host, stream);
    }
    for (const Array& a : arrays_) a.set(a.to, device_.data() + a.at);
  }
  std::size_t new_bytes() const { return new_bytes_; }  ///< that send() copies from host memory
  std::size_t device_size() const { return device_.size(); }
  /// Frees the host copy of data that is sent only once.
  void forget_host() { host_.release(); }

 private:
  struct Array {
    std::span<const std::byte> bytes;
    std::size_t at_host, at;  // of `bytes`; of the whole array in device memory
    const void* held;
    std::size_t held_bytes;
    void* to;
    void (*set)(void* to, const std::byte* at);
  };
  static std::size_t aligned(std::size_t bytes) { return (bytes + 255) / 256 * 256; }
  static void copy(std::byte* to, const void* from, std::size_t bytes, cudaMemcpyKind kind, cudaStream_t stream) {
    if (bytes > 0) check(cudaMemcpyAsync(to, from, bytes, kind, stream), "copying a query to the device");
  }
  void copy_all(const std::byte* host, cudaStream_t stream) {
    std::byte* const device = device_.data();
    if (bytes_ == new_bytes_) return copy(device, host, bytes_, cudaMemcpyHostToDevice, stream);
    for (const Array& a : arrays_) {
      copy(device + a.at, a.held, a.held_bytes, cudaMemcpyDeviceToDevice, stream);
      copy(device + a.at + a.held_bytes, host + a.at_host, a.bytes.size(), cudaMemcpyHostToDevice, stream);
    }
  }
  std::vector<Array> arrays_;
  std::size_t bytes_ = 0, new_bytes_ = 0;
  PinnedBuffer host_;
  DeviceBuffer device_;
};

}  // namespace clearance::cuda
