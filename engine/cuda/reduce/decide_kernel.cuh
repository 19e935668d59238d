// Reduce::kMin in one launch, for configurations with few enough pairs for a team of a warp's threads.
//
// A team compares the boxes of its configuration's pairs, then evaluates in order those that may be nearest, one per
// thread. Without depths the first overlapping pair wins regardless of later ones, so the team stops as soon as every
// earlier pair is proved apart. If a thread cannot resolve its pair, the configuration stays open: its pairs are listed
// and answered as in reduce_kernel.cuh. Rows have the same bits as there. Not used with uncertain bodies, nor if
// pair_lower is requested.
#pragma once

#include "engine/cuda/reduce/group_rows.cuh"
#include "engine/cuda/reduce/reduce_kernel.cuh"
#include "engine/cuda/reduce/team_scan.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kDecideThreads = 64;
inline constexpr int kDecideBlocks = 4;  // per multiprocessor, sharing its registers

// Search of a configuration for its winner; each thread of its team has a copy of the state.
template <std::uint32_t kLanes>
class Decision {
 public:
  __device__ Decision(const ReducedView& r, std::uint32_t k, bool exists, std::uint32_t* queue)
      : r_(r), c_(r.chunk), members_{r, exists ? k : 0}, at_(k), exists_(exists), queue_(queue) {
    first_ = scan_boxes(members_, team_);
    reach_ = first_.reach;
    decided_ = !exists || !is_usable();
  }

  __device__ void run() {
    while (__any_sync(~0u, !decided_)) {
      gather();
      evaluate_queued();
      go_on();
    }
    __syncwarp();
    if (exists_ && team_.lane == 0) end();
  }

 private:
  __device__ bool is_usable() const { return first_.reach < __builtin_inff(); }

  // Queues a pair per thread, if there are enough. Each thread compares the boxes of up to 32 pairs at a time; hits are
  // then queued in order.
  __device__ void gather() {
    for (;;) {
      std::uint32_t hits = team_.all(hits_);
      if (__any_sync(~0u, is_short() && hits == 0 && next_ < members_.count())) {
        if (is_short() && hits == 0 && next_ < members_.count()) find_hits();
        hits = team_.all(hits_);
      }
      const bool goes_on = is_short() && hits != 0;
      is_left_ = hits != 0;
      if (!__any_sync(~0u, goes_on || (is_short() && next_ < members_.count()))) break;
      const std::uint32_t row = hits != 0 ? first_bit(hits) : 0, bit = 1u << row;
      const bool wanted = goes_on && (hits_ & bit) != 0;
      const std::uint32_t all = team_.ballot(wanted);
      if (wanted) queue_[queued_ + __popc(all & bits_before(team_.lane))] = first_hit_ + row * kLanes + team_.lane;
      queued_ += __popc(all);
      if (goes_on) hits_ &= ~bit;
    }
    __syncwarp();
  }
  __device__ bool is_short() const { return !decided_ && queued_ < kLanes; }
  __device__ void find_hits() {
    first_hit_ = next_;
    const std::uint32_t rows = (members_.count() - next_ + kLanes - 1) / kLanes, last = members_.count() - 1;
#pragma unroll 4
    for (std::uint32_t row = 0; row < (rows < 32 ? rows : 32); ++row) {
      const std::uint32_t i = next_ + row * kLanes + team_.lane, there = i < last ? i : last;
      const float squared = squared_gap(members_.box_a(there), members_.box_b(there));
      const bool hit = i <= last && squared > done_ && squared <= reach_;
      hits_ |= static_cast<std::uint32_t>(hit) << row;
    }
    next_ += 32 * kLanes;
  }

  // The pair that a thread evaluates. It stays in registers as long as no address of a part of it is kept. So its run,
  // which does keep addresses, is not a member, and functions that are not inlined get copies.
  using Scene = Hull<SceneVertices>;
  struct QueuedPair {
    const bool there;  // if false, the thread duplicates another thread's pair and contributes nothing
    const std::uint32_t member;
    const BodyPoseRef at_a, at_b;
    const HullHead *head_a, *head_b;
    const Scene a, b;
    const PairFrame<double> place;
    PairAnswer answer;
    const bool runs;  // neither its poses nor its boxes answer it
    bool apart;       // proved so far

    __device__ __forceinline__ QueuedPair(const ChunkView& c, bool is_there, std::uint32_t i, PairRef ref,
                                          std::uint32_t k)
        : there(is_there),
          member(i),
          at_a(c.bodies, c.configurations, ref.a, k),
          at_b(c.bodies, c.configurations, ref.b, k),
          head_a(head_of(c, ref.a)),
          head_b(head_of(c, ref.b)),
          a(scene_hull(c.hulls, head_a)),
          b(scene_hull(c.hulls, head_b)),
          place(place_pair<double>(at_a, *head_a, at_b, *head_b)),
          runs(!answer_without_parts(c.pair_limits, at_a, at_b, answer) && is_there),
          apart(is_there && !runs) {}
  };

  // Evaluates the queued pairs, one per thread.
  __device__ void evaluate_queued() {
    const bool there = !decided_ && team_.lane < queued_ && members_.has_poses(queue_[team_.lane]);
    const std::uint32_t all_there = __ballot_sync(~0u, there);
    if (all_there == 0) return;
    const int source = static_cast<int>(there ? threadIdx.x % 32 : first_bit(all_there));
    const std::uint32_t member = there ? queue_[team_.lane] : 0;
    const PairRef ref = members_.ref(member);
    QueuedPair pair(c_, there, member, {__shfl_sync(~0u, ref.a, source), __shfl_sync(~0u, ref.b, source)},
                    __shfl_sync(~0u, members_.k, source));
    GjkRun<Scene> run(c_.pair_limits, pair.a, pair.b, pair.place);
    const std::uint32_t enclosing = race(pair, run);
    add_count(c_.counts + kConvergedRows, pair.runs);

    const bool overlaps = proves_overlap(pair, run, enclosing);
    bool unsure = is_unsure_of_overlap(pair, enclosing, overlaps);
    if (__any_sync(~0u, unsure || (there && enclosing == 0)))
      unsure = !take_bounds(pair, run, there && enclosing == 0) || unsure;
    const bool opens = team_.ballot(unsure) != 0, overlap = team_.ballot(overlaps) != 0;
    if (opens) {
      is_open_ = decided_ = true;
    } else if (overlap) {
      decided_ = true;
      best_.place = queue_[first_bit(enclosing)];
      lower_ = 0;
      if (overlaps) r_.answers[at_] = pair.answer;
    }
    if (__any_sync(~0u, opens)) list(opens);
  }

  // Runs GJK on the team's pairs in lockstep. Without depths the first overlapping pair wins: later pairs wait, and
  // earlier ones only need to be proved apart. Returns a bit for each pair whose simplex encloses the origin.
  __device__ __forceinline__ std::uint32_t race(QueuedPair& pair, GjkRun<Scene>& run) const {
    const double margin = run.radius + rounding_error(double(RoundingUnits<double>::kLower), run.scale);
    const double apart_from = margin * margin * (1 + 0x1p-30);
    for (int steps = 0;;) {
      const std::uint32_t enclosing =
          team_.ballot(pair.runs && run.g.end == Gjk<double>::code(GjkEnd::kEncloses) && run.g.simplex.size == 4);
      const bool goes_on =
          pair.runs && run.g.end == 0 && (enclosing & bits_before(team_.lane)) == 0 && !(enclosing != 0 && pair.apart);
      if (!__any_sync(~0u, goes_on)) return enclosing;
      if (!goes_on) continue;
      const double vv = squared_norm(run.g.v);
      run.step();
      pair.apart = pair.apart || (run.g.gap > 0 && run.g.gap * run.g.gap > apart_from * vv);
      if (run.g.end == 0 && ++steps >= c_.pair_limits.max_iterations) run.g.end = Gjk<double>::code(GjkEnd::kLimit);
    }
  }

  // Whether this thread's pair is the first one that encloses the origin and is proved to overlap.
  __device__ __forceinline__ bool proves_overlap(QueuedPair& pair, const GjkRun<Scene>& run,
                                                 std::uint32_t enclosing) const {
    if (enclosing == 0 || !pair.there || team_.lane != first_bit(enclosing)) return false;
    Enclosed enclosed;
    take_enclosed(run.g, enclosed);
    const BodyPoseRef at_a = pair.at_a, at_b = pair.at_b;
    PairAnswer answer = pair.answer;
    const bool overlaps = proved(c_, enclosed, at_a, at_b, 0, answer) == PairOutcome::kConverged;
    pair.answer = answer;
    return overlaps;
  }
  // Whether this thread's pair leaves the first overlapping pair undetermined.
  __device__ __forceinline__ bool is_unsure_of_overlap(const QueuedPair& pair, std::uint32_t enclosing,
                                                       bool overlaps) const {
    if (enclosing == 0 || !pair.there) return false;
    const std::uint32_t first = first_bit(enclosing);
    return team_.lane == first ? !overlaps : pair.runs && team_.lane < first && !pair.apart;
  }

  // Merges the bounds of the team's pairs, none of which encloses the origin, into the configuration. All threads of
  // the warp call it. Returns false if this thread's bounds did not converge.
  // \param ends whether this thread's pair has finished
  __device__ __forceinline__ bool take_bounds(QueuedPair& pair, const GjkRun<Scene>& run, bool ends) {
    constexpr double kInf = __builtin_inf();
    const RunBounds<double> bounds = run.bounds();
    const bool settles = ends && (!pair.runs || bounds.converged);
    const double lower = pair.runs ? bounds.lower : pair.answer.lower,
                 upper = pair.runs ? bounds.upper : pair.answer.upper;
    const CandidateRank mine = settles ? rank_of(lower, upper, pair.member) : CandidateRank{};
    const double least_upper = team_.least(mine.upper),
                 least_gap = team_.least(mine.upper == least_upper ? mine.gap : kInf);
    // The queue is in order, so among equal ranks the lowest lane has the first pair.
    const std::uint32_t nearest = team_.ballot(settles && mine.upper == least_upper && mine.gap == least_gap);
    const double least_lower =
        team_.least(settles ? lower_with_box(lower, certify_box_gap(pair.at_a.box(), pair.at_b.box())) : kInf);
    const double least_limit = team_.least(pair.there ? (pair.runs ? upper_so_far(run) : lower) : kInf);
    if (nearest != 0) {
      const CandidateRank found{least_upper, least_gap, queue_[first_bit(nearest)]};
      if (found < best_) {
        best_ = found;
        if (team_.lane == first_bit(nearest)) keep(pair, run, bounds);
      }
    }
    if (least_lower < lower_) lower_ = least_lower;
    if (least_limit < cutoff_) cutoff_ = least_limit;
    reach_ = fminf(reach_, square_from_above(cutoff_));
    return !ends || settles;
  }
  __device__ __forceinline__ void keep(const QueuedPair& pair, const GjkRun<Scene>& run,
                                       const RunBounds<double>& bounds) const {
    const Scene a = pair.a, b = pair.b;
    const BodyPoseRef at_a = pair.at_a, at_b = pair.at_b;
    PairAnswer answer = pair.answer;
    if (pair.runs) take_converged<false>(c_.pair_limits, PairHulls<Scene>{a, b}, at_a, at_b, run.g, bounds, answer);
    r_.answers[at_] = answer;
  }

  // Lists all pairs that may be the nearest.
  __device__ void list(bool opens) const {
    const float cutoff = square_from_above(cutoff_);
    for (std::uint32_t first = 0; first < members_.count(); first += kLanes) {
      const std::uint32_t i = first + team_.lane;
      bool wanted = opens && i < members_.count();
      if (wanted) wanted = squared_gap(members_.box_a(i), members_.box_b(i)) <= cutoff && members_.has_poses(i);
      const std::uint32_t at = take_place(c_.counts + kCandidates, wanted);
      if (wanted && at < r_.capacity) r_.items[at] = members_.row(i);
    }
  }

  // Advances to the next pairs: those left in the queue, or farther ones if they may be nearer than the best found.
  __device__ void go_on() {
    const bool is_left = team_.lane + kLanes < queued_;
    const std::uint32_t left = is_left ? queue_[team_.lane + kLanes] : 0;
    __syncwarp();
    if (is_left) queue_[team_.lane] = left;
    queued_ = queued_ > kLanes ? queued_ - kLanes : 0;
    if (decided_ || queued_ > 0 || is_left_ || next_ < members_.count()) return;
    const float cutoff = square_from_above(cutoff_);
    decided_ = cutoff <= reach_;
    done_ = reach_;
    reach_ = cutoff;
    next_ = 0;
  }

  // Writes the configuration's row, or the inputs of the kernels that answer it instead.
  __device__ void end() const {
    r_.answered[at_] = !is_open_;
    if (is_open_) {
      r_.seed[at_] = 0;
      r_.unusable[at_] = first_.unusable;
    } else if (is_usable()) {
      const PairRef winner = members_.ref(static_cast<std::uint32_t>(best_.place));
      write_group(r_, at_, winner, r_.answers[at_], lower_, first_.unusable, winner);
    } else if (first_.unusable != kNoPair) {
      write_unusable(r_, at_, members_.ref(first_.unusable));
    } else {
      write_empty(r_, at_);
    }
  }

  const ReducedView& r_;
  const ChunkView& c_;
  const ConfigurationPairs members_;
  const Team<kLanes> team_;
  const std::uint32_t at_;  // the configuration, which is also its group and row
  const bool exists_;
  std::uint32_t* const queue_;  // (2 * kLanes,) members in order
  BoxScan first_;
  bool decided_, is_open_ = false;
  float done_ = -1, reach_;          // the current round takes squared box gaps in (done_, reach_]
  double cutoff_ = __builtin_inf();  // distance that the nearest pair cannot exceed
  std::uint32_t next_ = 0, queued_ = 0;
  std::uint32_t hits_ = 0, first_hit_ = 0;  // hits among the boxes compared last: a bit for each one not yet queued
  bool is_left_ = false;                    // whether any thread has such a bit
  CandidateRank best_;                      // the winner so far
  double lower_ = __builtin_inf();          // of the group
};

// One team per configuration.
template <std::uint32_t kLanes>
__global__ void __launch_bounds__(kDecideThreads, kDecideBlocks)
    decide_configurations(const __grid_constant__ ReducedView r) {
  __shared__ std::uint32_t queues[kDecideThreads / kLanes][2 * kLanes];
  const std::uint32_t k = (blockIdx.x * kDecideThreads + threadIdx.x) / kLanes;
  Decision<kLanes>(r, k, k < r.chunk.configurations, queues[threadIdx.x / kLanes]).run();
  hand_over_counts(r.chunk);
}

}  // namespace clearance::cuda
