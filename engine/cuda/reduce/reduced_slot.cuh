// Memory and state of one chunk of a reduced query.
#pragma once

#include <thrust/iterator/transform_iterator.h>

#include <cub/device/device_scan.cuh>

#include "engine/cuda/memory/chunk_clock.cuh"
#include "engine/cuda/reduce/reduced_launch.cuh"
#include "engine/cuda/reduce/table_search.cuh"

namespace clearance::cuda {

struct CountBits {
  __host__ __device__ std::uint32_t operator()(std::uint32_t word) const {
#ifdef __CUDA_ARCH__
    return static_cast<std::uint32_t>(__popc(word));
#else
    return static_cast<std::uint32_t>(__builtin_popcount(word));
#endif
  }
};

struct ReducedSlot : QuerySlot {
  ReducedSlot(MemoryCounters& c, int priority)
      : QuerySlot(c, priority),
        device_groups(c),
        device_words(c),
        device_scan(c),
        device_items(c),
        device_counts(c),
        device_answers(c),
        host_reply(c),
        host_counts(c),
        host_rest(c),
        host_answers(c),
        table(c) {}

  // Computes the number of bits set before each word. The first call after `scan_bytes` was cleared only computes the
  // memory required.
  void rank(const std::uint32_t* words, std::uint32_t* ranks) {
    const auto counts = thrust::make_transform_iterator(words, CountBits());
    void* memory = scan_bytes == 0 ? nullptr : device_scan.data();
    check(cub::DeviceScan::ExclusiveSum(memory, scan_bytes, counts, ranks, hit_word_count(view), stream),
          "ranking rows");
  }
  void reserve_ranks() {
    scan_bytes = 0;
    rank(view.hit_words, view.hit_ranks);
    device_scan.reserve(scan_bytes);
  }

  DeviceBuffer device_groups, device_words, device_scan, device_items, device_counts, device_answers;
  PinnedBuffer host_reply, host_counts, host_rest, host_answers;
  TableSearch table;
  ChunkTime time;
  std::uint32_t listed = 0;  // largest capacity so far, for listed pairs
  bool counts_are_clear = false;
  std::size_t scan_bytes = 0;
  std::uint64_t most_rows = 0;  // limit of the reply
  ReducedView view;
  ReplyView direct;
};

}  // namespace clearance::cuda
