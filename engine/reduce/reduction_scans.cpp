// Scans of a reduction: the pairs whose boxes are near enough to be evaluated.
#include <algorithm>
#include <cassert>
#include <limits>

#include "engine/reduce/reduction.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

}  // namespace

// box_gap() of each pair.
std::span<const double> Reduction::gaps(std::span<const BodyPair> pairs, WorkerState& worker,
                                        const BodyPoses& placement) const {
  if (have_boxes_) return worker.cull.gaps(pairs, {&placement, 1});
  worker.gaps.resize(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) worker.gaps[i] = box_gap(scene_, placement, pairs[i]);
  return worker.gaps;
}

void Reduction::scan_block(std::uint64_t block, WorkerState& worker, const BodyPoses& placement) const {
  const std::uint64_t begin = block * kBlock, count = std::min(kBlock, plan_.pairs.size() - begin);
  const std::span<const BodyPair> pairs = plan_.pairs.slice(begin, count, worker.pairs);
  offer(begin, pairs, gaps(pairs, worker, placement), worker, placement);
}

void Reduction::scan(std::span<const double> gaps, const BodyPoses& placement) {
  assert(gaps.size() == plan_.pairs.size());
  WorkerState& w = workers_[0];
  gaps_ = gaps;
  if (per_body() || each()) return offer(0, plan_.pairs.slice(0, gaps.size(), w.pairs), gaps, w, placement);
  if (stage_ == kSeedScan) {
    const auto least = std::min_element(gaps.begin(), gaps.end());
    if (least != gaps.end()) w.seed[0] = {*least, static_cast<std::uint64_t>(least - gaps.begin())};
    return;
  }
  w.near.resize(gaps.size());
  const std::size_t count = gaps_within(gaps.data(), gaps.size(), cutoff_[0], w.near.data());
  for (std::size_t i = 0; i < count; ++i) offer(w.near[i], plan_.pairs.at(w.near[i]), gaps[w.near[i]], w, placement);
}

void Reduction::scan(std::span<const std::uint64_t> positions, const BodyPoses& placement) {
  if (stage_ == kSeedScan && positions.size() <= most_seeds_) {
    seeds_.assign(positions.begin(), positions.end());
    return;
  }
  for (const std::uint64_t p : positions) {
    const BodyPair pair = plan_.pairs.at(p);
    const double gap = box_gap(scene_, placement, pair);
    if (stage_ == kSeedScan)
      for_groups(pair, [&](std::uint32_t g) { workers_[0].seed[g] = std::min(workers_[0].seed[g], Seed{gap, p}); });
    else
      offer(p, pair, gap, workers_[0], placement);
  }
}

void Reduction::offer(std::uint64_t begin, std::span<const BodyPair> pairs, std::span<const double> gap,
                      WorkerState& worker, const BodyPoses& placement) const {
  if (stage_ == kSeedScan) {
    for (std::uint64_t i = 0; i < pairs.size(); ++i)
      for_groups(pairs[i],
                 [&](std::uint32_t g) { worker.seed[g] = std::min(worker.seed[g], Seed{gap[i], begin + i}); });
  } else {
    for (std::uint64_t i = 0; i < pairs.size(); ++i) offer(begin + i, pairs[i], gap[i], worker, placement);
  }
}

void Reduction::offer(std::uint64_t position, BodyPair pair, double gap, WorkerState& worker,
                      const BodyPoses& placement) const {
  bool wanted = each();
  if (gap == kInf && is_unusable(scene_, placement, pair)) {
    wanted |= needs_no_seed();
    for_groups(pair, [&](std::uint32_t g) { worker.unusable[g] = std::min(worker.unusable[g], position); });
  } else {
    for_groups(pair, [&](std::uint32_t g) { wanted |= gap <= cutoff_[g]; });
    if (any() && !options_.reference) wanted = wanted && gap <= plan_.margins.of(position);
  }
  if (wanted) worker.candidates.push_back(position);
}

void Reduction::seed_scan_by_tree(std::uint64_t block, WorkerState& worker, const BodyPoses& placement) const {
  worker.search.place(placement);
  const std::span<const std::uint32_t> probes = near_pairs_.probes();
  for (std::uint64_t i = block * kProbes; i < std::min<std::uint64_t>(probes.size(), (block + 1) * kProbes); ++i) {
    Seed& seed = worker.seed[per_body() ? probes[i] : 0];
    seed = worker.search.nearest(probes[i], seed);
    // Without any boxes, the first pair represents all.
    if (per_body() && seed.gap == kInf) seed.position = near_pairs_.first_position(probes[i]);
  }
  if (!per_body() && block == 0) worker.seed[0] = std::min(worker.seed[0], Seed{kInf, 0});
}

void Reduction::scan_by_tree(std::uint64_t block, WorkerState& worker, const BodyPoses& placement) const {
  worker.search.place(placement);
  if (block == 0) scan_unplaced(worker, placement);
  if (near_pairs_.whole_table() && !per_body()) {
    const auto first = static_cast<std::uint32_t>(block * kTreeBlocks);
    const auto last = std::min<std::uint32_t>(near_pairs_.tree().blocks(), first + kTreeBlocks);
    return worker.search.pairs(first, last, cutoff_[0], worker.candidates);
  }
  const std::span<const std::uint32_t> probes = near_pairs_.probes();
  for (std::uint64_t i = block * kProbes; i < std::min<std::uint64_t>(probes.size(), (block + 1) * kProbes); ++i)
    worker.search.around(probes[i], cutoff_[per_body() ? probes[i] : 0], per_body(), worker.candidates);
}

// Finds each group's first pair without usable poses. If every pair within a distance is requested, these pairs are
// candidates, since nothing is proved about them.
void Reduction::scan_unplaced(WorkerState& worker, const BodyPoses& placement) const {
  if (worker.search.unplaced().empty()) return;
  const auto add = [&](std::uint32_t g, std::uint64_t position) {
    worker.unusable[g] = std::min(worker.unusable[g], position);
  };
  if (!near_pairs_.whole_table()) {
    for (std::uint64_t i = 0; i < plan_.pairs.size(); ++i) {
      const BodyPair pair = plan_.pairs.list()[i];
      if (!is_unusable(scene_, placement, pair)) continue;
      for_groups(pair, [&](std::uint32_t g) { add(g, i); });
      if (needs_no_seed()) worker.candidates.push_back(i);
    }
    return;
  }
  std::vector<std::uint32_t> unplaced(worker.search.unplaced().begin(), worker.search.unplaced().end());
  std::sort(unplaced.begin(), unplaced.end());
  const auto n = static_cast<std::uint32_t>(scene_.bodies().size());
  const auto has_pair = [&](std::uint32_t a, std::uint32_t b) {
    return near_pairs_.position(a, b) != NearPairs::kNowhere;
  };
  for (const std::uint32_t bad : unplaced) {
    add(per_body() ? bad : 0, near_pairs_.first_position(bad));
    if (!needs_no_seed()) continue;
    for (std::uint32_t b = 0; b < n; ++b)
      if (has_pair(bad, b) && (b > bad || placement[b].status == Status::kOk))
        worker.candidates.push_back(near_pairs_.position(bad, b));
  }
  if (!per_body()) return;
  for (std::uint32_t b = 0; b < n; ++b) {  // a table lists a body's pairs in the order of its partners
    const auto first =
        std::find_if(unplaced.begin(), unplaced.end(), [&](std::uint32_t bad) { return has_pair(bad, b); });
    if (first != unplaced.end()) add(b, near_pairs_.position(*first, b));
  }
}

}  // namespace clearance
