// Candidate pairs of a reduced query (its items) and the use of their answers: code shared by the kernels of all
// stages.
#pragma once

#include "engine/cuda/pair/least.cuh"
#include "engine/cuda/pair/pair_kernel.cuh"
#include "engine/cuda/pair/pair_table.cuh"
#include "engine/narrow/group.h"

namespace clearance::cuda {

inline constexpr std::uint32_t kItemThreads = 64;

// A pair in a configuration.
struct Item {
  std::uint32_t k, p;
  PairRef ref;

  __device__ Item(const ReducedView& r, std::uint32_t row)
      : k(row / r.chunk.pair_count), p(row - k * r.chunk.pair_count), ref(r.chunk.pairs[p]) {}
  __device__ Item(const ReducedView& r, std::uint32_t configuration, std::uint32_t pair)
      : k(configuration), p(pair), ref(r.chunk.pairs[pair]) {}
  __device__ explicit Item(PairRef of_table) : k(0), p(0), ref(of_table) {}
};

// The pair at position i in the list of candidates.
__device__ inline Item listed_item(const ReducedView& r, std::uint32_t i) {
  if (!r.keys) return Item(r, r.items[i]);
  return Item(PairRef{static_cast<std::uint32_t>(r.keys[i] >> r.key_bits),
                      static_cast<std::uint32_t>(r.keys[i]) & ((1u << r.key_bits) - 1)});
}
// Its bit in the words of Reduce::kWithin.
__device__ inline std::uint32_t listed_bit(const ReducedView& r, std::uint32_t i) {
  return r.keys ? i : r.items[i];
}
// Its row in a reply that contains all pairs.
__device__ inline std::uint32_t listed_row(const ReducedView& r, std::uint32_t i) {
  if (!r.keys) return r.items[i];
  const PairRef ref = listed_item(r, i).ref;
  return position_of(r.table, ref.a, ref.b);
}

// Kind of a pair by its bodies' geometry. If one is a cloud or a mesh, element_kernel.cuh has a kernel per kind; kLeft
// is answered by the CPU.
enum class PairKind : std::uint8_t { kHulls, kPointsAndHull, kMeshAndHull, kMeshes, kLeft };
__device__ inline PairKind kind_of(const ReducedView& r, const Item& item) {
  const std::uint32_t* const of_body = r.elements.of_body;
  if (!of_body) return PairKind::kHulls;
  const std::uint32_t a = of_body[body_of(r.chunk.bodies, item.ref.a)],
                      b = of_body[body_of(r.chunk.bodies, item.ref.b)];
  if (a == kNone && b == kNone) return PairKind::kHulls;
  const ElementSet& one = r.elements.sets[a != kNone ? a : b];
  if (a != kNone && b != kNone)
    return one.is_mesh() && r.elements.sets[b].is_mesh() ? PairKind::kMeshes : PairKind::kLeft;
  return !one.is_there() ? PairKind::kLeft : one.is_mesh() ? PairKind::kMeshAndHull : PairKind::kPointsAndHull;
}

template <class Visit>
__device__ inline void for_groups(const ReducedView& r, const Item& item, Visit visit) {
  if (r.reduce != Reduce::kNearest) return visit(std::size_t{item.k});
  visit(std::size_t{item.k} * r.groups + body_of(r.chunk.bodies, item.ref.a));
  visit(std::size_t{item.k} * r.groups + body_of(r.chunk.bodies, item.ref.b));
}

// take_least() for a whole warp, whose keys often belong to one group. All threads of the warp call it; ~0 means no
// key.
__device__ inline void take_least_of_warp(std::uint64_t* where, std::size_t group, std::uint64_t key) {
  const std::size_t first = __shfl_sync(~0u, group, 0);
  if (__all_sync(~0u, group == first || key == ~std::uint64_t{0})) {
    for (int step = 16; step > 0; step /= 2) {
      const std::uint64_t other = __shfl_xor_sync(~0u, key, step);
      if (other < key) key = other;
    }
    if (threadIdx.x % 32 == 0 && key != ~std::uint64_t{0}) take_least(where + first, key);
  } else if (key != ~std::uint64_t{0}) {
    take_least(where + group, key);
  }
}

// Keys in the order of their numbers. -0 counts as 0.
__device__ inline std::uint64_t order_key(double x) {
  const auto bits = static_cast<std::uint64_t>(__double_as_longlong(x + 0.0));
  return bits >> 63 ? ~bits : bits | std::uint64_t{1} << 63;
}
__device__ inline std::uint32_t order_key(float x) {
  const std::uint32_t bits = __float_as_uint(x);
  return bits >> 31 ? ~bits : bits | 1u << 31;
}
inline constexpr std::uint32_t kUnusable = ~0u;  // greater than the key of any number
__device__ inline double from_order_key(std::uint64_t key) {
  return __longlong_as_double(static_cast<long long>(key >> 63 ? key & ~(std::uint64_t{1} << 63) : ~key));
}
__device__ inline float from_order_key(std::uint32_t key) {
  return __uint_as_float(key >> 31 ? key & ~(1u << 31) : ~key);
}

__device__ inline bool has_usable_pair(std::uint64_t seed) {
  return static_cast<std::uint32_t>(seed >> 32) != kUnusable;
}

// Upper bound on the distance from any state of a run, even before its end: at least 0, infinite if none is proved.
template <class Hull>
__device__ inline double upper_so_far(const GjkRun<Hull>& run) {
  const Simplex<double>& s = run.g.simplex;
  const bool encloses = run.g.end == Gjk<double>::code(GjkEnd::kEncloses);  // then the weights are meaningless
  const double length = norm(encloses ? s.vertex[0].w : SimplexPoint<double>(s).w);
  const double upper =
      upper_from_point(length, run.radius, rounding_error(double(RoundingUnits<double>::kUpper), run.scale));
  return upper <= 0 ? 0 : upper < __builtin_inf() ? upper : __builtin_inf();
}

// Computes the cutoffs of the seeds, one thread per group. `handles(item)` returns whether this kernel has the seed;
// `cutoff(item)` returns its cutoff.
template <class Handles, class Cutoff>
__device__ inline void cut_off_by_seed(const ReducedView& r, const Handles& handles, const Cutoff& cutoff) {
  const std::uint64_t at = std::uint64_t{blockIdx.x} * kItemThreads + threadIdx.x;
  if (at >= std::uint64_t{r.chunk.configurations} * r.groups) return;
  const std::uint64_t seed = r.seed[at];
  if (!has_usable_pair(seed)) return;
  const auto k = static_cast<std::uint32_t>(at / r.groups);
  const Item item(r, k * r.chunk.pair_count + static_cast<std::uint32_t>(seed));
  if (!handles(item)) return;
  bool taken = false;  // by the thread of the pair's other group
  for_groups(r, item, [&](std::size_t g) { taken |= g < at && r.seed[g] == seed; });
  if (taken) return;
  const auto key = static_cast<std::uint64_t>(__double_as_longlong(cutoff(item)));
  for_groups(r, item, [&](std::size_t g) { take_least(r.cutoff + g, key); });
}
__device__ inline std::uint32_t item_count(const ReducedView& r) {
  const std::uint32_t count = r.chunk.counts[kCandidates];
  return count < r.capacity ? count : r.capacity;
}

// Lower bound for the pair's groups, improved by the gap of the boxes.
__device__ inline double group_lower(const PairAnswer& answer, const BodyPoseRef& at_a, const BodyPoseRef& at_b) {
  return lower_with_box(answer.lower, certify_box_gap(at_a.box(), at_b.box()));
}
__device__ inline void offer(const ReducedView& r, const Item& item, std::uint32_t i, const PairAnswer& answer,
                             const BodyPoseRef& at_a, const BodyPoseRef& at_b) {
  if (r.reduce == Reduce::kWithin) {
    const std::uint32_t bit = listed_bit(r, i);
    if (answer.status == Status::kBeyond) atomicAnd(r.hit_words + bit / 32, ~(1u << bit % 32));
    return;
  }
  if (isnan(answer.distance)) return;
  const std::uint64_t upper = order_key(answer.upper), lower = order_key(group_lower(answer, at_a, at_b));
  for_groups(r, item, [&](std::size_t g) {
    take_least(r.upper + g, upper);
    take_least(r.lower + g, lower);
  });
}

// Records the outcome of an item. All threads of the warp call it.
__device__ inline void report_item(const ReducedView& r, PairOutcome outcome, std::uint32_t i) {
  const std::uint32_t rest = take_place(r.chunk.counts + kRest, outcome == PairOutcome::kUnresolved);
  if (outcome == PairOutcome::kUnresolved) {
    r.chunk.rest[rest] = i;
    r.rest_rows[rest] = listed_row(r, i);
    r.answers[i] = no_answer(Status::kOk);  // the CPU's answer follows
  }
  add_count(r.chunk.counts + kConvergedRows, outcome == PairOutcome::kConverged);
}

// Leaves an item to a later kernel. All threads of the warp call it.
__device__ inline void list_later(const ReducedView& r, std::uint32_t i, bool is_later) {
  const std::uint32_t place = take_place(r.chunk.counts + kLaterItems, is_later);
  if (is_later) r.later[place] = i;
}

// Lists an item whose simplex encloses the origin. All threads of the warp call it.
__device__ inline void list_enclosed(const ChunkView& c, std::uint32_t i, Enclosed& enclosed, bool encloses) {
  const std::uint32_t place = take_place(c.counts + kEnclosedPairs, encloses);
  if (!encloses) return;
  enclosed.pair = i;
  c.enclosed[place] = enclosed;
}

// Margin of a pair, for Reduce::kAny.
__device__ inline double margin_of(const ReducedView& r, std::uint32_t p) {
  return r.margins ? r.margins[p] : r.margin;
}
__device__ inline std::uint64_t place_key(const Item& item, std::uint32_t i) {
  return std::uint64_t{item.p} << 32 | i;
}
// Whether a pair within its margin precedes an item.
__device__ inline bool is_decided_before(const ReducedView& r, const Item& item) {
  return __ldcg(r.winner + item.k) < place_key(item, 0);
}

// Whether a pair that is probably within its margin precedes an item.
__device__ inline bool is_probably_decided_before(const ReducedView& r, const Item& item) {
  return __ldcg(r.upper + item.k) < place_key(item, 0);
}
// Lists an item of Reduce::kAny that no kernel resolves.
__device__ inline void list_unresolved(const ReducedView& r, std::uint32_t i) {
  r.unresolved[atomicAdd(r.chunk.counts + kUnresolved, 1)] = i;
}

// Offers an answer to its configuration.
__device__ inline void offer_to_decision(const ReducedView& r, const Item& item, std::uint32_t i,
                                         const PairAnswer& answer) {
  if (answer.upper <= margin_of(r, item.p))
    take_least(r.winner + item.k, place_key(item, i));
  else if (!isnan(answer.distance) && answer.status != Status::kBeyond)
    take_least(r.lowest + item.k, place_key(item, i));
}

}  // namespace clearance::cuda
