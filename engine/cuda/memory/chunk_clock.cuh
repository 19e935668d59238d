// Kernel time of a query's chunks, some of which run concurrently.
#pragma once

#include <algorithm>

#include "engine/cuda/memory/memory.cuh"
#include "engine/device/device.h"

namespace clearance::cuda {

/// Timing of the chunk in a slot.
struct ChunkTime {
  Event begun;
  std::uint64_t chunk = 0;  // index in the query
};

class ChunkClock {
 public:
  /// Starts another query.
  void restart() { chunks_ = 0; }
  /// Call before and after launching a chunk's kernels.
  void begin(ChunkTime& time, cudaStream_t stream) {
    check(cudaEventRecord(time.begun.event, stream), "recording an event");
  }
  void end(ChunkTime& time, cudaStream_t stream) {
    time.chunk = chunks_++;
    check(cudaEventRecord(ended(time.chunk), stream), "recording an event");
  }
  /// Time of a finished chunk: since its kernels began, or since the previous chunk ended if they overlapped.
  std::uint64_t nanoseconds(const ChunkTime& time) const {
    float milliseconds = 0;
    check(cudaEventElapsedTime(&milliseconds, time.begun.event, ended(time.chunk)), "reading events");
    if (time.chunk > 0) {
      float after = 0;
      check(cudaEventElapsedTime(&after, ended(time.chunk - 1), ended(time.chunk)), "reading events");
      milliseconds = std::clamp(after, 0.0f, milliseconds);
    }
    return static_cast<std::uint64_t>(1e6 * milliseconds);
  }

 private:
  // One more than run concurrently: a chunk's time is read while the previous chunk's event is still kept.
  static constexpr std::uint64_t kKept = kChunksUnderWay + 1;
  cudaEvent_t ended(std::uint64_t chunk) const { return ended_[chunk % kKept].event; }

  Event ended_[kKept];
  std::uint64_t chunks_ = 0;  // chunks of the query so far
};

}  // namespace clearance::cuda
