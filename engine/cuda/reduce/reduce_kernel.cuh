// Reduced queries on the device, in the stages of engine/reduce/reduction.h: boxes give a seed per group, the seeds'
// upper bounds select the candidates, the narrow phase evaluates them, and the groups' winners are written as rows.
//
// Boxes are compared in float32, rounded outward and with a margin. So all pairs that the CPU evaluates are candidates
// here, and additional ones change nothing (lower_with_box()). Keys are merged by atomicMin(), which is
// order-independent.
#pragma once

#include "engine/cuda/pair/items.cuh"
#include "engine/cuda/pair/outer_box.cuh"
#include "engine/cuda/pair/overlap_kernel.cuh"
#include "engine/cuda/pair/pair_kernel.cuh"
#include "engine/cuda/pair/pair_table.cuh"
#include "engine/cuda/pair/part_kernel.cuh"
#include "engine/cuda/reduce/group_rows.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kScanThreads = 256;  // per block when comparing boxes
inline constexpr std::uint32_t kScanPairs = 4;      // of a configuration whose boxes a thread compares for a list
// Blocks on a multiprocessor, for lists whose length is unknown at launch.
inline constexpr std::uint32_t kSeedBlocks = 4, kSolveBlocks = 4, kItemBlocks = 1;
inline constexpr int kLeanItemBlocks = 6;      // the same for kernels that only iterate, which share its registers
inline constexpr std::int32_t kSeedSteps = 2;  // GJK steps for a bound that excludes other pairs

__device__ inline void clear_counts(const ReducedView& r) {
  if (blockIdx.x == 0 && threadIdx.x < kCounts) r.chunk.counts[threadIdx.x] = 0;
}

// Finds for each group the pair whose boxes are nearest or overlap most, and the first pair without usable poses. Any
// pair would be a valid seed. Blocks loop over rows, so that later keys are rarely the least.
__global__ void __launch_bounds__(kScanThreads) find_seeds(const __grid_constant__ ReducedView r) {
  clear_counts(r);
  for (std::uint64_t first = std::uint64_t{blockIdx.x} * kScanThreads; first < r.rows;
       first += gridDim.x * kScanThreads) {
    const std::uint64_t row = first + threadIdx.x;
    std::uint64_t key = ~std::uint64_t{0};
    std::size_t group[2] = {0, 0};
    if (row < r.rows) {
      const Item item(r, static_cast<std::uint32_t>(row));
      const auto [a, b] = boxes_of(r.chunk, item.ref, item.k);
      int n = 0;
      for_groups(r, item, [&](std::size_t g) { group[n++] = g; });
      const bool usable = !is_empty(a) && !is_empty(b);
      key = std::uint64_t{usable ? order_key(gap_below(a, b)) : kUnusable} << 32 | item.p;
      if (!usable) for_groups(r, item, [&](std::size_t g) { take_least(r.unusable + g, item.p); });
    }
    take_least_of_warp(r.seed, group[0], key);
    if (r.reduce == Reduce::kNearest && key != ~std::uint64_t{0}) take_least(r.seed + group[1], key);
  }
}

// Distance beyond which no pair of the item's groups needs to be evaluated: the item's upper bound or, if its boxes
// alone are beyond max_distance, their gap. At least 0, since touching boxes give no bound on depths.
__device__ inline double cutoff_of(const ChunkView& c, const Item& item) {
  const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
  const double gap = certify_box_gap(at_a.box(), at_b.box());
  if (gap > c.pair_limits.max_distance) return gap;
  PairHeads heads;  // of two convex parts, whose distance is at least the bodies'
  if (has_several(c.hulls, at_a.body, at_b.body))
    heads = nearest_heads(c, item.ref, item.k, at_a.body, at_b.body);
  else
    heads = {head_of(c, item.ref.a), head_of(c, item.ref.b)};
  const Hull<SceneVertices> a = scene_hull(c.hulls, heads.a), b = scene_hull(c.hulls, heads.b);
  const auto at = place_pair<double>(at_a, *a.head, at_b, *b.head);
  GjkRun<Hull<SceneVertices>> run(c.pair_limits, a, b, at);
  for (int steps = 0; run.g.end == 0 && steps < kSeedSteps; ++steps) run.step();
  return slack_of_pair(c, item.ref, item.k).true_upper(upper_so_far(run));
}

// The same for a pair that the CPU answers, by the balls around both origins that contain the bodies.
__device__ inline double cutoff_of_left(const ReducedView& r, const Item& item) {
  const ChunkView& c = r.chunk;
  const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
  const auto rho = [&](std::uint32_t body) {
    const std::uint32_t set = r.elements.of_body[body];
    if (set != kNone) return r.elements.sets[set].is_empty ? __builtin_inf() : r.elements.sets[set].hull.rho;
    double most = 0;
    for (std::uint32_t i = c.hulls.part_begin[body]; i < c.hulls.part_begin[body + 1]; ++i)
      most = fmax(most, c.hulls.heads[c.hulls.part_hull[i]].rho);
    return most;
  };
  const double upper =
      (norm(at_b.translation() - at_a.translation()) + rho(at_a.body) + rho(at_b.body)) * (1 + 0x1p-40);
  return slack_of_pair(c, item.ref, item.k).true_upper(upper);
}

__global__ void __launch_bounds__(kItemThreads) solve_seeds(const __grid_constant__ ReducedView r) {
  cut_off_by_seed(
      r,
      [&](const Item& item) {
        const PairKind kind = kind_of(r, item);
        return kind == PairKind::kHulls || kind == PairKind::kLeft;
      },
      [&](const Item& item) {
        return kind_of(r, item) == PairKind::kLeft ? cutoff_of_left(r, item) : cutoff_of(r.chunk, item);
      });
}

// Lists the items that the boxes of their bodies do not exclude. Consecutive threads have the same pairs in consecutive
// configurations, so neighbours in the list mostly share both hulls. All threads of a block call it.
// \param is_wanted called as `is_wanted(item, box_a, box_b)`
template <class IsWanted>
__device__ inline void list_by_boxes(const ReducedView& r, const IsWanted& is_wanted) {
  const std::uint32_t i = blockIdx.x * kScanThreads + threadIdx.x, before = i / r.chunk.configurations,
                      k = i - before * r.chunk.configurations;
  bool wanted[kScanPairs];
  for (std::uint32_t j = 0; j < kScanPairs; ++j) {
    const std::uint32_t p = before * kScanPairs + j;
    wanted[j] = false;
    if (p >= r.chunk.pair_count) continue;
    const Item item(r, k, p);
    const auto [a, b] = boxes_of(r.chunk, item.ref, k);
    wanted[j] = is_wanted(item, a, b);
  }
  std::uint32_t at[kScanPairs];
  take_places_of_block<kScanThreads>(r.chunk.counts + kCandidates, wanted, at);
  for (std::uint32_t j = 0; j < kScanPairs; ++j)
    if (wanted[j] && at[j] < r.capacity) r.items[at[j]] = k * r.chunk.pair_count + before * kScanPairs + j;
}

// Lists the candidates.
__global__ void __launch_bounds__(kScanThreads) find_candidates(const __grid_constant__ ReducedView r) {
  list_by_boxes(r, [&](const Item& item, const OuterBox& a, const OuterBox& b) {
    bool wanted = false;
    if (is_empty(a) || is_empty(b)) return wanted;
    const double gap = gap_below(a, b);
    for_groups(r, item,
               [&](std::size_t g) { wanted |= !(gap > __longlong_as_double(static_cast<long long>(r.cutoff[g]))); });
    return wanted;
  });
}

// Marks the candidates of Reduce::kWithin, so that rows can be written in order. Includes pairs without usable poses.
__global__ void __launch_bounds__(kScanThreads) mark_candidates(const __grid_constant__ ReducedView r) {
  clear_counts(r);
  const std::uint64_t row = std::uint64_t{blockIdx.x} * kScanThreads + threadIdx.x;
  bool wanted = false;
  if (row < r.rows) {
    const Item item(r, static_cast<std::uint32_t>(row));
    const auto [a, b] = boxes_of(r.chunk, item.ref, item.k);
    wanted = is_empty(a) || is_empty(b) || !(gap_below(a, b) > r.chunk.pair_limits.max_distance);
  }
  const unsigned word = __ballot_sync(~0u, wanted);
  if (threadIdx.x % 32 == 0 && row < r.rows) r.candidate_words[row / 32] = word;
}
__global__ void __launch_bounds__(kScanThreads) list_candidates(const __grid_constant__ ReducedView r) {
  const std::uint32_t words = (r.rows + 31) / 32, at = blockIdx.x * kScanThreads + threadIdx.x;
  if (at >= words) return;
  std::uint32_t item = r.candidate_ranks[at];
  const std::uint32_t word = r.candidate_words[at];
  r.hit_words[at] = word;
  if (at == words - 1) r.chunk.counts[kCandidates] = item + __popc(word);
  for (std::uint32_t left = word; left != 0; left &= left - 1, ++item)
    if (item < r.capacity) r.items[item] = at * 32 + static_cast<std::uint32_t>(__ffs(static_cast<int>(left))) - 1;
}

template <class S>
__device__ inline PairOutcome solve_candidate(const ChunkView& c, const Item& item, const BodyPoseRef& at_a,
                                              const BodyPoseRef& at_b, PairAnswer& answer, Enclosed& enclosed,
                                              const S& slack) {
  const HullHead *head_a = head_of(c, item.ref.a), *head_b = head_of(c, item.ref.b);
  const Hull<IndexedVertices> a = indexed_hull(c.hulls, head_a), b = indexed_hull(c.hulls, head_b);
  const PairHulls<Hull<IndexedVertices>> hulls{a, b};
  const PairFrame<double> at = place_pair<double>(at_a, *head_a, at_b, *head_b);
  return solve_item<false>(c, a, b, hulls, at_a, at_b, at, answer, enclosed, slack);
}

// Evaluates the candidates. Pairs with a body of several convex parts are left to solve_several().
// \tparam S Slack for uncertain pairs, else NoSlack
// \tparam kProves overlaps are proved at once; if not, they are left to prove_items()
template <class S, bool kProves>
__global__ void __launch_bounds__(kItemThreads, kProves ? 1 : kLeanItemBlocks)
    solve_candidates(const __grid_constant__ ReducedView r) {
  const ChunkView& c = r.chunk;
  const SpreadList list(item_count(r), gridDim.x * kItemThreads / 32);
  for (std::uint32_t first = 0; first < list.count; first += list.step) {
    const std::uint32_t i = list.at(first);
    PairOutcome outcome = PairOutcome::kNone;
    Enclosed enclosed;
    bool several = false;
    if (i < list.count) {
      const Item item = listed_item(r, i);
      const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
      const PairKind kind = kind_of(r, item);
      const bool hulls = kind == PairKind::kHulls;
      several = hulls && has_several(c.hulls, at_a.body, at_b.body);
      PairAnswer answer;
      const S slack = known_slack<S>(c, item.ref, item.k);
      if (!several && hulls) outcome = solve_candidate(c, item, at_a, at_b, answer, enclosed, slack);
      if (kind == PairKind::kLeft) outcome = PairOutcome::kUnresolved;
      if constexpr (kProves)
        if (outcome == PairOutcome::kEnclosed)
          outcome = proved(c, enclosed, at_a, at_b, slack_of_pair(c, item.ref, item.k).outer, answer);
      if (outcome == PairOutcome::kWithoutParts || outcome == PairOutcome::kConverged) {
        r.answers[i] = answer;
        offer(r, item, i, answer, at_a, at_b);
      }
    }
    list_later(r, i, several);
    if constexpr (!kProves) list_enclosed(c, i, enclosed, outcome == PairOutcome::kEnclosed);
    report_item(r, outcome, i);
  }
}

// Proves the overlaps of listed items. In a configuration of Reduce::kAny, or of kMin without uncertainty, the first one
// decides, so later ones are skipped if that is known in time.
// \param most_warps at a time
template <bool kAny>
__global__ void __launch_bounds__(kItemThreads)
    prove_items(const __grid_constant__ ReducedView r, std::uint32_t most_warps) {
  const ChunkView& c = r.chunk;
  const SpreadList list(c.counts[kEnclosedPairs], most_warps);
  for (std::uint32_t first = 0; first < list.count; first += list.step) {
    const std::uint32_t at = list.at(first);
    PairOutcome outcome = PairOutcome::kNone;
    std::uint32_t i = 0;
    if (at < list.count) {
      const Enclosed enclosed = c.enclosed[at];
      i = enclosed.pair;
      const Item item = listed_item(r, i);
      const bool first_decides = kAny || (r.reduce == Reduce::kMin && !has_uncertainties(c));
      if (first_decides && is_decided_before(r, item)) {
        if constexpr (!kAny) r.answers[i] = no_answer(Status::kOk);
      } else {
        const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
        PairAnswer answer;
        answer.flags = flags_of(at_a, at_b);
        outcome = proved(c, enclosed, at_a, at_b, slack_of_pair(c, item.ref, item.k).outer, answer);
        if (outcome == PairOutcome::kConverged) {
          r.answers[i] = answer;
          if (first_decides) take_least(r.winner + item.k, place_key(item, i));
          if constexpr (!kAny) offer(r, item, i, answer, at_a, at_b);
        }
      }
    }
    if constexpr (kAny) {
      if (outcome == PairOutcome::kUnresolved) list_unresolved(r, i);
      add_count(c.counts + kConvergedRows, outcome == PairOutcome::kConverged);
    } else {
      report_item(r, outcome, i);
    }
  }
}

// Evaluates the candidates with a body of several convex parts, listed by solve_candidates().
__global__ void __launch_bounds__(kItemThreads) solve_several(const __grid_constant__ ReducedView r) {
  const ChunkView& c = r.chunk;
  const std::uint32_t count = c.counts[kLaterItems];
  for (std::uint32_t first = blockIdx.x * kItemThreads; first < count; first += gridDim.x * kItemThreads) {
    PairOutcome outcome = PairOutcome::kNone;
    std::uint32_t i = 0;
    if (first + threadIdx.x < count) {
      i = r.later[first + threadIdx.x];
      const Item item = listed_item(r, i);
      const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
      PairAnswer answer;
      outcome = solve_parts<false>(c, c.pair_limits, item.ref, item.k, at_a, at_b, answer);
      if (outcome == PairOutcome::kWithoutParts || outcome == PairOutcome::kConverged) {
        r.answers[i] = answer;
        offer(r, item, i, answer, at_a, at_b);
      }
    }
    report_item(r, outcome, i);
  }
}

// Stores the CPU's answers to unresolved pairs, in the order of chunk.rest.
__global__ void __launch_bounds__(kItemThreads)
    take_answers(const __grid_constant__ ReducedView r, const PairAnswer* answers, std::uint32_t count) {
  const std::uint32_t i = blockIdx.x * kItemThreads + threadIdx.x;
  if (i >= count) return;
  const std::uint32_t at = r.chunk.rest[i];
  const Item item = listed_item(r, at);
  const auto [at_a, at_b] = poses_of(r.chunk, item.ref, item.k);
  const PairAnswer answer = answers[i];
  r.answers[at] = answer;
  offer(r, item, at, answer, at_a, at_b);
}

// Chooses the winners in the order of `CandidateRank`, by keys, since the candidates of a group are spread over many
// blocks.
__global__ void __launch_bounds__(kItemThreads) choose_winners(const __grid_constant__ ReducedView r) {
  const std::uint32_t count = item_count(r);
  for (std::uint32_t i = blockIdx.x * kItemThreads + threadIdx.x; i < count; i += gridDim.x * kItemThreads) {
    const PairAnswer& answer = r.answers[i];
    if (isnan(answer.distance)) continue;
    const Item item(r, r.items[i]);
    const std::uint64_t upper = order_key(answer.upper), lower = order_key(answer.lower);
    for_groups(r, item, [&](std::size_t g) {
      // If the least upper bound is infinite, so are all upper bounds of the group, and each lower bound is a gap.
      if (upper == r.upper[g] && (answer.upper < __builtin_inf() || lower == r.lower[g]))
        take_least(r.winner + g, std::uint64_t{item.p} << 32 | i);
    });
    if (!wants_lowest(r)) continue;
    const auto [at_a, at_b] = poses_of(r.chunk, item.ref, item.k);
    const std::uint64_t of_group = order_key(group_lower(answer, at_a, at_b));
    for_groups(r, item, [&](std::size_t g) {
      if (of_group == r.lower[g]) take_least(r.lowest + g, std::uint64_t{item.p} << 32 | i);
    });
  }
}

}  // namespace clearance::cuda
