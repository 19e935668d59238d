// Pairs of a whole table within a distance, found by boxes without visiting every pair.
//
// Bodies are grouped in tiles of 32. A warp compares the bodies of two tiles, 32 by 32: each thread's hits are bits of
// a word, and the warp reserves list space for all of them with one atomic operation. Large numbers of bodies are first
// sorted along a Morton curve, and each tile gets a box; a warp then first compares its tile with several others, one
// per thread.
#pragma once

#include <cmath>
#include <limits>

#include "engine/cuda/reduce/reduce_kernel.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kTileBodies = 32;
inline constexpr std::uint32_t kSearchWarps = 4;       // per block
inline constexpr std::uint32_t kOrderedBodies = 6144;  // minimum number of bodies for which sorting pays
inline constexpr std::uint32_t kSpan = 8;              // tiles that a warp compares its own with, if sorted
inline constexpr std::uint32_t kCurveBits = 5;         // per coordinate: about as many cells as bodies
inline constexpr std::uint32_t kFewItems = 8192;       // maximum number sorted by comparing each with each

// Boxes in search order, grouped in tiles.
struct TilesView {
  std::uint32_t bodies, tiles;
  const OuterBox* given;  // (bodies,)
  // If the bodies are sorted:
  const std::uint32_t* order;  // (bodies,); null if in id order, without the following arrays
  OuterBox* box;               // (tiles, 32) searched_box() of each body
  OuterBox* tile;              // (tiles,)
};

__device__ inline std::uint32_t least_of_warp(std::uint32_t x) {
  for (int step = 16; step > 0; step /= 2) x = min(x, __shfl_xor_sync(~0u, x, step));
  return x;
}
__device__ inline std::uint32_t greatest_of_warp(std::uint32_t x) {
  return ~least_of_warp(~x);
}
__device__ inline float middle_of(const OuterBox& box, int axis) {
  const float low = axis == 0   ? box.low_x
                    : axis == 1 ? box.low_y
                                : box.low_z,
              high = axis == 0   ? box.high_x
                     : axis == 1 ? box.high_y
                                 : box.high_z;
  return 0.5f * low + 0.5f * high;
}

// Range of all box centres: bounds[0..2] are the least keys, bounds[3..5] the complements of the greatest. All bits
// must be set before.
__global__ void __launch_bounds__(kScanThreads)
    bound_bodies(const OuterBox* boxes, std::uint32_t bodies, std::uint32_t* bounds) {
  const std::uint32_t body = blockIdx.x * kScanThreads + threadIdx.x;
  const bool there = body < bodies && !is_empty(boxes[body]);
  for (int i = 0; i < 3; ++i) {
    const std::uint32_t key = there ? order_key(middle_of(boxes[body], i)) : 0;
    const std::uint32_t least = least_of_warp(there ? key : ~0u), greatest = greatest_of_warp(key);
    if (threadIdx.x % 32 == 0) {
      atomicMin(bounds + i, least);
      atomicMin(bounds + 3 + i, ~greatest);
    }
  }
}

// Inserts two zero bits above each of the lowest kCurveBits bits.
__device__ inline std::uint32_t spread_bits(std::uint32_t x) {
  std::uint32_t spread = 0;
  for (std::uint32_t bit = 0; bit < kCurveBits; ++bit) spread |= (x >> bit & 1) << 3 * bit;
  return spread;
}
// Positions on the curve. Bodies without a usable pose come last.
inline constexpr std::uint32_t kOffCurve = 1u << 3 * kCurveBits;
__global__ void __launch_bounds__(kScanThreads)
    place_on_curve(const OuterBox* boxes, std::uint32_t bodies, const std::uint32_t* bounds, std::uint32_t* keys,
                   std::uint32_t* ids) {
  const std::uint32_t body = blockIdx.x * kScanThreads + threadIdx.x;
  if (body >= bodies) return;
  ids[body] = body;
  std::uint32_t key = 0;
  for (int i = 0; i < 3; ++i) {
    const float low = from_order_key(bounds[i]), high = from_order_key(~bounds[3 + i]);
    const float at = (middle_of(boxes[body], i) - low) / (high - low) * static_cast<float>(1u << kCurveBits);
    const auto cell =
        static_cast<std::uint32_t>(fminf(fmaxf(at, 0.0f), static_cast<float>((1u << kCurveBits) - 1)));  // 0 for NaN
    key |= spread_bits(cell) << i;
  }
  keys[body] = is_empty(boxes[body]) ? kOffCurve : key;
}

// A body's box for the search, with the body's id in unused[0]. Infinite if the body has no usable pose, since nothing
// is proved about its pairs.
__device__ inline OuterBox searched_box(const TilesView& t, std::uint32_t place) {
  constexpr float kInf = __builtin_inff();
  OuterBox box{kInf, kInf, kInf, -kInf, -kInf, -kInf, {0, 0}};
  std::uint32_t body = kNone;
  if (place < t.bodies) {
    body = t.order ? t.order[place] : place;
    box = t.given[body];
    if (is_empty(box)) box = {-kInf, -kInf, -kInf, kInf, kInf, kInf, {0, 0}};
  }
  box.unused[0] = __uint_as_float(body);
  return box;
}

// One warp per tile.
__global__ void __launch_bounds__(kSearchWarps * 32) make_tiles(TilesView t) {
  const std::uint32_t tile = blockIdx.x * kSearchWarps + threadIdx.x / 32, lane = threadIdx.x % 32;
  if (tile >= t.tiles) return;
  const std::uint32_t place = tile * kTileBodies + lane;
  OuterBox box = searched_box(t, place);
  t.box[place] = box;
  for (float* side : {&box.low_x, &box.low_y, &box.low_z}) *side = from_order_key(least_of_warp(order_key(*side)));
  for (float* side : {&box.high_x, &box.high_y, &box.high_z})
    *side = from_order_key(greatest_of_warp(order_key(*side)));
  if (lane == 0) t.tile[tile] = box;
}

// Whether boxes are proved farther apart than the distance of the limit. Never true for infinite boxes.
__device__ inline bool is_far(const OuterBox& a, const OuterBox& b, float limit) {
  return squared_gap(a, b) > limit;
}

// Lists the candidates as a << key_bits | b, in no order. Block y handles tile y; its warps share the other tiles.
template <bool kOrdered>
__global__ void __launch_bounds__(kSearchWarps * 32)
    find_near(const __grid_constant__ ReducedView r, const __grid_constant__ TilesView t, float limit) {
  __shared__ OuterBox shared_boxes[kTileBodies];
  constexpr std::uint32_t span = kOrdered ? kSpan : 1;
  const auto box_at = [&](std::uint32_t place) { return kOrdered ? t.box[place] : searched_box(t, place); };
  const std::uint32_t lane = threadIdx.x % 32, mine = blockIdx.y;
  const std::uint32_t first = mine + (blockIdx.x * kSearchWarps + threadIdx.x / 32) * span;
  if (mine + blockIdx.x * kSearchWarps * span >= t.tiles) return;  // uniform over the block
  if (threadIdx.x < kTileBodies) shared_boxes[threadIdx.x] = box_at(mine * kTileBodies + threadIdx.x);
  __syncthreads();
  const bool near_tile =
      lane < span && first + lane < t.tiles && !(kOrdered && is_far(t.tile[mine], t.tile[first + lane], limit));
  for (unsigned tiles = __ballot_sync(~0u, near_tile); tiles != 0; tiles &= tiles - 1) {
    const std::uint32_t other = first + static_cast<std::uint32_t>(__ffs(static_cast<int>(tiles))) - 1;
    const OuterBox box = box_at(other * kTileBodies + lane);
    const std::uint32_t body = __float_as_uint(box.unused[0]);
    std::uint32_t hits = 0;
#pragma unroll 8
    for (std::uint32_t i = 0; i < kTileBodies; ++i)
      if (!is_far(shared_boxes[i], box, limit)) hits |= 1u << i;
    if (other == mine) hits &= (1u << lane) - 1;
    if (body == kNone) hits = 0;
    for (std::uint32_t left = hits; left != 0; left &= left - 1) {
      const std::uint32_t i = static_cast<std::uint32_t>(__ffs(static_cast<int>(left))) - 1;
      const std::uint32_t with = __float_as_uint(shared_boxes[i].unused[0]);
      if (with == kNone || !is_enabled(r.table, min(with, body), max(with, body))) hits &= ~(1u << i);
    }
    if (__ballot_sync(~0u, hits != 0) == 0) continue;
    const std::uint32_t own = __popc(hits);
    std::uint32_t up_to = own;
    for (int step = 1; step < 32; step *= 2) {
      const std::uint32_t before = __shfl_up_sync(~0u, up_to, step);
      if (lane >= static_cast<std::uint32_t>(step)) up_to += before;
    }
    std::uint32_t at = 0;
    if (lane == 31) at = atomicAdd(r.chunk.counts + kCandidates, up_to);
    at = __shfl_sync(~0u, at, 31) + up_to - own;
    for (; hits != 0; hits &= hits - 1, ++at) {
      const std::uint32_t i = static_cast<std::uint32_t>(__ffs(static_cast<int>(hits))) - 1;
      const std::uint32_t with = __float_as_uint(shared_boxes[i].unused[0]);
      if (at < r.capacity) r.found[at] = std::uint64_t{min(with, body)} << r.key_bits | max(with, body);
    }
  }
}

// Every item is a hit until it is proved beyond.
__device__ inline std::uint32_t first_hits(std::uint32_t word, std::uint32_t count) {
  const std::uint32_t begin = word * 32;
  return begin >= count ? 0 : count - begin >= 32 ? ~0u : (1u << (count - begin)) - 1;
}
__global__ void __launch_bounds__(kScanThreads) begin_hits(const __grid_constant__ ReducedView r) {
  const std::uint32_t word = blockIdx.x * kScanThreads + threadIdx.x;
  if (word < hit_word_count(r)) r.hit_words[word] = first_hits(word, item_count(r));
}

// The same, and sorts few pairs: the position of each is the number of lesser keys, counted in shares by the block's
// warps.
__global__ void __launch_bounds__(kScanThreads) order_items(const __grid_constant__ ReducedView r) {
  constexpr std::uint32_t kLoads = 4, kKeys = kLoads * kScanThreads, kShare = kKeys / (kScanThreads / 32);
  __shared__ std::uint32_t less_of[32];
  __shared__ std::uint64_t keys[kKeys];
  const std::uint32_t lane = threadIdx.x % 32, warp = threadIdx.x / 32, item = blockIdx.x * 32 + lane,
                      count = item_count(r);
  if (threadIdx.x == 0) r.hit_words[blockIdx.x] = first_hits(blockIdx.x, count);
  if (blockIdx.x * 32 >= count) return;  // uniform over the block
  if (warp == 0) less_of[lane] = 0;
  const std::uint64_t key = item < count ? r.found[item] : 0;
  std::uint32_t less = 0;
  for (std::uint32_t first = 0; first < count; first += kKeys) {
    __syncthreads();
#pragma unroll
    for (std::uint32_t i = 0; i < kLoads; ++i) {
      const std::uint32_t at = i * kScanThreads + threadIdx.x;
      keys[at] = first + at < count ? r.found[first + at] : ~std::uint64_t{0};
    }
    __syncthreads();
#pragma unroll 8
    for (std::uint32_t i = 0; i < kShare; ++i) less += keys[warp * kShare + i] < key;
  }
  atomicAdd(less_of + lane, less);
  __syncthreads();
  if (warp == 0 && item < count) r.keys[less_of[lane]] = key;
}

}  // namespace clearance::cuda
