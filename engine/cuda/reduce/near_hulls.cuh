// Reduce::kAny: pairs of single convex parts, which are most pairs. This kernel only iterates: most pairs end beyond
// their margins, and leave nothing. Overlaps are listed for prove_items(), and all other work for
// evaluate_near_pairs().
//
// A pair whose simplex encloses the origin probably decides its configuration, so pairs after it wait for its proof.
#pragma once

#include "engine/cuda/reduce/reduce_kernel.cuh"

namespace clearance::cuda {

// Items of a warp, without those that are probably decided, which it lists for evaluate_near_pairs().
class WarpItems {
 public:
  /// \param memory (64,) in shared memory
  __device__ WarpItems(const ReducedView& r, std::uint32_t* memory)
      : r_(r), list_(item_count(r), gridDim.x * kItemThreads / 32), queue_(memory) {}

  // Returns the number of items of the next round, or 0 at the end. All threads of the warp call it.
  __device__ std::uint32_t gather() {
    for (; queued_ < 32 && first_ < list_.count; first_ += list_.step) {
      const std::uint32_t i = list_.at(first_);
      const bool is_there = i < list_.count, waits = is_there && is_probably_decided_before(r_, Item(r_, r_.items[i]));
      list_later(r_, i, waits);
      const std::uint32_t all = __ballot_sync(~0u, is_there && !waits);
      if (is_there && !waits) queue_[queued_ + __popc(all & ((1u << threadIdx.x % 32) - 1))] = i;
      queued_ += __popc(all);
    }
    __syncwarp();
    return queued_ < 32 ? queued_ : 32;
  }
  __device__ std::uint32_t operator[](std::uint32_t place) const { return queue_[place]; }
  // Ends a round.
  __device__ void drop(std::uint32_t taken) {
    const std::uint32_t lane = threadIdx.x % 32, left = queued_ - taken;
    const std::uint32_t moved = lane < left ? queue_[taken + lane] : 0;
    __syncwarp();
    if (lane < left) queue_[lane] = moved;
    queued_ = left;
    __syncwarp();
  }

 private:
  const ReducedView& r_;
  const SpreadList list_;
  std::uint32_t* const queue_;
  std::uint32_t first_ = 0, queued_ = 0;
};

// Uses the end of a pair's run that does not prove it beyond its margin.
// \param lower,upper bounds of a converged run
// \returns whether evaluate_near_pairs() has to evaluate it
template <class S>
__device__ inline bool take_near_hulls(const ReducedView& r, const Item& item, std::uint32_t i, PairOutcome outcome,
                                       double lower, double upper, const S& slack, Enclosed& enclosed) {
  const ChunkView& c = r.chunk;
  const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
  PairLimits q = c.pair_limits;
  q.max_distance = margin_of(r, item.p);
  PairAnswer answer;
  if (answer_without_parts(q, at_a, at_b, answer)) return false;  // by boxes that prove it beyond
  if (outcome == PairOutcome::kUnresolved) {
    list_unresolved(r, i);
    return false;
  }
  if (outcome == PairOutcome::kEnclosed) {
    enclosed.pair = i;
    c.enclosed[atomicAdd(c.counts + kEnclosedPairs, 1)] = enclosed;
  } else if (q.want_points) {
    return true;
  } else {
    take_bounds(q, lower, upper, slack, answer);
    r.answers[i] = answer;
    offer_to_decision(r, item, i, answer);
  }
  if (outcome == PairOutcome::kEnclosed || answer.upper <= q.max_distance)
    take_least(r.upper + item.k, place_key(item, i));
  return false;
}

// \tparam S Slack for uncertain pairs, else NoSlack
template <class S>
__global__ void __launch_bounds__(kItemThreads, kLeanItemBlocks)
    evaluate_near_hulls(const __grid_constant__ ReducedView r) {
  __shared__ std::uint32_t queues[kItemThreads / 32][64];
  const ChunkView& c = r.chunk;
  WarpItems items(r, queues[threadIdx.x / 32]);
  while (const std::uint32_t taken = items.gather()) {
    PairOutcome outcome = PairOutcome::kNone;
    bool is_later = false;
    const std::uint32_t lane = threadIdx.x % 32, i = items[lane < taken ? lane : 0];
    const Item item(r, r.items[i]);
    const PairKind kind = lane < taken ? kind_of(r, item) : PairKind::kMeshes;
    if (kind == PairKind::kHulls &&
        !has_several(c.hulls, body_of(c.bodies, item.ref.a), body_of(c.bodies, item.ref.b))) {
      const HullHead *head_a = head_of(c, item.ref.a), *head_b = head_of(c, item.ref.b);
      const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
      const PairFrame<double> at = place_pair<double>(at_a, *head_a, at_b, *head_b);
      const S slack = known_slack<S>(c, item.ref, item.k);
      const double margin = margin_of(r, item.p);
      PairLimits q = c.pair_limits;
      q.max_distance = margin;
      double near_enough = margin, lower = 0, upper = 0;
      if constexpr (kHasSlack<S>) {
        q.max_distance = slack.cut_off(margin);
        near_enough = slack.near_enough(margin);
      }
      const auto take = [&](const Gjk<double>&, const RunBounds<double>& bounds) {
        lower = bounds.lower;
        upper = bounds.upper;
      };
      Enclosed enclosed;
      outcome =
          run_to_end(q, indexed_hull(c.hulls, head_a), indexed_hull(c.hulls, head_b), at, enclosed, take, near_enough);
      double true_lower = lower;
      if constexpr (kHasSlack<S>) true_lower = slack.true_lower(lower);
      if (outcome != PairOutcome::kConverged || !(true_lower > margin))
        is_later = take_near_hulls(r, item, i, outcome, lower, upper, slack, enclosed);
    } else {
      is_later = kind == PairKind::kHulls || kind == PairKind::kLeft;
    }
    list_later(r, i, is_later);
    add_count(c.counts + kConvergedRows, outcome == PairOutcome::kConverged && !is_later);
    items.drop(taken);
  }
}

}  // namespace clearance::cuda
