// Search of a warp for the nearest triangles of two meshes.
//
// As in element_search.cuh, but a stack entry is a part of one mesh and a part of the other, each a subtree or a
// triangle; the larger subtree is divided. Triangle pairs wait until there are 32, then each thread evaluates one by
// GJK. If no triangles touch, a corner of each connected part of a mesh decides whether that part lies inside the other
// mesh, if that is a solid.
#pragma once

#include "engine/cuda/mesh/element_winding.cuh"
#include "engine/cuda/mesh/mesh_parts.cuh"
#include "engine/cuda/mesh/warp_search.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kMeshStackEntries = 512, kWaitingTriangles = 32 + 32 * 4;
// A descent of two parts adds an entry per level of both trees, and some for a leaf's triangles.
inline constexpr std::uint32_t kMeshWayDown = 2 * 32 + 4;
inline constexpr std::uint32_t kMostWindings = 64;  // per pair; if more are needed, the CPU answers it

// A pair of meshes. All threads of a warp search for the nearest triangles.
class MeshSearch : public WarpSearch {
 public:
  // Waiting pairs of parts and of triangles of one warp's search, each with its gap. In shared memory.
  struct SharedScratch {
    union {
      MeshParts parts[kMeshStackEntries];
      std::uint32_t nodes[kMeshStackEntries];  // used after the search, to count triangles along a ray
    };
    MeshParts triangles[kWaitingTriangles];
    float gap[kMeshStackEntries], triangle_gap[kWaitingTriangles];
  };

  __device__ MeshSearch(const ReducedView& r, const PairLimits& q, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                        const Slack& slack, double cut_off, double stop_below, SharedScratch& scratch)
      : WarpSearch(r, q, at_a, at_b, slack, cut_off, stop_below),
        scratch_(scratch),
        a_(r.elements.sets[r.elements.of_body[at_a.body]]),
        b_(r.elements.sets[r.elements.of_body[at_b.body]]),
        before_(a_, b_, at_) {}

  // If kConverged, the thread with has_answer() holds the answer.
  // \param answer has the pair's flags
  __device__ PairOutcome run(PairAnswer& answer) {
    const double limit = this->limit();
    put(lane() == 0, MeshParts{0, 0}, before_.gap({0, 0}, limit), limit, scratch_.parts, scratch_.gap, stacked_);
    while ((stacked_ > 0 || waiting_ > 0) && !is_over()) {
      if (stacked_ > 0 && waiting_ < 32)
        open();
      else
        evaluate_waiting(answer);
    }
    leave_out_all(scratch_.gap, stacked_);
    leave_out_all(scratch_.triangle_gap, waiting_);
    __syncwarp();
    if (is_open_) return PairOutcome::kUnresolved;
    if (overlaps_) return PairOutcome::kConverged;
    const double lower = least_of_warp(lower_);
    if (lower > 0 && (a_.is_solid || b_.is_solid)) {
      const PairOutcome held = look_within(lower, answer);
      if (held != PairOutcome::kNone) return held;
    }
    return decide_by_bounds(lower, answer, [&](bool overlap) {
      const ElementHull<Triangles> a(a_, best_.one), b(b_, best_.other);
      add_points_of_best(a.part(), b.part(), overlap, answer);
    });
  }

 private:
  // Divides pairs on top of the stack, one per thread: as many as fit with their children and the descent of one pair.
  // If even that does not fit, one pair descends alone.
  __device__ void open() {
    const std::uint32_t free = kMeshStackEntries - stacked_;
    if (free < 3) {  // a leaf's four triangles replace it
      is_open_ = true;
      return;
    }
    const std::uint32_t wide = free > kMeshWayDown + 3 ? (free - kMeshWayDown) / 3 : 1, most = wide < 32 ? wide : 32,
                        count = stacked_ < most ? stacked_ : most;
    const double limit = this->limit();
    MeshParts whole{0, 0};
    const bool there = take(count, limit, scratch_.parts, scratch_.gap, stacked_, whole);
    Division division;
    if (there) division = before_.divided(whole);
    // The nearer of two nodes goes on top.
    const bool are_nodes = division.is_into_nodes();
    MeshParts near{0, 0};
    double near_gap = 0, near_middles = 0;
    for (std::uint32_t i = 0; __any_sync(~0u, i < division.count()); ++i) {
      const bool has = i < division.count();
      MeshParts parts = division[i];
      double gap = 0, middles = 0;
      if (has) gap = before_.gap(parts, limit, middles);
      const bool is_kept = has && are_nodes && i == 0;
      if (is_kept || (has && are_nodes && (gap < near_gap || (gap == near_gap && middles < near_middles)))) {
        const MeshParts other = near;
        const double other_gap = near_gap;
        near = parts;
        near_gap = gap;
        near_middles = middles;
        parts = other;
        gap = other_gap;
      }
      const bool is_ready = has && !is_kept, are_triangles = parts.are_triangles();
      put(is_ready && are_triangles, parts, gap, limit, scratch_.triangles, scratch_.triangle_gap, waiting_);
      put(is_ready && !are_triangles, parts, gap, limit, scratch_.parts, scratch_.gap, stacked_);
    }
    put(are_nodes, near, near_gap, limit, scratch_.parts, scratch_.gap, stacked_);
    __syncwarp();
  }

  // Evaluates waiting triangle pairs, one per thread.
  __device__ void evaluate_waiting(PairAnswer& answer) {
    __syncwarp();
    const std::uint32_t count = waiting_ < 32 ? waiting_ : 32;
    waiting_ -= count;
    const double limit = this->limit();
    bool there = lane() < count;
    const MeshParts parts = there ? scratch_.triangles[waiting_ + lane()] : MeshParts{kIsTriangle, kIsTriangle};
    if (there) {
      // Includes the direction found since.
      const double known =
          fmax(static_cast<double>(scratch_.triangle_gap[waiting_ + lane()]), before_.gap(parts, limit));
      if (known > limit) {
        leave_out(known);
        there = false;
      }
    }
    __syncwarp();
    if (!__any_sync(~0u, there)) return;
    const std::uint32_t i = parts.a & ~kIsTriangle, j = parts.b & ~kIsTriangle;
    const ElementHull<Triangles> a(a_, i), b(b_, j);
    Vec3d along;
    if (evaluate(there, limit, a.part(), b.part(), {i, j}, answer, along)) before_.look_along(along);
  }

  // Whether a mesh contains a part of the other, given that all triangles are farther than `apart`. kNone if neither
  // does.
  __device__ PairOutcome look_within(double apart, PairAnswer& answer) {
    if (before_.gap({0, 0}, 0) > 0) return PairOutcome::kNone;
    if (!knows_side(apart, of_b_.t_w - of_a_.t_w, a_.hull, b_.hull)) return PairOutcome::kUnresolved;
    const PairOutcome by_a = a_.is_solid ? look_within(true, apart, answer) : PairOutcome::kNone;
    if (by_a == PairOutcome::kConverged || !b_.is_solid) return by_a;
    const PairOutcome by_b = look_within(false, apart, answer);
    return by_b == PairOutcome::kNone ? by_a : by_b;
  }
  // \param a_holds whether a may contain parts of b, else b parts of a
  __device__ PairOutcome look_within(bool a_holds, double apart, PairAnswer& answer) {
    const ElementSet &solid = a_holds ? a_ : b_, &other = a_holds ? b_ : a_;
    const PlacedFrame &outer = a_holds ? of_a_ : of_b_, &inner = a_holds ? of_b_ : of_a_;
    const Vec3d shift = inner.t_w - outer.t_w;
    std::uint32_t windings = 0;
    bool all_are_known = true;
    for (std::uint32_t first = 0; first < other.part_count; first += 32) {
      const std::uint32_t part = first + lane(), triangle = part < other.part_count ? other.parts[part] : 0;
      // Boxes prove that most parts are outside.
      const MeshParts parts = a_holds ? MeshParts{0, kIsTriangle | triangle} : MeshParts{kIsTriangle | triangle, 0};
      const bool may_be_within = part < other.part_count && !(before_.gap(parts, 0) > 0);
      for (std::uint32_t left = __ballot_sync(~0u, may_be_within); left != 0; left &= left - 1) {
        if (++windings > kMostWindings) return PairOutcome::kUnresolved;
        const std::uint32_t at = __shfl_sync(~0u, triangle, static_cast<int>(first_of(left)));
        // The whole part lies on one side, so if float64 is unsure of one corner, another may decide.
        const PartVertices corners = Triangles::corners(other, at);
        Winding winding{0, false};
        Vec3d turned{0, 0, 0};
        for (std::uint32_t corner = 0; corner < 3 && !winding.is_sure; ++corner) {
          turned = inner.R_wb * corners[corner];
          winding = count_winding(solid, outer.R_wb.transpose_times(turned + shift), scratch_.nodes, kMeshStackEntries);
        }
        all_are_known = all_are_known && winding.is_sure;
        if (!winding.is_sure || winding.number == 0) continue;
        add_held(a_holds, turned + shift, turned, apart, answer);
        return PairOutcome::kConverged;
      }
    }
    return all_are_known ? PairOutcome::kNone : PairOutcome::kUnresolved;
  }

  SharedScratch& scratch_;
  const ElementSet &a_, &b_;
  MeshesBefore before_;
  std::uint32_t stacked_ = 0, waiting_ = 0;
};

}  // namespace clearance::cuda
