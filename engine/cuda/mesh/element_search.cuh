// Search of a warp for the nearest elements of a cloud or mesh and a body of convex parts.
//
// Subtrees wait on a stack in shared memory, each with a lower bound on its distance from the other body's convex part:
// by boxes, along the line between their centres, and along the direction that proved the nearest point so far
// (docs/trust/bounds_bodies.md, "Surfaces"). A subtree proved farther than an upper bound is skipped, and its gap
// counts in the lower bound. The resulting interval contains the distance and is as narrow as requested, but the
// traversal order differs from the CPU's, so the interval may too. It depends only on the pair and on the cutoff of its
// group's seed. If all triangles of a solid are apart from a convex part, one point of the part decides whether it
// lies inside.
#pragma once

#include "engine/cuda/mesh/element_parts.cuh"
#include "engine/cuda/mesh/element_winding.cuh"
#include "engine/cuda/mesh/warp_search.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kStackEntries = 320, kWaitingEntries = 32 + 32 * 4;
inline constexpr std::uint32_t kWayDown = 32;  // entries for the descent from one node, of as many levels

// A pair of elements (Points or Triangles) and convex parts. All threads of a warp search for the nearest element.
template <class Elements>
class HullSearch : public WarpSearch {
 public:
  // Waiting nodes and elements of one warp's search, each with its gap. In shared memory.
  struct SharedScratch {
    std::uint32_t node[kStackEntries], element[kWaitingEntries];
    float node_gap[kStackEntries], element_gap[kWaitingEntries];
  };

  __device__ HullSearch(const ReducedView& r, const PairLimits& q, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                        const Slack& slack, double cut_off, double stop_below, SharedScratch& scratch)
      : WarpSearch(r, q, at_a, at_b, slack, cut_off, stop_below),
        scratch_{scratch.node, scratch.element, scratch.node_gap, scratch.element_gap},
        elements_first_(r.elements.of_body[at_a.body] != kNone),
        set_(r.elements.sets[r.elements.of_body[elements_first_ ? at_a.body : at_b.body]]) {
    const std::uint32_t body = elements_first_ ? at_b.body : at_a.body;
    first_part_ = c_.hulls.part_begin[body];
    parts_ = c_.hulls.part_begin[body + 1] - first_part_;
  }

  // If kConverged, the thread with has_answer() holds the answer.
  // \param answer has the pair's flags
  __device__ PairOutcome run(PairAnswer& answer) {
    for (std::uint32_t convex_part = 0; convex_part < parts_ && !is_over(); ++convex_part) search(convex_part, answer);
    if (is_open_) return PairOutcome::kUnresolved;
    if (overlaps_) return PairOutcome::kConverged;
    const double lower = least_of_warp(lower_);
    if constexpr (Elements::kIsMesh)
      if (lower > 0 && set_.is_solid) {
        const PairOutcome held = look_within(lower, answer);
        if (held != PairOutcome::kNone) return held;
      }
    return decide_by_bounds(lower, answer, [&](bool overlap) { add_points(overlap, answer); });
  }

 private:
  __device__ void search(std::uint32_t convex_part, PairAnswer& answer) {
    const HullHead* const head = c_.hulls.heads + c_.hulls.part_hull[first_part_ + convex_part];
    PartBefore before(set_, elements_first_ ? of_a_ : of_b_, *head, elements_first_ ? of_b_ : of_a_);
    stacked_ = waiting_ = 0;
    put_root(before);
    while ((stacked_ > 0 || waiting_ > 0) && !is_over()) {
      if (stacked_ > 0 && waiting_ < 32)
        open(before);
      else
        evaluate_waiting(convex_part, *head, before, answer);
    }
    leave_out_all(scratch_.node_gap, stacked_);
    leave_out_all(scratch_.element_gap, waiting_);
    __syncwarp();
    if (is_over())  // the other convex parts are not searched
      for (std::uint32_t other = convex_part + 1 + lane(); other < parts_; other += 32) {
        const HullHead& of = c_.hulls.heads[c_.hulls.part_hull[first_part_ + other]];
        const PartBefore there(set_, elements_first_ ? of_a_ : of_b_, of, elements_first_ ? of_b_ : of_a_);
        leave_out(there.gap(LoadedNode<Elements>(set_, 0).bounds, __builtin_inf()));
      }
  }

  __device__ void put_root(const PartBefore& before) {
    const double limit = this->limit(), gap = before.gap(LoadedNode<Elements>(set_, 0).bounds, limit);
    put(lane() == 0, 0u, gap, limit, scratch_.node, scratch_.node_gap, stacked_);
  }
  // Divides the nodes on top of the stack, one per thread: as many as fit with their children and the descent from one
  // node. If even that does not fit, one node descends alone.
  __device__ void open(const PartBefore& before) {
    if (stacked_ == kStackEntries) {
      is_open_ = true;
      return;
    }
    const std::uint32_t free = kStackEntries - stacked_, wide = free > kWayDown ? free - kWayDown : 1,
                        most = wide < 32 ? wide : 32, count = stacked_ < most ? stacked_ : most;
    const double limit = this->limit();
    std::uint32_t at = 0;
    const bool there = take(count, limit, scratch_.node, scratch_.node_gap, stacked_, at);
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
      put(has, element, gap, limit, scratch_.element, scratch_.element_gap, waiting_);
    }
    const bool divides = there && elements == 0;
    std::uint32_t near = at + 1, far = right;
    double near_gap = 0, far_gap = 0;
    if (divides) {
      const LoadedNode<Elements> one(set_, near), other(set_, far);
      near_gap = before.gap(one.bounds, limit);
      far_gap = before.gap(other.bounds, limit);
      if (far_gap < near_gap ||
          (far_gap == near_gap && before.between_middles(other.bounds) < before.between_middles(one.bounds))) {
        const std::uint32_t node = near;
        near = far;
        far = node;
        const double gap = near_gap;
        near_gap = far_gap;
        far_gap = gap;
      }
    }
    put(divides, far, far_gap, limit, scratch_.node, scratch_.node_gap, stacked_);
    put(divides, near, near_gap, limit, scratch_.node, scratch_.node_gap, stacked_);
    __syncwarp();
  }

  // Evaluates waiting elements, one per thread.
  __device__ void evaluate_waiting(std::uint32_t convex_part, const HullHead& head, PartBefore& before,
                                   PairAnswer& answer) {
    __syncwarp();
    const std::uint32_t count = waiting_ < 32 ? waiting_ : 32;
    waiting_ -= count;
    const double limit = this->limit();
    bool there = lane() < count;
    const std::uint32_t element = there ? scratch_.element[waiting_ + lane()] : 0;
    if (there) {
      // Includes the direction found since.
      const double known = fmax(static_cast<double>(scratch_.element_gap[waiting_ + lane()]),
                                before.gap(Elements::of_element(set_, element), limit));
      if (known > limit) {
        leave_out(known);
        there = false;
      }
    }
    __syncwarp();
    if (!__any_sync(~0u, there)) return;
    const ElementHull<Elements> hull(set_, element);
    const Part x = hull_part(c_.hulls, &head), e = hull.part();
    Vec3d along;
    if (evaluate(there, limit, elements_first_ ? e : x, elements_first_ ? x : e, {convex_part, element}, answer, along))
      before.look_along(elements_first_ ? along : before.turned(-along), x);
    if (overlaps_ && is_writer_) set_parts(convex_part, answer);
  }

  __device__ void set_parts(std::uint32_t convex_part, PairAnswer& answer) const {
    if (!q_.want_points) return;
    answer.part_a = elements_first_ ? 0 : convex_part;
    answer.part_b = elements_first_ ? convex_part : 0;
  }

  // Whether a convex part lies inside the solid, given that all triangles are farther than `apart`
  // (docs/trust/bounds_bodies.md, "Surfaces"). kNone if none does.
  __device__ PairOutcome look_within(double apart, PairAnswer& answer) {
    const PlacedFrame &outer = elements_first_ ? of_a_ : of_b_, &inner = elements_first_ ? of_b_ : of_a_;
    const Vec3d shift = inner.t_w - outer.t_w;
    for (std::uint32_t convex_part = 0; convex_part < parts_; ++convex_part) {
      const HullHead& head = c_.hulls.heads[c_.hulls.part_hull[first_part_ + convex_part]];
      if (PartBefore(set_, outer, head, inner).gap(LoadedNode<Elements>(set_, 0).bounds, 0) > 0) continue;
      if (!knows_side(apart, shift, set_.hull, head)) return PairOutcome::kUnresolved;
      // The whole part lies on one side, so if float64 is unsure of one of its points, another may decide.
      Winding winding{0, false};
      Vec3d turned{0, 0, 0};
      for (std::uint32_t i = 0; i < kWindingPoints && i < head.count && !winding.is_sure; ++i) {
        turned = inner.R_wb * hull_part(c_.hulls, &head).vertex(i * (head.count / kWindingPoints));
        winding = count_winding(set_, outer.R_wb.transpose_times(turned + shift), scratch_.node, kStackEntries);
      }
      if (!winding.is_sure) return PairOutcome::kUnresolved;
      if (winding.number == 0) continue;
      add_held(elements_first_, turned + shift, turned, apart, answer);
      set_parts(convex_part, answer);
      return PairOutcome::kConverged;
    }
    return PairOutcome::kNone;
  }
  __device__ void add_points(bool overlap, PairAnswer& answer) const {
    const HullHead& head = c_.hulls.heads[c_.hulls.part_hull[first_part_ + best_.one]];
    const ElementHull<Elements> hull(set_, best_.other);
    const Part x = hull_part(c_.hulls, &head), e = hull.part();
    add_points_of_best(elements_first_ ? e : x, elements_first_ ? x : e, overlap, answer);
    set_parts(best_.one, answer);
  }

  // Pointers into a SharedScratch. With these four the compiler spills fewer registers than with one reference.
  struct Lists {
    std::uint32_t *node, *element;
    float *node_gap, *element_gap;
  };
  const Lists scratch_;
  const bool elements_first_;
  const ElementSet& set_;
  std::uint32_t first_part_, parts_;
  std::uint32_t stacked_ = 0, waiting_ = 0;
};

}  // namespace clearance::cuda
