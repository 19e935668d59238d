// Search of a warp for the nearest triangles of two meshes.
//
// As in element_search.cuh, but a stack entry is a part of one mesh and a part of the other, each a subtree or a
// triangle; the larger subtree is divided. Triangle pairs wait until there are 32, then each thread evaluates one by
// GJK. If no triangles touch, a corner of each connected part of a mesh decides whether that part lies inside the other
// mesh, if that is a solid.
#pragma once

#include "engine/cuda/mesh/element_parts.cuh"
#include "engine/cuda/mesh/element_winding.cuh"
#include "engine/cuda/mesh/warp_search.cuh"

namespace clearance::cuda {

inline constexpr std::uint32_t kMeshStackEntries = 512, kWaitingTriangles = 32 + 32 * 4;
// A descent of two parts adds an entry per level of both trees, and some for a leaf's triangles.
inline constexpr std::uint32_t kMeshWayDown = 2 * 32 + 4;
inline constexpr std::uint32_t kMostWindings = 64;  // per pair; if more are needed, the CPU answers it

// A part of a mesh: a node's index, or a triangle's with this bit set.
inline constexpr std::uint32_t kIsTriangle = 1u << 31;
struct MeshParts {
  std::uint32_t a, b;
  __device__ bool are_triangles() const { return (a & b & kIsTriangle) != 0; }
};
__device__ inline TriangleBounds bounds_of_part(const ElementSet& set, std::uint32_t part) {
  if (part & kIsTriangle) return Triangles::of_element(set, part & ~kIsTriangle);
  return Triangles::of_node(set, part, LoadedBox(set, part));
}

// Children of two parts: one of the two divides into two nodes or up to four triangles, each paired with the other
// part.
class Division {
 public:
  Division() = default;  // without children
  // Divides the larger subtree; a leaf only if the other part is a leaf or a triangle.
  __device__ Division(const ElementSet& a, const ElementSet& b, const MeshParts& whole) : whole_(whole) {
    const bool has_triangle = ((whole.a | whole.b) & kIsTriangle) != 0;
    const LoadedBox of_a(a, whole.a & kIsTriangle ? 0 : whole.a), of_b(b, whole.b & kIsTriangle ? 0 : whole.b);
    if (has_triangle)
      of_a_ = (whole.b & kIsTriangle) != 0;
    else if (of_a.is_leaf() != of_b.is_leaf())
      of_a_ = of_b.is_leaf();
    else
      of_a_ = !(squared_norm(of_a.high - of_a.low) < squared_norm(of_b.high - of_b.low));
    const LoadedBox& node = of_a_ ? of_a : of_b;
    first_ = node.is_leaf() ? kIsTriangle | node.begin() : (of_a_ ? whole.a : whole.b) + 1;
    right_ = node.right;
    count_ = node.is_leaf() ? node.count() : 2;
  }
  __device__ std::uint32_t count() const { return count_; }
  __device__ bool is_into_nodes() const { return right_ != 0; }
  __device__ MeshParts operator[](std::uint32_t i) const {
    const std::uint32_t part = i > 0 && is_into_nodes() ? right_ : first_ + i;
    return of_a_ ? MeshParts{part, whole_.b} : MeshParts{whole_.a, part};
  }

 private:
  MeshParts whole_{0, 0};
  bool of_a_ = false;
  std::uint32_t first_ = 0, right_ = 0, count_ = 0;
};

// Lower bounds on the distance between parts of two meshes: metres, in the axes of a.
class MeshesBefore {
 public:
  __device__ MeshesBefore(const ElementSet& a, const ElementSet& b, const PairFrame<double>& at)
      : a_(a), b_(b), at_(at) {
    const double radii = a.hull.radius + b.hull.radius;
    margin_ =
        radii + (kGapUnits * (norm(at.D) + a.hull.rho + b.hull.rho + radii) + Arithmetic<double>::kUnderflowLength);
  }

  // Lower bound, at least 0.
  // \param cut_off the result may stop improving once it is greater
  // \param middles receives the squared distance of the centres
  __device__ double gap(const MeshParts& parts, double cut_off, double& middles) const {
    const TriangleBounds a = bounds_of_part(a_, parts.a), b = bounds_of_part(b_, parts.b);
    const Vec3d d = at_.R * b.centre + at_.D - a.centre;
    middles = squared_norm(d);
    Vec3d apart;
    for (int k = 0; k < 3; ++k) apart[k] = above_zero(fabs(d[k]) - (a.half[k] + dot(absolute(at_.R.row[k]), b.half)));
    double gap = above_zero(norm(apart) - margin_);
    if (gap > cut_off) return gap;
    if (looks_) gap = fmax(gap, along(n_, a, b));
    if (!(gap > cut_off)) {  // across the planes of one, on the side facing the other
      const bool is_ahead = !(dot(a.normal, d) < 0);
      const Vec3d n = is_ahead ? a.normal : -a.normal;
      gap = fmax(gap, across(n, is_ahead ? a.high : -a.low, b.reach(at_.R.transpose_times(-n))));
    }
    if (!(gap > cut_off)) {
      const Vec3d m = at_.R * b.normal;
      const bool is_ahead = !(dot(m, d) < 0);
      const Vec3d n = is_ahead ? m : -m;
      gap = fmax(gap, across(n, a.reach(n), is_ahead ? -b.low : b.high));
    }
    const double length = norm(d);
    if (gap > cut_off || !(length > 1e-140 && length < __builtin_inf())) return gap;
    return fmax(gap, along(d * (1 / length), a, b));
  }

  __device__ double gap(const MeshParts& parts, double cut_off) const {
    double middles;
    return gap(parts, cut_off, middles);
  }
  __device__ Division divided(const MeshParts& whole) const { return {a_, b_, whole}; }

  // The triangles at the end of a single descent of both trees, each time to the nearest child.
  __device__ MeshParts one_way_down() const {
    MeshParts at{0, 0};
    while (!at.are_triangles()) {
      const Division division = divided(at);
      double least = 0, least_middles = 0;
      for (std::uint32_t i = 0; i < division.count(); ++i) {
        double middles;
        const double gap = this->gap(division[i], __builtin_inf(), middles);
        if (i > 0 && !(gap < least || (gap == least && middles < least_middles))) continue;
        at = division[i];
        least = gap;
        least_middles = middles;
      }
    }
    return at;
  }

  // Adds a direction along which later gaps are measured.
  // \param n from a towards b, of any length
  __device__ void look_along(const Vec3d& n) {
    const double length = norm(n);
    if (!(length > 1e-140 && length < __builtin_inf())) return;
    n_ = n * (1 / length);
    looks_ = true;
  }

 private:
  // \param n of length 1, from a towards b
  __device__ double along(const Vec3d& n, const TriangleBounds& a, const TriangleBounds& b) const {
    return above_zero((dot(n, at_.D) - b.reach(at_.R.transpose_times(-n)) - a.reach(n)) * kShortUnit - margin_);
  }
  // \param n a plane's normal, or 0
  // \param far_a how far a reaches towards b
  // \param far_b how far b reaches towards a
  __device__ double across(const Vec3d& n, double far_a, double far_b) const {
    return above_zero((dot(n, at_.D) - far_b - far_a) * kShortNormal - margin_);
  }

  const ElementSet &a_, &b_;
  const PairFrame<double>& at_;
  double margin_;  // part of a computed core gap that may be no gap between the grown triangles
  bool looks_ = false;
  Vec3d n_{0, 0, 0};
};

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
    __syncwarp();
    stacked_ -= count;
    const double limit = this->limit();
    bool there = lane() < count;
    const MeshParts whole = there ? scratch_.parts[stacked_ + lane()] : MeshParts{0, 0};
    const double known = there ? scratch_.gap[stacked_ + lane()] : 0;
    __syncwarp();
    if (there && known > limit) {
      leave_out(known);
      there = false;
    }
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
