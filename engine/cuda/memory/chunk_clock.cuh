// How long the kernels of a query's chunks take, some of which run side by side.
#pragma once

#include <algorithm>

#include "engine/cuda/memory/memory.cuh"
#include "engine/device/device.h"

namespace clearance::cuda {

/// What a slot keeps of the chunk in it.
struct ChunkTime {
  Event begun;
  std::uint64_t chunk = 0;  // of the query
};

class ChunkClock {
 public:
  /// Another query's chunks come.
  void restart() { chunks_ = 0; }
  /// Before a chunk's kernels are started, and behind them.
  void begin(ChunkTime& time, cudaStream_t stream) {
    check(cudaEventRecord(time.begun.event, stream), "recording an event");
  }
  void end(ChunkTime& time, cudaStream_t stream) {
    time.chunk = chunks_++;
    check(cudaEventRecord(ended(time.chunk), stream), "recording an event");
  }
  /// Of a chunk that is done: since its kernels began, or since the chunk before ended if they ran side by side.
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
  // One more than run side by side: a chunk is asked about while the one before it is still known.
  static constexpr std::uint64_t kKept = kChunksUnderWay + 1;
  cudaEvent_t ended(std::uint64_t chunk) const { return ended_[chunk % kKept].event; }

  Event ended_[kKept];
  std::uint64_t chunks_ = 0;  // of the query, so far
};

}  // namespace clearance::cuda
