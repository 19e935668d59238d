// The nearest elements of a cloud or mesh and of a body of convex pieces, looked for by a warp.
//
// Subtrees wait on a stack in shared memory, each with a lower bound on its distance to the other body's piece: by
// boxes, along the line of their middles, and along the direction that the nearest point so far was proved by;
// docs/bounds.md, "Surfaces". What is proved to be farther than an upper bound is left out, and its gap counts in the
// lower bound. So the interval is one that contains the distance, as narrow as asked; which one of those may be another
// than the CPU's, who goes another way. Which one it is depends on the pair alone, and on what its group's seed cuts
// off. Where all triangles of a solid are apart from a piece, one of the piece's points says whether it lies within.
#pragma once

#include "engine/cuda/element_parts.cuh"
#include "engine/cuda/element_winding.cuh"
#include "engine/cuda/overlap_kernel.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kStackEntries = 320, kWaitingEntries = 32 + 32 * 4;
inline constexpr std::uint32_t kWayDown = 32;       // entries that one node's way down takes, of as many levels
inline constexpr std::uint32_t kWindingPoints = 4;  // of a piece that are asked whether they lie within a solid

// Where nodes (kStackEntries) and elements (kWaitingEntries) of one warp's search wait, each with its gap.
struct ElementRoom {
  std::uint32_t *node, *element;
  float *node_gap, *element_gap;
};

template <class T>
__device__ inline T least_of_warp(T x) {
  for (int step = 16; step > 0; step /= 2) {
    const T other = __shfl_xor_sync(~0u, x, step);
    if (other < x) x = other;
  }
  return x;
}

// A pair of elements (Points or Triangles) and of convex pieces, of which all of a warp's threads look for the nearest
// element.
template <class Elements>
class WarpSearch {
 public:
  // \param q what is asked of the pair's bodies. \param cut_off of its pieces: no more need be known of what is
  // farther.
  // \param enough an upper bound so low is all that is asked
  __device__ WarpSearch(const ReducedView& r, const Question& q, const Where& at_a, const Where& at_b,
                        const Slack& slack, double cut_off, double enough, const ElementRoom& room)
      : c_(r.chunk),
        q_(q),
        at_a_(at_a),
        at_b_(at_b),
        slack_(slack),
        cut_off_(cut_off),
        enough_(enough),
        room_(room),
        elements_first_(r.elements.of_body[at_a.body] != kNone),
        set_(r.elements.sets[r.elements.of_body[elements_first_ ? at_a.body : at_b.body]]),
        of_a_(at_a.frame()),
        of_b_(at_b.frame()),
        at_(pair_frame<double>(set_.hull, of_a_.R_wb, of_a_.t_w, set_.hull, of_b_.R_wb, of_b_.t_w)) {
    const std::uint32_t body = elements_first_ ? at_b.body : at_a.body;
    first_piece_ = c_.hulls.piece_begin[body];
    pieces_ = c_.hulls.piece_begin[body + 1] - first_piece_;
  }

  // kSettled: the thread that has_answer() holds the answer. \param answer has the pair's flags
  __device__ Outcome run(PairAnswer& answer) {
    for (std::uint32_t piece = 0; piece < pieces_ && !is_over(); ++piece) search(piece, answer);
    if (is_open_) return Outcome::kUnsettled;
    if (overlaps_) return Outcome::kSettled;
    return finish(answer);
  }
  __device__ bool has_answer() const { return is_writer_; }

 private:
  __device__ static std::uint32_t lane() { return threadIdx.x % 32; }
  __device__ bool is_over() const {
    return is_open_ || overlaps_ || upper_ <= enough_ || slack_.true_upper(upper_) <= 0;
  }

  // Beyond which elements are left out. Around a nearest one many are as near as it is: what keeps the interval as
  // narrow as half of what is asked is left out.
  __device__ double limit() const {
    if (!(upper_ < cut_off_)) return cut_off_;
    if (!(upper_ > 0)) return 0;
    return fmax(0.5 * upper_, upper_ - 0.5 * tolerance_at(upper_, q_.abs_tol, q_.rel_tol));
  }

  __device__ void search(std::uint32_t piece, PairAnswer& answer) {
    const HullHead* const head = c_.hulls.heads + c_.hulls.piece_hull[first_piece_ + piece];
    PieceBefore before(set_, elements_first_ ? of_a_ : of_b_, *head, elements_first_ ? of_b_ : of_a_);
    stacked_ = waiting_ = 0;
    put_root(before);
    while ((stacked_ > 0 || waiting_ > 0) && !is_over()) {
      if (stacked_ > 0 && waiting_ < 32)
        open(before);
      else
        look(piece, *head, before, answer);
    }
    // What was not looked at: it is no nearer than its gap.
    for (std::uint32_t i = lane(); i < stacked_; i += 32) leave_out(room_.node_gap[i]);
    for (std::uint32_t i = lane(); i < waiting_; i += 32) leave_out(room_.element_gap[i]);
    __syncwarp();
    if (is_over())  // of the other pieces nothing is known
      for (std::uint32_t other = piece + 1 + lane(); other < pieces_; other += 32) {
        const HullHead& of = c_.hulls.heads[c_.hulls.piece_hull[first_piece_ + other]];
        const PieceBefore there(set_, elements_first_ ? of_a_ : of_b_, of, elements_first_ ? of_b_ : of_a_);
        leave_out(there.gap(LoadedNode<Elements>(set_, 0).bulk, __builtin_inf()));
      }
  }

  __device__ void leave_out(double gap) { lower_ = gap < lower_ ? gap : lower_; }

  __device__ void put_root(const PieceBefore& before) {
    const double limit = this->limit(), gap = before.gap(LoadedNode<Elements>(set_, 0).bulk, limit);
    put(lane() == 0, 0, gap, limit, room_.node, room_.node_gap, stacked_);
  }
  // All threads call it; those that have something to put, in the order of their lanes.
  __device__ void put(bool there, std::uint32_t what, double gap, double limit, std::uint32_t* list, float* gaps,
                      std::uint32_t& count) {
    if (there && gap > limit) leave_out(gap);
    const bool wanted = there && !(gap > limit);
    const std::uint32_t all = __ballot_sync(~0u, wanted);
    if (wanted) {
      const std::uint32_t at = count + static_cast<std::uint32_t>(__popc(all & ((1u << lane()) - 1)));
      list[at] = what;
      gaps[at] = __double2float_rd(gap);
    }
    count += static_cast<std::uint32_t>(__popc(all));
  }

  // Divides the nodes on top of the stack, a thread for each: as many as their children leave room for, and beside that
  // for one node's way down. Where no more is left, that goes down alone.
  __device__ void open(const PieceBefore& before) {
    if (stacked_ == kStackEntries) {
      is_open_ = true;
      return;
    }
    const std::uint32_t room = kStackEntries - stacked_, wide = room > kWayDown ? room - kWayDown : 1,
                        most = wide < 32 ? wide : 32, count = stacked_ < most ? stacked_ : most;
    __syncwarp();
    stacked_ -= count;
    const double limit = this->limit();
    bool there = lane() < count;
    const std::uint32_t at = there ? room_.node[stacked_ + lane()] : 0;
    const double known = there ? room_.node_gap[stacked_ + lane()] : 0;
    __syncwarp();
    if (there && known > limit) {
      leave_out(known);
      there = false;
    }
    std::uint32_t right = 0, first = 0, elements = 0;
    if (there) {
      const LoadedNode<Elements> node(set_, at);
      right = node.right;
      first = node.begin();
      elements = node.is_leaf() ? node.count() : 0;
    }
    for (std::uint32_t i = 0; __any_sync(~0u, i < elements); ++i) {
      const bool has = i < elements;
      const std::uint32_t element = first + i;
      const double gap = has ? before.gap(Elements::of_element(set_, element), limit) : 0;
      put(has, element, gap, limit, room_.element, room_.element_gap, waiting_);
    }
    const bool divides = there && elements == 0;
    std::uint32_t near = at + 1, far = right;
    double near_gap = 0, far_gap = 0;
    if (divides) {
      const LoadedNode<Elements> one(set_, near), other(set_, far);
      near_gap = before.gap(one.bulk, limit);
      far_gap = before.gap(other.bulk, limit);
      if (far_gap < near_gap ||
          (far_gap == near_gap && before.between_middles(other.bulk) < before.between_middles(one.bulk))) {
        const std::uint32_t node = near;
        near = far;
        far = node;
        const double gap = near_gap;
        near_gap = far_gap;
        far_gap = gap;
      }
    }
    put(divides, far, far_gap, limit, room_.node, room_.node_gap, stacked_);
    put(divides, near, near_gap, limit, room_.node, room_.node_gap, stacked_);
    __syncwarp();
  }

  // Answers the elements that wait, a thread for each.
  __device__ void look(std::uint32_t piece, const HullHead& head, PieceBefore& before, PairAnswer& answer) {
    __syncwarp();
    const std::uint32_t count = waiting_ < 32 ? waiting_ : 32;
    waiting_ -= count;
    const double limit = this->limit();
    bool there = lane() < count;
    const std::uint32_t element = there ? room_.element[waiting_ + lane()] : 0;
    if (there) {
      // Along what was found since, too.
      const double known = fmax(static_cast<double>(room_.element_gap[waiting_ + lane()]),
                                before.gap(Elements::of_element(set_, element), limit));
      if (known > limit) {
        leave_out(known);
        there = false;
      }
    }
    __syncwarp();
    if (!__any_sync(~0u, there)) return;
    Question q = q_;
    q.max_distance = limit;
    const ElementHull<Elements> hull(set_, element);
    const Part x = piece_part(c_.hulls, &head), e = hull.part();
    const Part& a = elements_first_ ? e : x;
    const Part& b = elements_first_ ? x : e;
    double upper = __builtin_inf();
    Vec3d v{0, 0, 0};
    bool open = false, overlaps = false;
    if (there) {
      Run<Part> run(q, a, b, at_);
      run.go();
      Enclosed enclosed;
      if (run.g.end == Gjk<double>::code(GjkEnd::kEncloses)) {
        overlaps = take_enclosed(run.g, enclosed) && prove(a, b, enclosed, answer);
        open = !overlaps;
        if (overlaps) set_pieces(piece, answer);
      } else {
        const RunBounds<double> bounds = run.bounds(enough_);
        // Grown elements that overlap, while their cores do not, are nobody's to refine where no depth is asked for.
        const bool settled = bounds.settled || (bounds.upper <= 0 && bounds.lower <= bounds.upper);
        open = !settled;
        if (settled) {
          leave_out(bounds.lower);
          upper = bounds.upper;
          v = run.g.v;
          if (upper < best_upper_) {
            best_upper_ = upper;
            best_piece_ = piece;
            best_element_ = element;
            witness_ = witness_of(run.g, bounds, of_a_.R_wb);
          }
        }
      }
    }
    if (const std::uint32_t proved = __ballot_sync(~0u, overlaps); proved != 0) {
      overlaps_ = true;
      is_writer_ = lane() == first_of(proved);
      return;
    }
    if (__any_sync(~0u, open)) {
      is_open_ = true;
      return;
    }
    const double least = least_of_warp(upper);
    if (!(least < upper_)) return;
    upper_ = least;
    // The direction that has proved the nearest: from a towards b it is -v, in a's axes.
    const int nearest = static_cast<int>(first_of(__ballot_sync(~0u, upper == least)));
    const Vec3d of_nearest{__shfl_sync(~0u, v.x, nearest), __shfl_sync(~0u, v.y, nearest),
                           __shfl_sync(~0u, v.z, nearest)};
    before.look_along(elements_first_ ? -of_nearest : before.turned(of_nearest), x);
  }
  __device__ static std::uint32_t first_of(std::uint32_t bits) {
    return static_cast<std::uint32_t>(__ffs(static_cast<int>(bits))) - 1;
  }

  __device__ bool prove(const Part& a, const Part& b, const Enclosed& enclosed, PairAnswer& answer) const {
    const auto vertex_a = [&](std::uint32_t i) { return a.vertex(i); };
    const auto vertex_b = [&](std::uint32_t i) { return b.vertex(i); };
    return prove_overlap_of(q_, a.extents(), vertex_a, b.extents(), vertex_b, at_, enclosed, at_a_, at_b_, slack_.outer,
                            answer);
  }
  __device__ void set_pieces(std::uint32_t piece, PairAnswer& answer) const {
    if (!q_.want_points) return;
    answer.piece_a = elements_first_ ? 0 : piece;
    answer.piece_b = elements_first_ ? piece : 0;
  }

  // What all that was found says of the pair.
  __device__ Outcome finish(PairAnswer& answer) {
    const double lower = least_of_warp(lower_), upper = upper_;
    const std::uint16_t flags = answer.flags;
    if constexpr (Elements::kIsMesh)
      if (lower > 0 && set_.is_solid) {
        const Outcome held = look_within(lower, answer);
        if (held != Outcome::kNone) return held;
      }
    if (lower > cut_off_ || !(upper < __builtin_inf())) {  // all are proved beyond the cut-off
      answer = beyond_answer(slack_.true_lower(lower));
      answer.flags = flags;
      is_writer_ = lane() == 0;
      return Outcome::kSettled;
    }
    is_writer_ = lane() == first_of(__ballot_sync(~0u, best_upper_ == upper));
    const bool overlaps = slack_.true_upper(upper) <= 0;
    if (upper <= 0 && !overlaps) return Outcome::kUnsettled;  // nobody knows whether the true bodies do
    decide(limits_of(q_), upper <= 0 ? -__builtin_inf() : lower, upper, [] { return 0.0; }, answer, slack_);
    if (is_writer_ && q_.want_points) add_points_of_best(upper <= 0, answer);
    return Outcome::kSettled;
  }
  // Whether a piece lies within the solid, all of whose triangles are farther than `apart`: docs/bounds.md, "Surfaces".
  // kNone: none does.
  __device__ Outcome look_within(double apart, PairAnswer& answer) {
    const PlacedFrame &outer = elements_first_ ? of_a_ : of_b_, &inner = elements_first_ ? of_b_ : of_a_;
    const Vec3d shift = inner.t_w - outer.t_w;
    for (std::uint32_t piece = 0; piece < pieces_; ++piece) {
      const HullHead& head = c_.hulls.heads[c_.hulls.piece_hull[first_piece_ + piece]];
      if (PieceBefore(set_, outer, head, inner).gap(LoadedNode<Elements>(set_, 0).bulk, 0) > 0) continue;
      // A point as computed must be on the side of every triangle that it is on.
      const double radii = set_.hull.radius + head.radius,
                   wrong = rounding_error(double(RoundingUnits<double>::kLower),
                                          pair_scale(shift, set_.hull.rho, head.rho, radii));
      if (!(apart + radii > wrong)) return Outcome::kUnsettled;
      // All of the piece lies on one side: where float64 is not sure of one of its points, it may be of another.
      Winding winding{0, false};
      Vec3d turned{0, 0, 0};
      for (std::uint32_t i = 0; i < kWindingPoints && i < head.count && !winding.is_sure; ++i) {
        turned = inner.R_wb * piece_part(c_.hulls, &head).vertex(i * (head.count / kWindingPoints));
        winding = count_winding(set_, outer.R_wb.transpose_times(turned + shift), room_.node, kStackEntries);
      }
      if (!winding.is_sure) return Outcome::kUnsettled;
      if (winding.number == 0) continue;
      add_held(piece, turned, turned + shift, apart, answer);
      return Outcome::kSettled;
    }
    return Outcome::kNone;
  }
  // \param from_inner, from_outer a point that both share, from the origin of either
  __device__ void add_held(std::uint32_t piece, const Vec3d& from_inner, const Vec3d& from_outer, double apart,
                           PairAnswer& answer) {
    const bool has_best = upper_ < __builtin_inf();
    is_writer_ = has_best ? lane() == first_of(__ballot_sync(~0u, best_upper_ == upper_)) : lane() == 0;
    decide(limits_of(q_), -__builtin_inf(), -apart, [] { return 0.0; }, answer);
    if (q_.want_nonsmooth) answer.flags |= kFlagNonsmooth;
    if (!q_.want_points) return;
    set_pieces(piece, answer);
    answer.point_a = elements_first_ ? from_outer : from_inner;
    answer.point_b = elements_first_ ? from_inner : from_outer;
    answer.normal = has_best && witness_.separation_length > 0 ? witness_.separation * (1 / witness_.separation_length)
                                                               : Vec3d{1, 0, 0};
  }
  __device__ void add_points_of_best(bool overlap, PairAnswer& answer) const {
    const HullHead& head = c_.hulls.heads[c_.hulls.piece_hull[first_piece_ + best_piece_]];
    const ElementHull<Elements> hull(set_, best_element_);
    const Part x = piece_part(c_.hulls, &head), e = hull.part();
    const Part& a = elements_first_ ? e : x;
    const Part& b = elements_first_ ? x : e;
    add_points(a, at_a_, b, at_b_, witness_, q_.want_nonsmooth, answer);
    set_pieces(best_piece_, answer);
    if (!overlap) return;
    // Both are halfway between the cores, in the share of what these are grown by.
    const double length = witness_.separation_length, radius = a.extents().radius + b.extents().radius,
                 share = a.extents().radius / radius;
    const Vec3d outward = witness_.separation * (1 / length);
    answer.point_a = answer.point_a - outward * (a.extents().radius - length * share);
    answer.point_b = answer.point_b + outward * (b.extents().radius - length * (1 - share));
  }

  const ChunkView& c_;
  const Question& q_;
  const Where &at_a_, &at_b_;
  const Slack slack_;
  const double cut_off_, enough_;
  const ElementRoom room_;
  const bool elements_first_;
  const ElementSet& set_;
  const PlacedFrame of_a_, of_b_;
  const PairFrame<double> at_;
  std::uint32_t first_piece_, pieces_;
  std::uint32_t stacked_ = 0, waiting_ = 0;
  bool is_open_ = false, overlaps_ = false, is_writer_ = false;
  double lower_ = __builtin_inf();  // of what this thread has looked at or left out
  double upper_ = __builtin_inf();  // of all
  // The nearest that this thread has answered.
  double best_upper_ = __builtin_inf();
  std::uint32_t best_piece_ = 0, best_element_ = 0;
  LaneWitness witness_;
};

}  // namespace clearance::cuda
