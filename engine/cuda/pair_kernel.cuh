// One pair in one thread: gjk.h's text, bounds by certify.h's, columns by columns.h's.
//
// Every operation is rounded as on the CPU (--fmad=false, IEEE division and roots), so that an answer has the bits of
// the CPU's lanes (lanes_kernel.h), whose kernel this is with a thread for a lane.
#pragma once

#include <cstddef>

#include "engine/certify.h"
#include "engine/direction_table.h"
#include "engine/witness.h"
#include "layout.h"

namespace clearance::cuda {

// Blocks of kTile threads on a multiprocessor, among which its registers are shared out: with more, they spill.
inline constexpr int kBlocks = 3;

// A hull: its vertices, and its direction table if it has one. Vertices: shared by a block, or the scene's.
template <class Vertices>
struct Hull {
  Vertices vertices;
  const std::uint16_t *cells, *lists;  // null: no table
  std::uint32_t grid_bits, size;
  const HullHead* head;

  __device__ Hull(const Vertices& v, const std::uint16_t* words, const HullHead* h)
      : vertices(v),
        cells(h->words > 0 ? words : nullptr),
        lists(words + h->cell_words),
        grid_bits(h->grid_bits),
        size(h->count),
        head(h) {}
  __device__ Vec3d vertex(std::uint32_t i) const { return vertices[i]; }
  __device__ std::uint32_t count() const { return size; }
  __device__ double radius() const { return head->radius; }
  __device__ double spread() const { return head->spread; }

  // The farthest vertex along n, ties to the lowest index: support()'s words.
  __device__ SupportPoint<double> farthest(const Vec3d& n) const {
    if (!cells) return scan(n);
    const std::uint16_t* list = lists + list_along(n);
    const std::uint32_t candidates = list[0];
    SupportPoint<double> best{list[1], dot(n, vertex(list[1]))};
    for (std::uint32_t k = 2; k <= candidates; ++k) {
      const std::uint32_t i = list[k];
      const double s = dot(n, vertex(i));
      if (s > best.value) best = {i, s};
    }
    return best;
  }
  // The tables are blurred (float_blur()), so that float32 finds a list where it can hold the direction.
  __device__ std::uint32_t list_along(const Vec3d& n) const {
    const Vec3<float> f = cast<float>(n);
    const float size = fabsf(f.x) + fabsf(f.y) + fabsf(f.z);
    if (size > 1e-30f && size < 1e30f) {
      const MapPoint<float> at = map_point(f);
      return find_list(cells, grid_bits, at.u, at.v);
    }
    const MapPoint<double> at = map_point(n);
    return find_list(cells, grid_bits, at.u, at.v);
  }
  __device__ SupportPoint<double> scan(const Vec3d& n) const {
    SupportPoint<double> best{0, dot(n, vertex(0))};
#pragma unroll 4
    for (std::uint32_t i = 1; i < size; ++i) {
      const double s = dot(n, vertex(i));
      if (s > best.value) best = {i, s};
    }
    return best;
  }
};
struct SharedVertices {
  const double2* xy;
  const double* z;
  __device__ Vec3d operator[](std::uint32_t i) const {
    const double2 p = xy[i];
    return {p.x, p.y, z[i]};
  }
};
struct SceneVertices {
  const double *x, *y, *z;
  __device__ Vec3d operator[](std::uint32_t i) const { return {__ldg(x + i), __ldg(y + i), __ldg(z + i)}; }
};

__device__ inline std::uint32_t body_of(const BodiesView& bodies, std::uint32_t ref) {
  return ref & kMovedBit ? bodies.moved_body[ref & ~kMovedBit] : ref;
}
// A body's hull where the scene has it.
__device__ inline Hull<SceneVertices> scene_hull(const ChunkView& c, std::uint32_t ref) {
  const HullHead* head = c.hulls.heads + c.hulls.of_body[body_of(c.bodies, ref)];
  return {{c.hulls.x + head->first, c.hulls.y + head->first, c.hulls.z + head->first},
          c.hulls.words + head->first_word,
          head};
}

// A body where this thread finds it.
struct Where {
  const double* components;
  std::size_t stride;
  std::uint8_t state;
  std::uint32_t body;

  __device__ Where(const BodiesView& bodies, std::uint32_t configurations, std::uint32_t ref, std::uint32_t k) {
    if (ref & kMovedBit) {
      const std::uint32_t slot = ref & ~kMovedBit;
      components = bodies.moved + std::size_t{slot} * bodies.components * configurations + k;
      stride = configurations;
      state = bodies.moved_state[std::size_t{slot} * configurations + k];
      body = bodies.moved_body[slot];
    } else {
      components = bodies.fixed + ref;
      stride = bodies.bodies;
      state = bodies.fixed_state[ref];
      body = ref;
    }
  }
  __device__ Vec3d at(std::uint32_t c) const {
    return {components[c * stride], components[(c + 1) * stride], components[(c + 2) * stride]};
  }
  __device__ Mat3d rotation() const { return {{at(0), at(3), at(6)}}; }
  __device__ Vec3d translation() const { return at(9); }
  __device__ Aabb box() const { return {at(12), at(15)}; }
  __device__ Status status() const { return static_cast<Status>(state & kStateStatus); }
};

// Where both bodies of a pair are.
struct PlacedWhere {
  Mat3d R_wa, R_wb;
  Vec3d D;

  __device__ PlacedWhere(const Where& at_a, const Where& at_b)
      : R_wa(at_a.rotation()), R_wb(at_b.rotation()), D(at_b.translation() - at_a.translation()) {}
};

// The points and flags of a settled pair. Not inlined: what it needs should not take registers from the iteration.
template <class Hull>
__device__ __noinline__ void add_points(const Hull& a, const Where& at_a, const Hull& b, const Where& at_b,
                                        const LaneWitness& witness, bool want_nonsmooth, PairAnswer& answer) {
  const Mat3d R_wa = at_a.rotation(), R_wb = at_b.rotation();
  answer.piece_a = answer.piece_b = 0;
  settled_points(a, R_wa, b, R_wb, witness, answer.point_a, answer.point_b);
  answer.normal = settled_normal(witness);
  if (answer.status == Status::kBeyond)
    answer.point_a = answer.point_b = no_point();
  else if (want_nonsmooth && witness_is_ambiguous(a, R_wa, b, R_wb, answer.normal))
    answer.flags |= kFlagNonsmooth;
}

enum class Outcome { kNone, kWithoutPieces, kSettled, kUnsettled, kEnclosed };

// One pair's run of GJK, and what its bounds need.
template <class Hull>
struct Run {
  Gjk<double> g;
  double radius, scale;

  __device__ Run(const Question& q, const Hull& a, const Hull& b, const PlacedWhere& at)
      : radius(a.radius() + b.radius()), scale(pair_scale(at.D, a.head->rho, b.head->rho, radius)), q_(q), a_(a), b_(b), at_(at) {
    limits_.rel_tol = q.rel_tol / 2;
    limits_.abs_tol = q.abs_tol / 2;
    limits_.radius = radius;
    limits_.squared = !(radius > 0) && q.abs_tol == 0;
    limits_.bounded = q.max_distance < 1e150;
    if (limits_.bounded)
      limits_.max_distance = q.max_distance + radius + 2.0 * rounding_error(double(RoundingUnits<double>::kLower), scale);
    g.v = at.R_wa * a.head->centre - at.R_wb * b.head->centre - at.D;
    if (!(squared_norm(g.v) > 0)) g.v.x = 1;
  }
  // Begins where an earlier run ended.
  __device__ void begin_at(const WarmRow& warm) {
    const int size = warm.size < 3 ? warm.size : 3;
    if (size == 0) return;
    Simplex<double> simplex;
    CLEARANCE_UNROLL
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t ia = i < size ? warm.a[i] : warm.a[0], ib = i < size ? warm.b[i] : warm.b[0];
      if (ia >= a_.count() || ib >= b_.count()) return;
      simplex.vertex[i] = cso_vertex(ia, ib);
    }
    const CsoVertex<double> newest = simplex.vertex[0];
    simplex.vertex[0] = simplex.vertex[1];
    simplex.vertex[1] = simplex.vertex[2];
    simplex.size = size - 1;
    g.begin(simplex, newest, true);
  }
  __device__ WarmRow end() const {
    WarmRow row{};
    row.size = static_cast<std::uint16_t>(g.simplex.size < 3 ? g.simplex.size : 3);
    CLEARANCE_UNROLL
    for (int i = 0; i < 3; ++i) {
      row.a[i] = static_cast<std::uint16_t>(i < g.simplex.size ? g.simplex.vertex[i].a : 0);
      row.b[i] = static_cast<std::uint16_t>(i < g.simplex.size ? g.simplex.vertex[i].b : 0);
    }
    return row;
  }
  __device__ void step() {
    const SupportPoint<double> fa = a_.farthest(-at_.R_wa.transpose_times(g.v)), fb = b_.farthest(at_.R_wb.transpose_times(g.v));
    g.step(cso_vertex(fa.index, fb.index), -dot(g.v, at_.D) - (fa.value + fb.value), limits_, true);
  }
  __device__ RunBounds<double> bounds() const { return {g, radius, scale, q_.max_distance, q_.abs_tol, q_.rel_tol}; }

 private:
  __device__ CsoVertex<double> cso_vertex(std::uint32_t a, std::uint32_t b) const {
    return {at_.R_wa * a_.vertex(a) - at_.R_wb * b_.vertex(b) - at_.D, a, b};
  }

  const Question& q_;
  const Hull &a_, &b_;
  const PlacedWhere& at_;
  GjkLimits<double> limits_;
};

// Whether the simplex holds the origin, so that its vertices may prove an overlap.
__device__ inline bool take_enclosed(const Gjk<double>& g, Enclosed& enclosed) {
  if (g.end != Gjk<double>::code(GjkEnd::kEncloses) || g.simplex.size != 4) return false;
  CLEARANCE_UNROLL
  for (int i = 0; i < 4; ++i) {
    enclosed.a[i] = static_cast<std::uint16_t>(g.simplex.vertex[i].a);
    enclosed.b[i] = static_cast<std::uint16_t>(g.simplex.vertex[i].b);
  }
  return true;
}

// The answer of a run whose bounds are settled. \tparam kCompact only a compact column is wanted: no normal and no flags.
template <bool kCompact, class Hull>
__device__ inline void take_settled(const Question& q, const Hull& a, const Where& at_a, const Hull& b, const Where& at_b,
                                    const PlacedWhere& at, const Gjk<double>& g, const RunBounds<double>& bounds,
                                    PairAnswer& answer) {
  const bool beyond = bounds.lower > q.max_distance;
  answer.status = beyond ? Status::kBeyond : Status::kOk;
  answer.lower = bounds.lower;
  answer.upper = bounds.upper;
  answer.distance = beyond ? bounds.lower : bounds.upper;
  if (!q.want_points) return;
  LaneWitness w;
  w.v = g.v;
  w.separation = -bounds.nearest.w;
  w.v_length = bounds.v_length;
  w.separation_length = bounds.length;
  w.size = static_cast<std::uint32_t>(g.simplex.size);
  for (int i = 0; i < 3; ++i) {
    w.a[i] = g.simplex.vertex[i].a;
    w.b[i] = g.simplex.vertex[i].b;
    w.share[i] = bounds.nearest.share[i];
  }
  if (!kCompact) {
    add_points(a, at_a, b, at_b, w, q.want_nonsmooth, answer);
  } else {
    settled_points(a, at.R_wa, b, at.R_wb, w, answer.point_a, answer.point_b);
    if (beyond) answer.point_a = answer.point_b = no_point();
  }
}

// Answers one pair that has poses, if it can be settled. \param enclosed its simplex is left here if that holds the
// origin. \param warm with kWarm: where the run begins and what it leaves.
template <bool kCompact, bool kWarm, class Hull>
__device__ inline Outcome narrow(const Question& q, const Hull& a, const Where& at_a, const Hull& b, const Where& at_b,
                                 const PlacedWhere& at, PairAnswer& answer, Enclosed& enclosed, WarmRow* warm) {
  Run<Hull> run(q, a, b, at);
  if (kWarm) run.begin_at(*warm);
  for (int steps = 0; run.g.end == 0;) {
    run.step();
    if (run.g.end == 0 && ++steps >= q.max_iterations) run.g.end = Gjk<double>::code(GjkEnd::kLimit);
  }
  if (kWarm) *warm = run.end();
  if (q.prove_overlaps && take_enclosed(run.g, enclosed)) return Outcome::kEnclosed;
  const RunBounds<double> bounds = run.bounds();
  if (!bounds.settled) return Outcome::kUnsettled;
  take_settled<kCompact>(q, a, at_a, b, at_b, at, run.g, bounds, answer);
  return Outcome::kSettled;
}

__device__ inline std::uint16_t flags_of(const Where& a, const Where& b) {
  const std::uint8_t states = a.state | b.state;
  return (states & kStateRenormalised ? kFlagRenormalised : 0) | (states & kStateStale ? kFlagStale : 0);
}
template <bool kCompact = false>
__device__ inline void write_answer(const ChunkView& c, std::uint64_t row, std::uint32_t k, const Where& at_a,
                                    const Where& at_b, const PairAnswer& answer) {
  if (kCompact) {  // in two pieces of 16 bytes
    const CompactAnswer r = detail::compact(answer);
    auto* halves = reinterpret_cast<float4*>(c.reply.compact + row);
    halves[0] = {r.lower, r.upper, r.point_a[0], r.point_a[1]};
    halves[1] = {r.point_a[2], r.point_b[0], r.point_b[1], r.point_b[2]};
    return;
  }
  write_row(c.reply, row,
            {{at_a.body, at_b.body},
             static_cast<std::uint32_t>(c.first_configuration + k),
             answer,
             at_a.translation(),
             at_b.translation()});
}

// Answers one item of a chunk, unless it is not settled.
template <bool kCompact = false, bool kWarm = false, class Hull>
__device__ inline Outcome solve_item(const ChunkView& c, const Hull& a, const Where& at_a, const Hull& b, const Where& at_b,
                                     const PlacedWhere& at, PairAnswer& answer, Enclosed& enclosed,
                                     WarmRow* warm = nullptr) {
  const std::uint16_t flags = flags_of(at_a, at_b);
  if (const Status status = pair_status(at_a.status(), at_b.status()); status != Status::kOk) {
    answer = no_answer(status);
    answer.flags = flags;
    return Outcome::kWithoutPieces;
  }
  const double gap = c.question.cull ? certify_box_gap(at_a.box(), at_b.box()) : 0;
  if (c.question.cull && gap > c.question.max_distance) {
    answer = beyond_answer(gap);
    answer.flags = flags;
    return Outcome::kWithoutPieces;
  }
  answer.flags = flags;
  return narrow<kCompact, kWarm>(c.question, a, at_a, b, at_b, at, answer, enclosed, warm);
}

// Counts a warp's outcomes and lists the rows that are not settled. All its threads call these.
__device__ inline std::uint32_t take_place(std::uint32_t* count, bool wanted) {
  const unsigned all = __ballot_sync(~0u, wanted), lane = threadIdx.x % 32;
  if (all == 0) return 0;
  std::uint32_t first = 0;
  if (lane == 0) first = atomicAdd(count, __popc(all));
  return __shfl_sync(~0u, first, 0) + __popc(all & ((1u << lane) - 1));
}
__device__ inline void add_count(std::uint32_t* count, bool wanted) {
  const unsigned all = __ballot_sync(~0u, wanted);
  if (all != 0 && threadIdx.x % 32 == 0) atomicAdd(count, __popc(all));
}
__device__ inline void report(const ChunkView& c, Outcome outcome, std::uint64_t row, const Enclosed& enclosed) {
  const std::uint32_t rest = take_place(c.counts + kRest, outcome == Outcome::kUnsettled);
  if (outcome == Outcome::kUnsettled) c.rest[rest] = static_cast<std::uint32_t>(row);
  add_count(c.counts + kSettledRows, outcome == Outcome::kSettled);
  const std::uint32_t at = take_place(c.counts + kEnclosedPairs, outcome == Outcome::kEnclosed);
  if (outcome == Outcome::kEnclosed) c.enclosed[at] = enclosed;
}

}  // namespace clearance::cuda
