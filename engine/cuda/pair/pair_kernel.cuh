// One pair per thread: iteration of gjk.h, bounds of certify.h, columns of columns.h.
//
// Every operation is rounded as on the CPU (--fmad=false, IEEE division and roots), so an answer has the bits of the
// CPU's lanes (lanes_kernel.h) in float64 and in float32. A thread here corresponds to a lane there.
#pragma once

#include <type_traits>

#include "engine/cuda/pair/counts.cuh"
#include "engine/cuda/pair/hull.cuh"
#include "engine/cuda/pair/pair_rows.cuh"
#include "engine/cuda/pair/slack.cuh"
#include "engine/narrow/pair_run.h"
#include "engine/narrow/witness.h"

namespace clearance::cuda {

// Blocks of kTile threads per multiprocessor. They share its registers; with more blocks the kernels spill.
inline constexpr int kBlocks = 3, kBlocksF32 = 5;

template <class T>
inline constexpr bool kIsF32 = std::is_same_v<T, float>;

template <class T>
__device__ inline PairFrame<T> place_pair(const BodyPoseRef& at_a, const HullHead& a, const BodyPoseRef& at_b,
                                          const HullHead& b) {
  const PlacedFrame of_a = at_a.frame(), of_b = at_b.frame();
  return pair_frame<T>(a, of_a.R_wb, of_a.t_w, b, of_b.R_wb, of_b.t_w);
}

// Adds the points and flags of a converged pair. Not inlined, so that it takes no registers from the iteration.
template <class Hull>
__device__ __noinline__ void add_points(const Hull& a, const BodyPoseRef& at_a, const Hull& b, const BodyPoseRef& at_b,
                                        const LaneWitness& witness, bool want_nonsmooth, PairAnswer& answer) {
  const Mat3d R_wa = at_a.rotation(), R_wb = at_b.rotation();
  answer.part_a = answer.part_b = 0;
  converged_points(a, R_wa, b, R_wb, witness, answer.point_a, answer.point_b);
  answer.normal = converged_normal(witness);
  if (answer.status == Status::kBeyond)
    answer.point_a = answer.point_b = no_point();
  else if (want_nonsmooth && is_nonsmooth(answer.lower, a, R_wa, b, R_wb, answer.normal))
    answer.flags |= kFlagNonsmooth;
}

// Columns of queries that need only a pair's bounds, and points in float32. Kernels for these alone use fewer registers
// and instructions.
inline constexpr std::uint32_t kLeanFields =
    kDefaultFields | kFieldPair | kFieldConfiguration | kFieldPoints32 | kFieldBounds;

enum class PairOutcome { kNone, kWithoutParts, kConverged, kUnresolved, kEnclosed };

// GJK run of one pair, and the data for its bounds.
template <class Hull>
struct GjkRun {
  using T = typename Hull::T;
  using Setup = RunSetup<T>;
  Gjk<T> g;
  T radius, scale;

  __device__ GjkRun(const PairLimits& q, const Hull& a, const Hull& b, const PairFrame<T>& at)
      : radius(static_cast<T>(a.head->radius + b.head->radius)), q_(q), a_(a), b_(b), at_(at) {
    const Vec3<T>& D = at.D;
    scale = pair_scale(D, reach_of<T>(*a.head), reach_of<T>(*b.head), radius);
    limits_ = run_limits<T>(q.abs_tol, q.rel_tol, radius > 0, q.max_distance < Setup::kUnbounded);
    limits_.radius = radius;
    if (limits_.bounded) limits_.max_distance = core_cut_off_at(cut_off(), radius, scale);
    if constexpr (Setup::kFromCentres)
      g.v = first_direction(Vec3<T>{0, 0, 0} - D);
    else
      g.v = first_direction(at.cso_vertex(a.head->centre, b.head->centre));
  }
  __device__ __forceinline__ void step() {
    Nearest<T> next;
    if (const GjkEnd end = try_step(next); end == GjkEnd::kRunning)
      g.go_on(next);
    else
      g.close(end);
  }
  // Runs to the end.
  __device__ __forceinline__ void run() {
    GjkEnd end;
    for (int steps = 0;;) {
      Nearest<T> next;
      end = try_step(next);
      if (end != GjkEnd::kRunning) break;
      g.go_on(next);
      if (++steps < q_.max_iterations) continue;
      end = GjkEnd::kLimit;
      break;
    }
    g.close(end);
  }
  /// \param stop_below optional: the run may stop at an upper bound this low
  template <class... StopBelow>
  __device__ RunBounds<T> bounds(const StopBelow&... stop_below) const {
    return {g,
            radius,
            scale,
            cut_off(),
            static_cast<T>(q_.abs_tol * Setup::kStrict),
            static_cast<T>(q_.rel_tol * Setup::kStrict),
            at_.extra,
            static_cast<T>(stop_below * Setup::kStrict)...};
  }

 private:
  // \param next state of the next step, if the run goes on
  __device__ __forceinline__ GjkEnd try_step(Nearest<T>& next) {
    SupportPoint<T> fa, fb;
    find_farthest(a_, -g.v, fa, b_, at_.R.transpose_times(g.v), fb);
    return g.try_step(cso_vertex(fa.index, fb.index), -dot(g.v, at_.D) - (fa.value + fb.value), limits_, next);
  }
  __device__ T cut_off() const { return static_cast<T>(q_.max_distance * Setup::kMore); }
  __device__ CsoVertex<T> cso_vertex(std::uint32_t a, std::uint32_t b) const {
    return {at_.cso_vertex(a_.vertex(a), b_.vertex(b)), a, b};
  }

  const PairLimits& q_;
  const Hull &a_, &b_;
  const PairFrame<T>& at_;
  GjkLimits<T> limits_;
};

// Whether the simplex encloses the origin, so that its vertices may prove an overlap.
__device__ inline bool take_enclosed(const Gjk<double>& g, Enclosed& enclosed) {
  if (g.end != Gjk<double>::code(GjkEnd::kEncloses) || g.simplex.size != 4) return false;
  CLEARANCE_UNROLL
  for (int i = 0; i < 4; ++i) {
    enclosed.a[i] = static_cast<std::uint16_t>(g.simplex.vertex[i].a);
    enclosed.b[i] = static_cast<std::uint16_t>(g.simplex.vertex[i].b);
  }
  return true;
}

// Witness of a converged run, as copy_witness() of the lanes makes it.
template <class T>
__device__ inline LaneWitness witness_of(const Gjk<T>& g, const RunBounds<T>& bounds, const Mat3d& R_wa) {
  LaneWitness w;
  w.size = static_cast<std::uint32_t>(g.simplex.size);
  CLEARANCE_UNROLL
  for (int i = 0; i < 3; ++i) {
    w.a[i] = g.simplex.vertex[i].a;
    w.b[i] = g.simplex.vertex[i].b;
    w.share[i] = bounds.nearest.share[i];
  }
  take_run<T>(w, R_wa, cast<double>(g.v), bounds.v_length, cast<double>(bounds.nearest.w), bounds.length);
  return w;
}

// A pair's two hulls in float64, for points.
template <class Hull>
struct PairHulls {
  const Hull &a, &b;
};

// Sets the status, bounds and distance of a run with converged bounds.
// \param slack of the pair: a Slack, or NoSlack
template <class T, class S>
__device__ inline void take_bounds(const PairLimits& q, const T& lower, const T& upper, const S& slack,
                                   PairAnswer& answer) {
  bool decided = false;
  if constexpr (kHasSlack<S>) {
    decided = slack.any();
    if (decided) decide(limits_of(q), lower, upper, [] { return 0.0; }, answer, slack);
  }
  if (!decided) decide_apart(q.max_distance, lower, upper, true, answer);
}

// Writes the answer of a run with converged bounds.
// \param slack of the pair: a Slack, or NoSlack
// \tparam kLean only kLeanFields are requested: no flags, no normal, and points for points32 alone
template <bool kLean, class T, class Hull, class S = NoSlack>
__device__ inline void take_converged(const PairLimits& q, const PairHulls<Hull>& hulls, const BodyPoseRef& at_a,
                                      const BodyPoseRef& at_b, const Gjk<T>& g, const RunBounds<T>& bounds,
                                      PairAnswer& answer, const S& slack = S()) {
  take_bounds(q, bounds.lower, bounds.upper, slack, answer);
  if (!q.want_points) return;
  const LaneWitness w = witness_of(g, bounds, at_a.rotation());
  if (!kLean) {
    add_points(hulls.a, at_a, hulls.b, at_b, w, q.want_nonsmooth, answer);
  } else {
    converged_points(hulls.a, at_a.rotation(), hulls.b, at_b.rotation(), w, answer.point_a, answer.point_b);
    if (answer.status == Status::kBeyond) answer.point_a = answer.point_b = no_point();
  }
}

// Runs GJK on a placed pair to its end.
// \param enclosed receives the simplex if it encloses the origin
// \param take called with the converged run and its bounds
// \param stop_below of GjkRun::bounds()
template <class Hull, class Take, class... StopBelow>
__device__ inline PairOutcome run_to_end(const PairLimits& q, const Hull& a, const Hull& b,
                                         const PairFrame<typename Hull::T>& at, Enclosed& enclosed, const Take& take,
                                         const StopBelow&... stop_below) {
  using T = typename Hull::T;
  if (kIsF32<T> && !at.fits) return PairOutcome::kUnresolved;
  GjkRun<Hull> run(q, a, b, at);
  run.run();
  if (run.g.end == Gjk<T>::code(GjkEnd::kEncloses)) {  // bounds never converge then
    if constexpr (!kIsF32<T>)
      if ((q.prove_overlaps || q.prove_depths) && take_enclosed(run.g, enclosed)) return PairOutcome::kEnclosed;
    return PairOutcome::kUnresolved;
  }
  const RunBounds<T> bounds = run.bounds(stop_below...);
  if (!bounds.converged) return PairOutcome::kUnresolved;
  take(run.g, bounds);
  return PairOutcome::kConverged;
}

// Answers one placed pair, if it converges.
template <bool kLean, class Hull, class PointHull, class S>
__device__ inline PairOutcome narrow(const PairLimits& q, const Hull& a, const Hull& b,
                                     const PairHulls<PointHull>& hulls, const BodyPoseRef& at_a,
                                     const BodyPoseRef& at_b, const PairFrame<typename Hull::T>& at, PairAnswer& answer,
                                     Enclosed& enclosed, const S& slack) {
  using T = typename Hull::T;
  const auto take = [&](const Gjk<T>& g, const RunBounds<T>& bounds) {
    take_converged<kLean>(q, hulls, at_a, at_b, g, bounds, answer, slack);
  };
  if constexpr (kHasSlack<S>) {
    PairLimits of_parts = q;
    of_parts.max_distance = slack.cut_off(q.max_distance);
    return run_to_end(of_parts, a, b, at, enclosed, take);
  } else {
    return run_to_end(q, a, b, at, enclosed, take);
  }
}

// Distribution of a list of slow pairs over a grid's threads. The threads of a warp wait for each other, so few pairs
// get a warp each; more pairs share at most `most_warps` warps while 32 lanes suffice.
struct SpreadList {
  std::uint32_t count, lanes, step, place;

  __device__ SpreadList(std::uint32_t pairs, std::uint32_t most_warps) : count(pairs) {
    const std::uint32_t warps = gridDim.x * blockDim.x / 32, warp = (blockIdx.x * blockDim.x + threadIdx.x) / 32;
    const std::uint32_t wanted = (count + most_warps - 1) / most_warps;
    lanes = wanted < 1 ? 1 : wanted < 32 ? wanted : 32;
    step = warps * lanes;
    place = threadIdx.x % 32 < lanes ? warp * lanes + threadIdx.x % 32 : count;
  }
  // Index of this thread's pair in the round that starts at `first`; `count` or more if it has none.
  __device__ std::uint32_t at(std::uint32_t first) const { return place < count ? first + place : count; }
};

// An item of a group: a pair in a configuration, with the poses of its bodies.
struct GroupItem {
  std::uint32_t pair, k;
  PairRef ref;
  std::uint64_t row;
  BodyPoseRef at_a, at_b;

  __device__ GroupItem(const ChunkView& c, std::uint32_t p, std::uint32_t configuration)
      : pair(p),
        k(configuration),
        ref(c.pairs[pair]),
        row(std::uint64_t{k} * c.pair_count + c.position[pair]),
        at_a(c.bodies, c.configurations, ref.a, k),
        at_b(c.bodies, c.configurations, ref.b, k) {}
  __device__ GroupItem(const ChunkView& c, const Group& group, std::uint32_t item)
      : GroupItem(c, group.first + (c.configurations == 1 ? item : item / c.configurations),
                  c.configurations == 1 ? 0 : item % c.configurations) {}
};

// Sets the flags of an item's bodies, and its answer if no hull is needed for it. Returns whether it is answered.
__device__ inline bool answer_without_parts(const PairLimits& q, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                                            PairAnswer& answer) {
  return answer_without_parts(
      at_a.status(), at_b.status(), flags_of(at_a, at_b), q.cull, q.max_distance,
      [&] { return certify_box_gap(at_a.box(), at_b.box()); }, answer);
}

// Answers one item of a chunk, if it converges.
template <bool kLean, class Hull, class PointHull, class S = NoSlack>
__device__ inline PairOutcome solve_item(const ChunkView& c, const Hull& a, const Hull& b,
                                         const PairHulls<PointHull>& hulls, const BodyPoseRef& at_a,
                                         const BodyPoseRef& at_b, const PairFrame<typename Hull::T>& at,
                                         PairAnswer& answer, Enclosed& enclosed, const S& slack = S()) {
  if (answer_without_parts(c.pair_limits, at_a, at_b, answer)) return PairOutcome::kWithoutParts;
  return narrow<kLean>(c.pair_limits, a, b, hulls, at_a, at_b, at, answer, enclosed, slack);
}

// \tparam kIsFirst this is the float32 pass: unresolved pairs are listed for float64
template <bool kIsFirst = false>
__device__ inline void report(const ChunkView& c, PairOutcome outcome, std::uint64_t row, const Enclosed& enclosed) {
  if (__all_sync(~0u, outcome == PairOutcome::kConverged)) {
    if (threadIdx.x % 32 == 0) atomicAdd(c.counts + kConvergedRows, 32);
    return;
  }
  if (kIsFirst) {
    const std::uint32_t open = take_place(c.counts + kLeftOpen, outcome == PairOutcome::kUnresolved);
    if (outcome == PairOutcome::kUnresolved) c.left_open[open] = {enclosed.pair, enclosed.configuration};
  } else {
    const std::uint32_t rest = take_place(c.counts + kRest, outcome == PairOutcome::kUnresolved);
    if (outcome == PairOutcome::kUnresolved) c.rest[rest] = static_cast<std::uint32_t>(row);
    const std::uint32_t at = take_place(c.counts + kEnclosedPairs, outcome == PairOutcome::kEnclosed);
    if (outcome == PairOutcome::kEnclosed) c.enclosed[at] = enclosed;
  }
  add_count(c.counts + kConvergedRows, outcome == PairOutcome::kConverged);
}

}  // namespace clearance::cuda
