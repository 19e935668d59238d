// The code of lanes.h, compiled once for each instruction set: see lanes_avx512.cpp and the files next to it.
//
// It uses only packs, plain arrays and templates over them: a function shared with other files might be linked from
// here, and then use instructions that the machine does not have.
#pragma once

#include <type_traits>

#include "engine/narrow/certify.h"
#include "engine/narrow/lanes.h"
#include "engine/narrow/lanes/lanes_supports.h"
#include "engine/narrow/pair_run.h"

namespace clearance {

template <class T>
struct RoundingUnits<CLEARANCE_ISA::Pack<T>> : RoundingUnits<T> {};

namespace CLEARANCE_ISA {

template <class T, class To>
HWY_INLINE void copy_lane(const Vec3<Pack<T>>& from, int lane, Vec3<To>& to) {
  to.x = reinterpret_cast<const T*>(&from.x)[lane];
  to.y = reinterpret_cast<const T*>(&from.y)[lane];
  to.z = reinterpret_cast<const T*>(&from.z)[lane];
}
template <class T>
HWY_INLINE T lane_of(const Pack<T>& from, int lane) {
  return reinterpret_cast<const T*>(&from)[lane];
}
template <class T>
HWY_INLINE void set_lane(Pack<T>& to, int lane, T value) {
  reinterpret_cast<T*>(&to)[lane] = value;
}
template <class T>
HWY_INLINE void copy_lane(const CsoVertex<Pack<T>>& from, int lane, CsoVertex<T>& to) {
  copy_lane(from.w, lane, to.w);
  to.a = static_cast<std::uint32_t>(static_cast<std::int64_t>(lane_of(from.a, lane)));
  to.b = static_cast<std::uint32_t>(static_cast<std::int64_t>(lane_of(from.b, lane)));
}

template <class T>
HWY_INLINE void copy_lane(const Gjk<Pack<T>>& from, int lane, Gjk<T>& to) {
  copy_lane(from.v, lane, to.v);
  to.squared_distance = lane_of(from.squared_distance, lane);
  to.gap = lane_of(from.gap, lane);
  to.end = static_cast<int>(lane_of(from.end, lane));
  to.simplex.size = static_cast<int>(lane_of(from.simplex.size, lane));
  for (int i = 0; i < to.simplex.size; ++i) {
    copy_lane(from.simplex.vertex[i], lane, to.simplex.vertex[i]);
    to.simplex.weight[i] = lane_of(from.simplex.weight[i], lane);
  }
  copy_lane(from.last, lane, to.last);
}

template <class T>
HWY_INLINE void copy_witness(const Gjk<Pack<T>>& from, const RunBounds<Pack<T>>& bounds, int lane, const Mat3d& R_wa,
                             LaneWitness& to) {
  const SimplexPoint<Pack<T>>& point = bounds.nearest;
  Vec3d v, w;
  copy_lane(from.v, lane, v);
  copy_lane(point.w, lane, w);
  to.size = static_cast<std::uint32_t>(static_cast<std::int64_t>(lane_of(from.simplex.size, lane)));
  for (std::uint32_t i = 0; i < to.size; ++i) {
    to.a[i] = static_cast<std::uint32_t>(static_cast<std::int64_t>(lane_of(from.simplex.vertex[i].a, lane)));
    to.b[i] = static_cast<std::uint32_t>(static_cast<std::int64_t>(lane_of(from.simplex.vertex[i].b, lane)));
    to.share[i] = lane_of(point.share[i], lane);
  }
  take_run<T>(to, R_wa, v, lane_of(bounds.v_length, lane), w, lane_of(bounds.length, lane));
}

// The point of a round core that the witness's shares give, summed as converged_points() does.
HWY_INLINE void copy_core(const FoundPoints& points, const std::uint32_t* numbers, const LaneWitness& from, Vec3d& to) {
  to = {0, 0, 0};
  for (std::uint32_t i = 0; i < 3 && i < from.size; ++i) {
    const Vec3d& p = points.at[numbers[i]];
    to = {to.x + p.x * from.share[i], to.y + p.y * from.share[i], to.z + p.z * from.share[i]};
  }
}

// The state of each lane, in memory: single lanes are written, and all are read as packs.
template <class T>
struct Lanes {
  static constexpr int kCount = Pack<T>::kLanes;
  const LaneHull *a[kCount], *b[kCount];
  Columns3<T> centre_a, centre_b;
  Column<T> rho_a, rho_b, radius;
  Column<T> round_units;  // as in RunBounds
  Column<T> most_steps = {};
  PlacedColumns<T> rotation = {};
  Columns3<T> offset = {};
  Column<T> extra = {}, cut_off = {}, stop_below = {}, steps = {};
  Column<T> fresh = {};  // 1 if the pair has come since the last step
  std::size_t pair_of[kCount] = {};
  bool busy_at[kCount] = {};
  int busy = 0;
  std::size_t next = 0;                            // of the batch's pairs
  FoundPoints points_a[kCount], points_b[kCount];  // of round cores

  HWY_INLINE explicit Lanes(const LaneBatch& batch) {
    for (int lane = 0; lane < kCount; ++lane) set_hulls(lane, *batch.pairs[0].a, *batch.pairs[0].b);
  }
  HWY_INLINE void set_hulls(int lane, const LaneHull& hull_a, const LaneHull& hull_b) {
    const Source<T> from_a(hull_a), from_b(hull_b);
    a[lane] = &hull_a;
    b[lane] = &hull_b;
    centre_a.set(lane, from_a.centre);
    centre_b.set(lane, from_b.centre);
    rho_a.at[lane] = reach_of<T>(hull_a);
    rho_b.at[lane] = reach_of<T>(hull_b);
    radius.at[lane] = static_cast<T>(hull_a.radius + hull_b.radius);
    round_units.at[lane] = static_cast<T>(is_round(lane) ? kRoundUnits : 0);
  }
  HWY_INLINE bool is_round(int lane) const { return a[lane]->round || b[lane]->round; }
  // Puts the next pair that the arithmetic can represent into a lane, and answers those before it. False if there are
  // no more.
  template <bool kSameHulls>
  HWY_INLINE bool take_next(const LaneBatch& batch, int lane) {
    for (; next < batch.count; ++next) {
      const LanePair& pair = batch.pairs[next];
      const PairFrame<T> frame = pair_frame<T>(*pair.a, *pair.R_wa, *pair.t_a, *pair.b, *pair.R_wb, *pair.t_b);
      if (!frame.fits) {
        batch.answers[next] = {-__builtin_inf(), __builtin_inf(), false};
        continue;
      }
      if (!kSameHulls) set_hulls(lane, *pair.a, *pair.b);
      cut_off.at[lane] = static_cast<T>(pair.max_distance * RunSetup<T>::kMore);
      stop_below.at[lane] = static_cast<T>(pair.stop_below * RunSetup<T>::kStrict);
      for (int r = 0; r < 3; ++r) rotation.row[r].set(lane, frame.R.row[r]);
      extra.at[lane] = frame.extra;
      offset.set(lane, frame.D);
      fresh.at[lane] = 1;
      steps.at[lane] = 0;
      // A run of more steps than there is memory for points goes on alone.
      constexpr int kMostRound = FoundPoints::kMost - 1;
      const bool is_short = is_round(lane) && batch.max_iterations > kMostRound;
      most_steps.at[lane] = static_cast<T>(is_short ? kMostRound : batch.max_iterations);
      points_a[lane].clear();
      points_b[lane].clear();
      pair_of[lane] = next++;
      busy_at[lane] = true;
      ++busy;
      return true;
    }
    busy_at[lane] = false;
    return false;
  }
};

template <class T>
HWY_INLINE PairFrame<Pack<T>> frames_of(const Lanes<T>& lanes) {
  return {lanes.rotation.pack(), lanes.offset.pack(), lanes.extra.pack()};
}

// First directions of new pairs, and the limits of all lanes from now on.
template <class T>
HWY_INLINE void begin_fresh(Lanes<T>& lanes, const PairFrame<Pack<T>>& at, GjkLimits<Pack<T>>& limits, Pack<T>& scale,
                            Gjk<Pack<T>>& g) {
  using P = Pack<T>;
  const P zero(0.0);
  const auto is_fresh = lanes.fresh.pack() > zero;
  g.v = select(is_fresh, first_direction(at.cso_vertex(lanes.centre_a.pack(), lanes.centre_b.pack())), g.v);
  lanes.fresh.set(zero);
  limits.radius = lanes.radius.pack();
  scale = pair_scale(at.D, lanes.rho_a.pack(), lanes.rho_b.pack(), limits.radius);
  if (limits.bounded)
    limits.max_distance = core_cut_off_at(lanes.cut_off.pack(), limits.radius, scale, lanes.round_units.pack());
}

// The farthest vertices of each lane's two hulls, both together, so that the work of one fills the latency of the other.
template <class T>
HWY_INLINE void find_each_of_both(Lanes<T>& lanes, const Vec3<Pack<T>>& along_a, const Vec3<Pack<T>>& along_b,
                                  FoundVertex<T>& in_a, FoundVertex<T>& in_b) {
  EachSearch<T> of_a(along_a), of_b(along_b);
  for (int lane = 0; lane < Pack<T>::kLanes; ++lane) {
    of_a.find(lane, *lanes.a[lane], lanes.busy_at[lane], &lanes.points_a[lane]);
    of_b.find(lane, *lanes.b[lane], lanes.busy_at[lane], &lanes.points_b[lane]);
  }
  in_a = of_a.found();
  in_b = of_b.found();
}

// Both hulls' farthest vertices along the directions of all lanes.
template <class T, bool kSameHulls>
HWY_INLINE void find_farthest(Lanes<T>& lanes, const Vec3<Pack<T>>& along_a, const Vec3<Pack<T>>& along_b,
                              FoundVertex<T>& in_a, FoundVertex<T>& in_b) {
  const LaneHull &a = *lanes.a[0], &b = *lanes.b[0];
  if (!kSameHulls || (a.has_table && b.has_table)) {
    find_each_of_both(lanes, along_a, along_b, in_a, in_b);
  } else if (a.has_table || b.has_table) {
    in_a = a.has_table ? find_each<T>(lanes.a, lanes.busy_at, along_a) : scan_one<T>(a, along_a);
    in_b = b.has_table ? find_each<T>(lanes.b, lanes.busy_at, along_b) : scan_one<T>(b, along_b);
  } else {
    Scan<T> scan_a(a, along_a), scan_b(b, along_b);
    scan_both(scan_a, scan_b);
    in_a = scan_a.found();
    in_b = scan_b.found();
  }
}

// Writes the results of the lanes that ended: their bounds, and the witness if they suffice, or else the state of GJK.
template <class T>
HWY_INLINE void hand_out(const LaneBatch& batch, const Lanes<T>& lanes, const Gjk<Pack<T>>& g,
                         const RunBounds<Pack<T>>& bounds, std::uint32_t ended) {
  Column<T> lower, upper;
  lower.set(bounds.lower);
  upper.set(bounds.upper);
  const std::uint32_t converged = bits_of(bounds.converged);
  for (; ended != 0; ended &= ended - 1) {
    const int lane = __builtin_ctz(ended);
    const std::size_t pair = lanes.pair_of[lane];
    const bool done = converged >> lane & 1;
    batch.answers[pair] = {lower.at[lane], upper.at[lane], done};
    if constexpr (std::is_same_v<T, double>)
      if (!done) copy_lane(g, lane, batch.unresolved[pair]);
    if (!done || !batch.witnesses) continue;
    CoreWitness& witness = batch.witnesses[pair];
    copy_witness(g, bounds, lane, *batch.pairs[pair].R_wa, witness);
    if (lanes.a[lane]->round) copy_core(lanes.points_a[lane], witness.a, witness, witness.core_a);
    if (lanes.b[lane]->round) copy_core(lanes.points_b[lane], witness.b, witness, witness.core_b);
  }
}

template <class T, bool kSameHulls>
void run_pairs(const LaneBatch& batch) {
  using P = Pack<T>;
  using Setup = RunSetup<T>;
  bool rounded = false, bounded = false;
  for (std::size_t i = 0; i < batch.count; ++i) {
    const LanePair& pair = batch.pairs[i];
    bounded = bounded || pair.max_distance < Setup::kUnbounded;
    rounded = rounded || pair.a->radius + pair.b->radius > 0;
  }
  GjkLimits<P> limits = run_limits<P>(batch.abs_tol, batch.rel_tol, rounded, bounded);
  const P zero(0.0), one(1.0);
  P scale = zero;
  Gjk<P> g;
  g.v = {one, zero, zero};
  for (int i = 0; i < 4; ++i) {
    g.simplex.vertex[i] = {{zero, zero, zero}, zero, zero};
    g.simplex.weight[i] = zero;
  }
  g.last = g.simplex.vertex[0];

  Lanes<T> lanes(batch);
  const auto fill = [&](int lane) __attribute__((always_inline)) {
    const bool taken = lanes.template take_next<kSameHulls>(batch, lane);
    set_lane(g.end, lane, T(taken ? 0 : -1));
    if (!taken) return;
    set_lane(g.simplex.size, lane, T(0));
    set_lane(g.squared_distance, lane, T(0));
  };
  g.end = zero;
  for (int lane = 0; lane < Lanes<T>::kCount; ++lane) fill(lane);

  bool any_fresh = true;
  while (lanes.busy > 0) {
    const PairFrame<P> at = frames_of(lanes);
    if (any_fresh) begin_fresh(lanes, at, limits, scale, g);
    any_fresh = false;
    const auto running = g.end == zero;
    FoundVertex<T> a, b;
    find_farthest<T, kSameHulls>(lanes, -g.v, at.R.transpose_times(g.v), a, b);
    const CsoVertex<P> vertex{at.cso_vertex(a.p, b.p), a.index, b.index};
    g.step(vertex, -dot(g.v, at.D) - (a.value + b.value), limits, running);
    const P count = lanes.steps.pack() + one;
    lanes.steps.set(count);
    const auto at_limit = running & (g.end == zero) & !(count < lanes.most_steps.pack());
    g.end = select(at_limit, g.code(GjkEnd::kLimit), g.end);
    const auto ended = running & !(g.end == zero);
    if (!any(ended)) continue;

    // The answer that narrow_phase() gives for such a run, for pairs that need no further step.
    const RunBounds<P> bounds(g, limits.radius, scale, lanes.cut_off.pack(), P(batch.abs_tol * Setup::kStrict),
                              P(batch.rel_tol * Setup::kStrict), at.extra, lanes.stop_below.pack(),
                              lanes.round_units.pack());
    hand_out(batch, lanes, g, bounds, bits_of(ended));
    for (std::uint32_t left = bits_of(ended); left != 0; left &= left - 1) {
      --lanes.busy;
      fill(__builtin_ctz(left));
    }
    any_fresh = true;
  }
}

template <class T>
void run_in_lanes(const LaneBatch& batch) {
  if (batch.count == 0) return;
  if (batch.same_hulls)
    run_pairs<T, true>(batch);
  else
    run_pairs<T, false>(batch);
}

}  // namespace CLEARANCE_ISA
}  // namespace clearance
