// Launches the kernels of a reduced chunk, one after another in a stream, and lays out the memory they share. Nothing
// here waits.
#pragma once

#include <algorithm>

#include "engine/cuda/mesh/elements.cuh"
#include "engine/cuda/reduce/any_kernel.cuh"
#include "engine/cuda/reduce/decide_kernel.cuh"
#include "engine/cuda/workspace/resident.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kTeam = 16;             // threads that decide a configuration
inline constexpr std::uint32_t kShortList = 1u << 21;  // capacity of a list that is not worth a kernel for overlaps

/// Settings of a reduced query that apply to all its chunks.
struct ReducedSettings {
  Reduce reduce = Reduce::kMin;
  std::uint32_t groups = 1;
  double margin = 0;    // Reduce::kAny only
  PairAnswer beyond{};  // Reduce::kAny only
  bool by_teams = false;

  ReducedSettings() = default;
  ReducedSettings(const QuerySetup& s, const ResidentHulls& hulls)
      : reduce(s.reduce),
        groups(s.groups),
        margin(s.margin),
        beyond(s.beyond),
        by_teams(s.by_teams && !hulls.has_several()) {}

  /// \param margins of the query's pairs, on the device; null if all are equal
  void apply(ReducedView& r, std::uint32_t rows, const double* margins) const {
    r.reduce = reduce;
    r.groups = groups;
    r.rows = rows;
    r.margins = margins;
    r.margin = margin;
    r.beyond = beyond;
    r.keys = nullptr;
    r.answered = nullptr;
    r.elements = {};
  }
};

inline std::size_t groups_of(const ReducedView& r) {
  return std::size_t{r.chunk.configurations} * r.groups;
}

/// Memory per group.
/// \returns its bytes
inline std::size_t group_bytes(const ReducedView& r) {
  return groups_of(r) * (6 * sizeof(std::uint64_t) + sizeof(std::uint32_t) + 1);
}
/// \param by_teams whether the view flags the groups that are already answered
inline void take_group_memory(ReducedView& r, std::byte* memory, bool by_teams) {
  const std::size_t groups = groups_of(r);
  r.upper = reinterpret_cast<std::uint64_t*>(memory);
  r.lower = r.upper + groups;
  r.winner = r.lower + groups;
  r.lowest = r.winner + groups;
  r.seed = r.lowest + groups;
  r.cutoff = r.seed + groups;
  r.unusable = reinterpret_cast<std::uint32_t*>(r.cutoff + groups);
  r.answered = by_teams ? reinterpret_cast<std::uint8_t*>(r.unusable + groups) : nullptr;
}
/// Resets all groups.
inline void clear_all_groups(const ReducedView& r, cudaStream_t stream) {
  check(cudaMemsetAsync(r.upper, 0xff, group_bytes(r), stream), "clearing groups");
}
/// Resets the bounds and winners of groups, before candidates are evaluated.
inline void clear_candidates(const ReducedView& r, cudaStream_t stream) {
  check(cudaMemsetAsync(r.upper, 0xff, 4 * groups_of(r) * sizeof(std::uint64_t), stream), "clearing groups");
}
/// Resets the winners, before they are chosen again.
inline void clear_winners(const ReducedView& r, cudaStream_t stream) {
  check(cudaMemsetAsync(r.winner, 0xff, 2 * groups_of(r) * sizeof(std::uint64_t), stream), "clearing groups");
}
inline void clear_counts(std::uint32_t* counts, cudaStream_t stream) {
  check(cudaMemsetAsync(counts, 0, kCounts * sizeof(std::uint32_t), stream), "clearing counters");
}

/// Memory for the candidates.
/// \param capacity number of pairs
inline std::size_t item_bytes(std::uint32_t capacity) {
  return std::size_t{(capacity + 3) / 4 * 4} * (sizeof(PairAnswer) + 5 * sizeof(std::uint32_t) + sizeof(Enclosed));
}
inline void take_item_memory(ReducedView& r, std::byte* memory, std::uint32_t capacity) {
  const std::size_t words = (capacity + 3) / 4 * 4;
  r.capacity = capacity;
  r.answers = reinterpret_cast<PairAnswer*>(memory);
  r.items = reinterpret_cast<std::uint32_t*>(r.answers + words);
  r.chunk.rest = r.items + words;
  r.rest_rows = r.chunk.rest + words;
  r.later = r.rest_rows + words;
  r.unresolved = r.later + words;
  r.chunk.enclosed = reinterpret_cast<Enclosed*>(r.unresolved + words);
}

inline unsigned item_blocks(const ReducedView& r, std::uint32_t on_multiprocessor = kItemBlocks) {
  return std::min(blocks_of(r.capacity, kItemThreads), blocks_for_device(on_multiprocessor));
}

/// Blocks of list_by_boxes().
inline unsigned list_blocks(const ReducedView& r) {
  return blocks_of(std::uint64_t{blocks_of(r.chunk.pair_count, kScanPairs)} * r.chunk.configurations, kScanThreads);
}

/// Computes the seeds of groups and their cutoffs.
inline void start_seeds(const ReducedView& r, cudaStream_t stream) {
  find_seeds<<<std::min(blocks_of(r.rows, kScanThreads), blocks_for_device(kSeedBlocks)), kScanThreads, 0, stream>>>(r);
  solve_seeds<<<blocks_of(groups_of(r), kItemThreads), kItemThreads, 0, stream>>>(r);
  if (r.elements.count > 0) start_element_seeds(r, stream);
  check(cudaGetLastError(), "starting a kernel");
}
/// Lists the pairs that the seeds do not exclude.
inline void start_candidates(const ReducedView& r, cudaStream_t stream) {
  find_candidates<<<list_blocks(r), kScanThreads, 0, stream>>>(r);
}
/// Proves the overlaps that a kernel has listed.
template <bool kAny>
void start_proofs(const ReducedView& r, cudaStream_t stream) {
  const unsigned blocks = item_blocks(r, kSolveBlocks);
  prove_items<kAny><<<blocks, kItemThreads, 0, stream>>>(r, blocks * kItemThreads / 32);
}
/// Evaluates the listed pairs. Overlaps get a kernel of their own only where lists may be long.
inline void start_items(const ReducedView& r, bool several, cudaStream_t stream) {
  const bool uncertain = r.chunk.bodies.uncertainties.fixed;
  if (r.capacity <= kShortList) {
    const auto kernel = uncertain ? solve_candidates<Slack, true> : solve_candidates<NoSlack, true>;
    kernel<<<item_blocks(r, kSolveBlocks), kItemThreads, 0, stream>>>(r);
  } else {
    const auto kernel = uncertain ? solve_candidates<Slack, false> : solve_candidates<NoSlack, false>;
    kernel<<<item_blocks(r, kLeanItemBlocks), kItemThreads, 0, stream>>>(r);
    start_proofs<false>(r, stream);
  }
  if (several) solve_several<<<item_blocks(r, kSolveBlocks), kItemThreads, 0, stream>>>(r);
  if (r.elements.count > 0) start_elements(r, stream);
  check(cudaGetLastError(), "starting a kernel");
}
/// Reduce::kAny: evaluates the pairs whose boxes are within their margins.
inline void start_decisions(const ReducedView& r, cudaStream_t stream) {
  find_near_pairs<<<list_blocks(r), kScanThreads, 0, stream>>>(r);
  const bool uncertain = r.chunk.bodies.uncertainties.fixed;
  const auto iterate = uncertain ? evaluate_near_hulls<Slack> : evaluate_near_hulls<NoSlack>;
  iterate<<<item_blocks(r, kLeanItemBlocks), kItemThreads, 0, stream>>>(r);
  start_proofs<true>(r, stream);
  const auto evaluate = uncertain ? evaluate_near_pairs<Slack> : evaluate_near_pairs<NoSlack>;
  evaluate<<<item_blocks(r, kSolveBlocks), kItemThreads, 0, stream>>>(r);
  if (r.elements.count > 0) start_elements(r, stream);
  check(cudaGetLastError(), "starting a kernel");
}
/// Lists the unresolved pairs for the CPU.
inline void start_open_pairs(const ReducedView& r, cudaStream_t stream) {
  list_open_pairs<<<item_blocks(r), kItemThreads, 0, stream>>>(r);
  check(cudaGetLastError(), "starting a kernel");
}
/// Runs one team of threads per configuration.
inline void start_teams(ReducedView& r, cudaStream_t stream) {
  r.chunk.blocks = blocks_of(std::uint64_t{r.chunk.configurations} * kTeam, kDecideThreads);
  decide_configurations<kTeam><<<r.chunk.blocks, kDecideThreads, 0, stream>>>(r);
  check(cudaGetLastError(), "starting a kernel");
}
/// Writes a row per group.
inline void start_group_rows(const ReducedView& r, cudaStream_t stream) {
  if (r.reduce == Reduce::kAny) {
    write_decisions<<<blocks_of(r.chunk.configurations, kItemThreads), kItemThreads, 0, stream>>>(r);
  } else {
    choose_winners<<<item_blocks(r, kSolveBlocks), kItemThreads, 0, stream>>>(r);
    write_groups<<<blocks_of(groups_of(r), kItemThreads), kItemThreads, 0, stream>>>(r);
  }
  check(cudaGetLastError(), "starting a kernel");
}

}  // namespace clearance::cuda
