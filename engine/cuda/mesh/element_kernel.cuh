// Pairs of a cloud or mesh and another body, or of two meshes. A warp per pair descends the trees
// (engine/mesh_distance/nearest_elements.h is the CPU's traversal), and its threads evaluate the remaining elements by
// GJK in parallel.
#pragma once

#include "engine/cuda/mesh/element_search.cuh"
#include "engine/cuda/mesh/mesh_search.cuh"
#include "engine/cuda/pair/items.cuh"
#include "engine/cuda/place/place_body.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kElementThreads = 64, kElementBlocks = 8;  // on a multiprocessor
inline constexpr std::uint32_t kElementsAtOnce = 2;  // items that a warp claims from the list at a time
inline constexpr int kElementSeedSteps = 4;          // GJK steps for a bound that excludes other pairs

// Distance beyond which none of the item's groups needs the pair's exact bounds. Infinite without a cutoff.
__device__ inline double group_cut_off(const ReducedView& r, const Item& item) {
  double most = 0;
  for_groups(r, item, [&](std::size_t g) {
    const double cut = __longlong_as_double(static_cast<long long>(r.cutoff[g]));
    most = cut >= 0 ? fmax(most, cut) : __builtin_inf();  // all bits set, a NaN
  });
  return most;
}

// Kinds of pairs that a warp evaluates. Kernels are compiled per kind.
template <class Elements_>
struct ElementsAndHull {
  using Elements = Elements_;
  using Search = HullSearch<Elements>;
  static constexpr std::uint32_t kTaken = Elements::kTaken;
  static constexpr PairKind kKind = Elements::kIsMesh ? PairKind::kMeshAndHull : PairKind::kPointsAndHull;
  __device__ static double upper_bound(const ReducedView& r, const Item& item, const BodyPoseRef& at_a,
                                       const BodyPoseRef& at_b);
};
struct Meshes {
  using Search = MeshSearch;
  static constexpr std::uint32_t kTaken = kMeshesTaken;
  static constexpr PairKind kKind = PairKind::kMeshes;
  __device__ static double upper_bound(const ReducedView& r, const Item& item, const BodyPoseRef& at_a,
                                       const BodyPoseRef& at_b);
};

// Answers an item with elements. All threads of the warp call it, and one of them gets the answer.
template <bool kAny, class Search>
__device__ inline PairOutcome answer_elements(const ReducedView& r, const Item& item,
                                              typename Search::SharedScratch& scratch, PairAnswer& answer,
                                              bool& is_mine) {
  const ChunkView& c = r.chunk;
  const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
  PairLimits q = c.pair_limits;
  if (kAny) q.max_distance = margin_of(r, item.p);
  is_mine = threadIdx.x % 32 == 0;
  if (answer_without_parts(q, at_a, at_b, answer)) return PairOutcome::kWithoutParts;
  if (!q.prove_overlaps) return PairOutcome::kUnresolved;
  const Slack slack = slack_of_pair(c, item.ref, item.k);
  double most = q.max_distance, stop_below = -__builtin_inf();
  if (kAny)
    stop_below = slack.near_enough(q.max_distance);
  else if (r.reduce != Reduce::kWithin)
    most = fmin(most, group_cut_off(r, item));
  Search search(r, q, at_a, at_b, slack, slack.cut_off(most), stop_below, scratch);
  const PairOutcome outcome = search.run(answer);
  if (outcome != PairOutcome::kConverged) return outcome;
  is_mine = search.has_answer();
  // Undecided if proved neither beyond its margin nor within it.
  const bool is_decided = !kAny || answer.upper <= q.max_distance || answer.status == Status::kBeyond;
  return __all_sync(~0u, !is_mine || is_decided) ? PairOutcome::kConverged : PairOutcome::kUnresolved;
}

// Evaluates the candidates of one kind. Unresolved pairs go to the common list.
template <bool kAny, class Kind>
__global__ void __launch_bounds__(kElementThreads) evaluate_elements(const __grid_constant__ ReducedView r) {
  constexpr std::uint32_t kWarps = kElementThreads / 32;
  __shared__ typename Kind::Search::SharedScratch scratches[kWarps];
  typename Kind::Search::SharedScratch& scratch = scratches[threadIdx.x / 32];
  const std::uint32_t count = item_count(r), lane = threadIdx.x % 32;
  for (;;) {
    std::uint32_t first = 0;
    if (lane == 0) first = atomicAdd(r.chunk.counts + Kind::kTaken, kElementsAtOnce);
    first = __shfl_sync(~0u, first, 0);
    if (first >= count) break;
    for (std::uint32_t i = first; i < count && i < first + kElementsAtOnce; ++i) {
      const Item item = listed_item(r, i);
      if (kind_of(r, item) != Kind::kKind) continue;
      PairAnswer answer;
      bool is_mine = lane == 0;
      PairOutcome outcome = PairOutcome::kNone;
      if (!kAny || !__any_sync(~0u, is_decided_before(r, item))) {
        outcome = answer_elements<kAny, typename Kind::Search>(r, item, scratch, answer, is_mine);
        if (is_mine && (outcome == PairOutcome::kConverged || outcome == PairOutcome::kWithoutParts)) {
          const auto [at_a, at_b] = poses_of(r.chunk, item.ref, item.k);
          r.answers[i] = answer;
          if constexpr (kAny)
            offer_to_decision(r, item, i, answer);
          else
            offer(r, item, i, answer, at_a, at_b);
        }
      }
      if constexpr (kAny) {
        if (outcome == PairOutcome::kUnresolved && lane == 0) list_unresolved(r, i);
        add_count(r.chunk.counts + kConvergedRows, lane == 0 && outcome == PairOutcome::kConverged);
      } else {
        report_item(r, lane == 0 ? outcome : PairOutcome::kNone, i);
      }
    }
  }
}

// Upper bound on the pair's distance; if the boxes alone are beyond max_distance, a lower bound. As by cutoff_of().
template <class Kind>
__device__ inline double element_cutoff_of(const ReducedView& r, const Item& item) {
  const ChunkView& c = r.chunk;
  const auto [at_a, at_b] = poses_of(c, item.ref, item.k);
  const double gap = certify_box_gap(at_a.box(), at_b.box());
  if (gap > c.pair_limits.max_distance) return gap;
  return slack_of_pair(c, item.ref, item.k).true_upper(Kind::upper_bound(r, item, at_a, at_b));
}
// By a few GJK steps on two parts of the pair.
__device__ inline double upper_bound_of_parts(const ChunkView& c, const Part& a, const Part& b,
                                              const PairFrame<double>& at) {
  GjkRun<Part> run(c.pair_limits, a, b, at);
  for (int steps = 0; run.g.end == 0 && steps < kElementSeedSteps; ++steps) run.step();
  return upper_so_far(run);
}

// Uses the element at the end of a single descent of the tree, towards the first convex part of the other body.
template <class Elements>
__device__ inline double ElementsAndHull<Elements>::upper_bound(const ReducedView& r, const Item&,
                                                                const BodyPoseRef& at_a, const BodyPoseRef& at_b) {
  const ChunkView& c = r.chunk;
  const bool elements_first = r.elements.of_body[at_a.body] != kNone;
  const ElementSet& set = r.elements.sets[r.elements.of_body[elements_first ? at_a.body : at_b.body]];
  const HullHead* const head =
      c.hulls.heads + c.hulls.part_hull[c.hulls.part_begin[elements_first ? at_b.body : at_a.body]];
  const PartBefore before(set, elements_first ? at_a.frame() : at_b.frame(), *head,
                          elements_first ? at_b.frame() : at_a.frame());
  constexpr double kInf = __builtin_inf();
  std::uint32_t at = 0;
  for (;;) {
    const LoadedNode<Elements> node(set, at);
    if (node.is_leaf()) {
      at = node.begin();
      double least = kInf;
      for (std::uint32_t i = node.begin(); i < node.begin() + node.count(); ++i) {
        const double to_element = before.gap(Elements::of_element(set, i), kInf);
        if (!(to_element < least)) continue;
        least = to_element;
        at = i;
      }
      break;
    }
    const LoadedNode<Elements> one(set, at + 1), other(set, node.right);
    const double to_one = before.gap(one.bounds, kInf), to_other = before.gap(other.bounds, kInf);
    const bool is_one = to_one != to_other
                            ? to_one < to_other
                            : !(before.between_middles(other.bounds) < before.between_middles(one.bounds));
    at = is_one ? at + 1 : node.right;
  }
  const ElementHull<Elements> hull(set, at);
  const Part x = hull_part(c.hulls, head), e = hull.part();
  const Part& a = elements_first ? e : x;
  const Part& b = elements_first ? x : e;
  return upper_bound_of_parts(c, a, b, place_pair<double>(at_a, *a.head, at_b, *b.head));
}

// Uses the triangles at the end of a single descent of both trees.
__device__ inline double Meshes::upper_bound(const ReducedView& r, const Item&, const BodyPoseRef& at_a,
                                             const BodyPoseRef& at_b) {
  const ElementSet &a = r.elements.sets[r.elements.of_body[at_a.body]],
                   &b = r.elements.sets[r.elements.of_body[at_b.body]];
  const PlacedFrame of_a = at_a.frame(), of_b = at_b.frame();
  const auto at = pair_frame<double>(a.hull, of_a.R_wb, of_a.t_w, b.hull, of_b.R_wb, of_b.t_w);
  const MeshParts nearest = MeshesBefore(a, b, at).one_way_down();
  const ElementHull<Triangles> of_one(a, nearest.a & ~kIsTriangle), of_other(b, nearest.b & ~kIsTriangle);
  return upper_bound_of_parts(r.chunk, of_one.part(), of_other.part(), at);
}

// solve_seeds() for seeds of one pair kind.
template <class Kind>
__global__ void __launch_bounds__(kItemThreads) seed_elements(const __grid_constant__ ReducedView r) {
  cut_off_by_seed(
      r, [&](const Item& item) { return kind_of(r, item) == Kind::kKind; },
      [&](const Item& item) { return element_cutoff_of<Kind>(r, item); });
}

// Box of a placed body of elements, in metres, as the placing kernels compute it for hulls.
// \param inner of its slack
__device__ inline Aabb box_of_elements(const ElementSet& set, const BodyPoseRef& at, double inner) {
  const HullExtents& h = set.hull;
  return grown(certify_box(h.centre, h.half, h.spread, h.rho, h.radius, at.rotation(), at.translation()), inner);
}

// Boxes of fixed bodies at the snapshot's poses.
__global__ void __launch_bounds__(kItemThreads)
    box_elements(ElementsView elements, BodiesView bodies, double* boxes, OuterBox* outer_boxes) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x, n = bodies.bodies;
  if (i >= elements.count) return;
  const ElementSet& set = elements.sets[i];
  const BodyPoseRef at(bodies, 0, set.body, 0);
  if (at.status() != Status::kOk) return;
  const Aabb box =
      box_of_elements(set, at, bodies.uncertainties.fixed ? bodies.uncertainties.fixed[set.body].all.inner : 0);
  for (int k = 0; k < 3; ++k) {
    boxes[static_cast<std::size_t>(k) * n + set.body] = box.low[k];
    boxes[static_cast<std::size_t>(3 + k) * n + set.body] = box.high[k];
  }
  outer_boxes[set.body] = outer_box(box);
}

// Boxes of bodies moved by the query, after placing: one thread per moved body and configuration.
__global__ void __launch_bounds__(kItemThreads)
    box_moved_elements(ElementsView elements, BodiesView bodies, std::uint32_t configurations) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x, slot = i / configurations, k = i % configurations;
  if (slot >= bodies.moved_count) return;
  const std::uint32_t of = elements.of_body[bodies.moved_body[slot]];
  if (of == kNone) return;
  const BodyPoseRef at(bodies, configurations, slot | kMovedBit, k);
  if (at.status() != Status::kOk) return;
  const std::size_t here = std::size_t{slot} * configurations + k;
  const Aabb box = box_of_elements(elements.sets[of], at,
                                   bodies.uncertainties.fixed ? bodies.uncertainties.moved[here].all.inner : 0);
  double* const out = bodies.moved + std::size_t{slot} * bodies.components * configurations + k;
  for (std::uint32_t c = 0; c < 3; ++c) {
    out[std::size_t{kPoseComponents + c} * configurations] = box.low[static_cast<int>(c)];
    out[std::size_t{kPoseComponents + 3 + c} * configurations] = box.high[static_cast<int>(c)];
  }
  bodies.moved_box[here] = outer_box(box);
}

}  // namespace clearance::cuda
