// Memory and launches of a slot's search for near pairs over a whole table (table_kernel.cuh).
#pragma once

#include <bit>
#include <cub/device/device_radix_sort.cuh>

#include "engine/cuda/reduce/table_kernel.cuh"
#include "engine/cuda/workspace/resident.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kFewestNear = 1u << 10;  // minimum capacity for near pairs

class TableSearch {
 public:
  explicit TableSearch(MemoryCounters& c)
      : device_tiles_(c), device_order_(c), device_keys_(c), device_words_(c), device_sort_(c) {}

  /// Expected number of near pairs: the recent number plus an eighth, initially a few per body. Buffers have a quarter
  /// to spare, so the second query of a kind allocates nothing.
  std::uint32_t expected(std::uint32_t bodies) const {
    return std::max(expected_ > 0 ? expected_ : 4 * bodies, kFewestNear);
  }
  void found(std::uint32_t pairs) { expected_ = std::max(pairs + pairs / 8, expected_ - expected_ / 8); }

  /// Allocates memory for r.capacity pairs and sets the table's part of the view. No work may be in flight.
  void reserve(ReducedView& r, const CudaTable& table, cudaStream_t stream) {
    const std::uint32_t n = r.chunk.bodies.bodies;
    r.table = table.view;
    r.key_bits = static_cast<std::uint32_t>(std::bit_width(std::max(n, 2u) - 1));
    r.found =
        reinterpret_cast<std::uint64_t*>(device_keys_.reserve(2 * std::size_t{r.capacity} * sizeof(std::uint64_t)));
    r.keys = r.found + r.capacity;
    const std::size_t words = hit_word_count(r);
    r.hit_words = reinterpret_cast<std::uint32_t*>(device_words_.reserve(2 * words * sizeof(std::uint32_t)));
    r.hit_ranks = is_few(r) ? nullptr : r.hit_words + words;
    tiles_.bodies = n;
    tiles_.tiles = (n + kTileBodies - 1) / kTileBodies;
    tiles_.given = r.chunk.bodies.fixed_box;
    std::size_t of_keys = 0, of_bodies = 0;
    if (!is_few(r)) sort_keys(r, nullptr, of_keys, stream);
    order_ = nullptr;
    if (n >= kOrderedBodies) {
      order_ =
          reinterpret_cast<std::uint32_t*>(device_order_.reserve((std::size_t{4} * n + 6) * sizeof(std::uint32_t)));
      tiles_.box = reinterpret_cast<OuterBox*>(
          device_tiles_.reserve(std::size_t{tiles_.tiles} * (kTileBodies + 1) * sizeof(OuterBox)));
      tiles_.tile = tiles_.box + std::size_t{tiles_.tiles} * kTileBodies;
      sort_bodies(nullptr, of_bodies, stream);
    }
    tiles_.order = order_ ? order_ + std::size_t{3} * n : nullptr;
    sort_bytes_ = std::max(of_keys, of_bodies);
    if (sort_bytes_ > 0) device_sort_.reserve(sort_bytes_);
  }

  /// Sorts large numbers of bodies, with a box for each 32 of them.
  void prepare(cudaStream_t stream) {
    if (!order_) return;
    const OuterBox* boxes = tiles_.given;
    const std::uint32_t n = tiles_.bodies;
    std::uint32_t* const bounds = order_ + std::size_t{4} * n;
    check(cudaMemsetAsync(bounds, 0xff, 6 * sizeof(std::uint32_t), stream), "clearing bounds");
    bound_bodies<<<blocks_of(n, kScanThreads), kScanThreads, 0, stream>>>(boxes, n, bounds);
    place_on_curve<<<blocks_of(n, kScanThreads), kScanThreads, 0, stream>>>(boxes, n, bounds, order_,
                                                                            order_ + std::size_t{2} * n);
    sort_bodies(device_sort_.data(), sort_bytes_, stream);
    make_tiles<<<blocks_of(tiles_.tiles, kSearchWarps), kSearchWarps * 32, 0, stream>>>(tiles_);
    check(cudaGetLastError(), "starting a kernel");
  }

  /// Lists the pairs whose boxes are within max_distance, in table order. Each counts as a hit for now.
  void run(const ReducedView& r, cudaStream_t stream) {
    if (!is_few(r)) check(cudaMemsetAsync(r.found, 0xff, r.capacity * sizeof(std::uint64_t), stream), "clearing pairs");
    const float limit = square_from_above(r.chunk.pair_limits.max_distance);
    if (order_)
      find_near<true>
          <<<dim3(blocks_of(tiles_.tiles, kSearchWarps * kSpan), tiles_.tiles), kSearchWarps * 32, 0, stream>>>(
              r, tiles_, limit);
    else
      find_near<false><<<dim3(blocks_of(tiles_.tiles, kSearchWarps), tiles_.tiles), kSearchWarps * 32, 0, stream>>>(
          r, tiles_, limit);
    check(cudaGetLastError(), "starting a kernel");
    check(cudaEventRecord(ended_.event, stream), "recording an event");
    if (is_few(r)) {
      order_items<<<hit_word_count(r), kScanThreads, 0, stream>>>(r);
    } else {
      sort_keys(r, device_sort_.data(), sort_bytes_, stream);
      begin_hits<<<blocks_of(hit_word_count(r), kScanThreads), kScanThreads, 0, stream>>>(r);
    }
  }

  /// Time from an event until the pairs were found, before sorting.
  std::uint64_t nanoseconds_since(const Event& begun) const {
    float milliseconds = 0;
    check(cudaEventElapsedTime(&milliseconds, begun.event, ended_.event), "reading events");
    return static_cast<std::uint64_t>(1e6 * milliseconds);
  }

 private:
  static bool is_few(const ReducedView& r) { return r.capacity <= kFewItems; }
  void sort_keys(const ReducedView& r, void* memory, std::size_t& bytes, cudaStream_t stream) {
    check(cub::DeviceRadixSort::SortKeys(memory, bytes, r.found, r.keys, r.capacity, 0,
                                         static_cast<int>(2 * r.key_bits), stream),
          "sorting pairs");
  }
  // Keys, sorted keys, bodies, sorted bodies.
  void sort_bodies(void* memory, std::size_t& bytes, cudaStream_t stream) {
    const std::size_t n = tiles_.bodies;
    check(
        cub::DeviceRadixSort::SortPairs(memory, bytes, order_, order_ + n, order_ + 2 * n, order_ + 3 * n,
                                        static_cast<std::uint32_t>(n), 0, static_cast<int>(3 * kCurveBits + 1), stream),
        "sorting bodies");
  }

  DeviceBuffer device_tiles_, device_order_, device_keys_, device_words_, device_sort_;
  std::size_t sort_bytes_ = 0;
  std::uint32_t* order_ = nullptr;  // null if bodies are in id order
  TilesView tiles_{};
  std::uint32_t expected_ = 0;
  Event ended_;
};

}  // namespace clearance::cuda
