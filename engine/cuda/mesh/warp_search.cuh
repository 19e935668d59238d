// State that all threads of a warp share while they search a pair with elements for the nearest: bounds so far, and the
// final decision. element_search.cuh and mesh_search.cuh implement the searches.
#pragma once

#include "engine/cuda/mesh/element_set.cuh"
#include "engine/cuda/pair/overlap_kernel.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kWindingPoints = 4;  // points of a convex part tested for lying inside a solid

template <class T>
__device__ inline T least_of_warp(T x) {
  for (int step = 16; step > 0; step /= 2) {
    const T other = __shfl_xor_sync(~0u, x, step);
    if (other < x) x = other;
  }
  return x;
}
__device__ inline std::uint32_t first_of(std::uint32_t bits) {
  return static_cast<std::uint32_t>(__ffs(static_cast<int>(bits))) - 1;
}

class WarpSearch {
 public:
  WarpSearch(const WarpSearch&) = delete;
  // After run() converged: whether this thread holds the answer.
  __device__ bool has_answer() const { return is_writer_; }

 protected:
  // Two parts, as the search numbers them.
  struct Parts {
    std::uint32_t one, other;
  };

  // \param q limits of the bodies
  // \param cut_off of the convex parts: distance beyond which no better bounds are needed
  // \param stop_below an upper bound this low ends the search
  __device__ WarpSearch(const ReducedView& r, const PairLimits& q, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                        const Slack& slack, double cut_off, double stop_below)
      : c_(r.chunk),
        q_(q),
        at_a_(at_a),
        at_b_(at_b),
        slack_(slack),
        cut_off_(cut_off),
        stop_below_(stop_below),
        of_a_(at_a.frame()),
        of_b_(at_b.frame()),
        at_(pair_frame<double>(HullExtents{}, of_a_.R_wb, of_a_.t_w, HullExtents{}, of_b_.R_wb, of_b_.t_w)) {}

  __device__ static std::uint32_t lane() { return threadIdx.x % 32; }
  __device__ bool is_over() const {
    return is_open_ || overlaps_ || upper_ <= stop_below_ || slack_.true_upper(upper_) <= 0;
  }

  // Parts farther than this are skipped. Many parts are about as near as the nearest one, so skipping uses half of the
  // requested interval width.
  __device__ double limit() const {
    if (!(upper_ < cut_off_)) return cut_off_;
    if (!(upper_ > 0)) return 0;
    return fmax(0.5 * upper_, upper_ - 0.5 * tolerance_at(upper_, q_.abs_tol, q_.rel_tol));
  }
  __device__ void leave_out(double gap) { lower_ = gap < lower_ ? gap : lower_; }
  // Waiting entries are no nearer than their gaps.
  __device__ void leave_out_all(const float* gaps, std::uint32_t count) {
    for (std::uint32_t i = lane(); i < count; i += 32) leave_out(gaps[i]);
  }

  // Appends the entries of all threads with something to put, in lane order. All threads of the warp call it.
  template <class What>
  __device__ void put(bool there, const What& what, double gap, double limit, What* list, float* gaps,
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

  // Takes `count` entries off the end of a list, one per thread. Leaves out those beyond the limit. All threads of the
  // warp call it.
  // \returns whether this thread has an entry
  template <class What>
  __device__ bool take(std::uint32_t count, double limit, const What* list, const float* gaps, std::uint32_t& size,
                       What& what) {
    __syncwarp();
    size -= count;
    bool there = lane() < count;
    if (there) what = list[size + lane()];
    const double known = there ? gaps[size + lane()] : 0;
    __syncwarp();
    if (there && known > limit) {
      leave_out(known);
      there = false;
    }
    return there;
  }

  // Evaluates two parts per thread by GJK.
  // \param there whether this thread has parts
  // \param along receives the direction that proves the new nearest, from a towards b in the axes of a
  // \returns whether the upper bound decreased
  __device__ bool evaluate(bool there, double limit, const Part& a, const Part& b, const Parts& parts,
                           PairAnswer& answer, Vec3d& along) {
    PairLimits q = q_;
    q.max_distance = limit;
    double upper = __builtin_inf();
    Vec3d v{0, 0, 0};
    bool open = false, overlaps = false;
    if (there) {
      GjkRun<Part> run(q, a, b, at_);
      run.run();
      Enclosed enclosed;
      if (run.g.end == Gjk<double>::code(GjkEnd::kEncloses)) {
        overlaps = take_enclosed(run.g, enclosed) && prove(a, b, enclosed, answer);
        open = !overlaps;
      } else {
        const RunBounds<double> bounds = run.bounds(stop_below_);
        // If grown elements overlap but their cores do not, no refinement is needed, since no depth is requested.
        const bool converged = bounds.converged || (bounds.upper <= 0 && bounds.lower <= bounds.upper);
        open = !converged;
        if (converged) {
          leave_out(bounds.lower);
          upper = bounds.upper;
          v = run.g.v;
          if (upper < best_upper_) {
            best_upper_ = upper;
            best_ = parts;
            witness_ = witness_of(run.g, bounds, of_a_.R_wb);
          }
        }
      }
    }
    if (const std::uint32_t proved = __ballot_sync(~0u, overlaps); proved != 0) {
      overlaps_ = true;
      is_writer_ = lane() == first_of(proved);
      return false;
    }
    if (__any_sync(~0u, open)) {
      is_open_ = true;
      return false;
    }
    const double least = least_of_warp(upper);
    if (!(least < upper_)) return false;
    upper_ = least;
    const int nearest = static_cast<int>(first_of(__ballot_sync(~0u, upper == least)));
    along = -Vec3d{__shfl_sync(~0u, v.x, nearest), __shfl_sync(~0u, v.y, nearest), __shfl_sync(~0u, v.z, nearest)};
    return true;
  }

  // Decides by bounds a pair in which neither body contains the other.
  // \param add called with whether the parts overlap; adds the points of the best parts
  template <class Add>
  __device__ PairOutcome decide_by_bounds(double lower, PairAnswer& answer, const Add& add) {
    const double upper = upper_;
    const std::uint16_t flags = answer.flags;
    if (lower > cut_off_ || !(upper < __builtin_inf())) {  // all are proved beyond the cutoff
      answer = beyond_answer(slack_.true_lower(lower));
      answer.flags = flags;
      is_writer_ = lane() == 0;
      return PairOutcome::kConverged;
    }
    is_writer_ = lane() == first_of(__ballot_sync(~0u, best_upper_ == upper));
    const bool overlaps = slack_.true_upper(upper) <= 0;
    if (upper <= 0 && !overlaps) return PairOutcome::kUnresolved;  // it is open whether the exact bodies overlap
    decide(limits_of(q_), upper <= 0 ? -__builtin_inf() : lower, upper, [] { return 0.0; }, answer, slack_);
    if (is_writer_ && q_.want_points) add(upper <= 0);
    return PairOutcome::kConverged;
  }
  __device__ void add_points_of_best(const Part& a, const Part& b, bool overlap, PairAnswer& answer) const {
    add_points(a, at_a_, b, at_b_, witness_, q_.want_nonsmooth, answer);
    if (!overlap) return;
    // Both points are between the cores, divided in proportion to the radii.
    const double length = witness_.separation_length, radius = a.extents().radius + b.extents().radius,
                 share = a.extents().radius / radius;
    const Vec3d outward = witness_.separation * (1 / length);
    answer.point_a = answer.point_a - outward * (a.extents().radius - length * share);
    answer.point_b = answer.point_b + outward * (b.extents().radius - length * (1 - share));
  }

  // Whether the computed point is on the same side of every triangle of a solid as the exact point.
  // \param apart distance that all these triangles exceed
  // \param shift from the solid's origin to that of the other body, world axes
  __device__ static bool knows_side(double apart, const Vec3d& shift, const HullExtents& solid,
                                    const HullExtents& other) {
    const double radii = solid.radius + other.radius,
                 wrong = rounding_error(double(RoundingUnits<double>::kLower),
                                        pair_scale(shift, solid.rho, other.rho, radii));
    return apart + radii > wrong;
  }
  // Decides a pair in which one body contains the other.
  // \param a_holds whether a's solid contains a part of b, else the reverse
  // \param from_outer a common point, relative to the containing body's origin
  // \param from_inner the same point, relative to the other body's origin
  __device__ void add_held(bool a_holds, const Vec3d& from_outer, const Vec3d& from_inner, double apart,
                           PairAnswer& answer) {
    const bool has_best = upper_ < __builtin_inf();
    is_writer_ = has_best ? lane() == first_of(__ballot_sync(~0u, best_upper_ == upper_)) : lane() == 0;
    decide(limits_of(q_), -__builtin_inf(), -apart, [] { return 0.0; }, answer);
    if (q_.want_nonsmooth) answer.flags |= kFlagNonsmooth;
    if (!q_.want_points) return;
    answer.part_a = answer.part_b = 0;
    answer.point_a = a_holds ? from_outer : from_inner;
    answer.point_b = a_holds ? from_inner : from_outer;
    answer.normal = has_best && witness_.separation_length > 0 ? witness_.separation * (1 / witness_.separation_length)
                                                               : Vec3d{1, 0, 0};
  }

  const ChunkView& c_;
  const PairLimits& q_;
  const BodyPoseRef &at_a_, &at_b_;
  const Slack slack_;
  const double cut_off_, stop_below_;
  const PlacedFrame of_a_, of_b_;
  const PairFrame<double> at_;
  bool is_open_ = false, overlaps_ = false, is_writer_ = false;
  double lower_ = __builtin_inf();  // over the parts that this thread evaluated or skipped
  double upper_ = __builtin_inf();  // over all threads
  Parts best_{0, 0};                // the nearest parts that this thread evaluated

 private:
  __device__ bool prove(const Part& a, const Part& b, const Enclosed& enclosed, PairAnswer& answer) const {
    const auto vertex_a = [&](std::uint32_t i) { return a.vertex(i); };
    const auto vertex_b = [&](std::uint32_t i) { return b.vertex(i); };
    return prove_overlap_of(q_, a.extents(), vertex_a, b.extents(), vertex_b, at_, enclosed, at_a_, at_b_, slack_.outer,
                            answer);
  }

  double best_upper_ = __builtin_inf();
  LaneWitness witness_;
};

}  // namespace clearance::cuda
