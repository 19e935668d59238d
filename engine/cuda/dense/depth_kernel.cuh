// Depths of pairs whose simplex encloses the origin: the expanding polytope algorithm (engine/narrow/epa.h), one warp
// per pair, with the polytope in shared memory. The CPU answers the few pairs whose polytope does not fit and those
// that float64 cannot resolve.
#pragma once

#include "engine/cuda/pair/pair_kernel.cuh"
#include "engine/cuda/pair/warp_team.cuh"
#include "engine/narrow/epa.h"

namespace clearance::cuda {

// Limits of a polytope on the device. Its surface is a topological sphere, with at most two faces and three edges per
// vertex.
inline constexpr std::uint32_t kMostCorners = 44, kMostFaces = 2 * kMostCorners, kMostEdges = 3 * kMostCorners + 1,
                               kMostFan = 32;
// One warp per block, since the warps of a block end together. The number of blocks per multiprocessor fits both its
// shared memory and its registers.
inline constexpr std::uint32_t kDepthWarps = 1, kDepthThreads = 32 * kDepthWarps, kDepthBlocksOfOne = 20;

// Includes the pair: registers for the polytope are few, and spilled ones are slow.
struct PolytopeScratch {
  Hull<SceneVertices> a, b;
  PairFrame<double> at;
  CsoVertex<double> vertices[kMostCorners];
  CsoFace<double> faces[kMostFaces];
  double offsets[kMostFaces];
  FanFace<double> fan[kMostFan];
  OutlineEdge outline[kMostEdges];
  std::uint32_t seen[kMostEdges];
  std::uint32_t begins[kMostCorners];
  std::uint8_t is_seen[kMostFaces];
};
inline constexpr std::uint32_t kDepthBytes = kDepthWarps * sizeof(PolytopeScratch);

// A list in a warp's shared memory, whose length every thread holds. Before reading data written by another thread, a
// thread must synchronize.
template <class T>
class WarpList {
 public:
  __device__ explicit WarpList(T* scratch) : at_(scratch) {}
  __device__ std::size_t size() const { return size_; }
  __device__ T* data() { return at_; }
  __device__ const T* data() const { return at_; }
  __device__ T& operator[](std::size_t i) { return at_[i]; }
  __device__ const T& operator[](std::size_t i) const { return at_[i]; }
  __device__ void clear() { size_ = 0; }
  __device__ void resize(std::size_t size) { size_ = size; }
  __device__ void push_back(const T& x) {
    WarpTeam::sync();
    if (WarpTeam::rank() == 0) at_[size_] = x;
    ++size_;
  }
  __device__ void pop_back() { --size_; }
  __device__ void assign(const T* begin, const T* end) {
    WarpTeam::sync();
    size_ = end - begin;
    for (std::size_t i = 0; i < size_; ++i)
      if (WarpTeam::rank() == i) at_[i] = begin[i];
  }

 private:
  T* at_;
  std::size_t size_ = 0;
};

// GrowingPolytope in shared memory.
struct WarpPolytope {
  using Team = WarpTeam;
  static constexpr bool kGrows = false;
  WarpList<CsoVertex<double>> vertices;
  WarpList<CsoFace<double>> faces;
  WarpList<double> offsets;
  WarpList<std::uint8_t> is_seen;
  WarpList<std::uint32_t> seen, begins;
  WarpList<OutlineEdge> outline;
  WarpList<FanFace<double>> fan;

  __device__ explicit WarpPolytope(PolytopeScratch& scratch)
      : vertices(scratch.vertices),
        faces(scratch.faces),
        offsets(scratch.offsets),
        is_seen(scratch.is_seen),
        seen(scratch.seen),
        begins(scratch.begins),
        outline(scratch.outline),
        fan(scratch.fan) {}
  __device__ void reserve() {}
  __device__ bool reserve_fan(std::size_t count, std::size_t gone) {
    return count <= kMostFan && faces.size() + count - gone <= kMostFaces;
  }
};

// The farthest vertex along n in this thread's share of the candidates.
__device__ inline Ranked<double> farthest_of_share(const Hull<SceneVertices>& hull, const Vec3d& n) {
  const Vec3<float> f = cast<float>(n);
  const bool listed = hull.has_table && hull.is_on_map(f);
  const std::uint32_t list = listed ? hull.list_along(f) : 0, candidates = listed ? hull.words[list] : hull.count();
  Ranked<double> best{-__builtin_inf(), 0};
  for (std::uint32_t k = WarpTeam::rank(); k < candidates; k += WarpTeam::kSize) {
    const SupportPoint<double> p = hull.support_point(listed ? hull.words[list + 1 + k] : k, n);
    if (p.value > best.value) best = {p.value, p.index};
  }
  return best;
}
__device__ inline bool is_farther(const Ranked<double>& p, const Ranked<double>& q) {
  return p.value > q.value || (p.value == q.value && p.index < q.index);
}

// The Minkowski difference (CSO) of two hulls in the scene's arrays, for EPA.
struct SceneCso {
  const Hull<SceneVertices>&a, &b;
  const PairFrame<double>& at;

  __device__ CsoSupport<double> operator()(const Vec3d& v) const {
    const Ranked<double> of_a = farthest_of_share(a, -v), of_b = farthest_of_share(b, at.R.transpose_times(v));
    const Ranked<double> in_a = WarpTeam::best(of_a, is_farther), in_b = WarpTeam::best(of_b, is_farther);
    return {vertex(in_a.index, in_b.index), -dot(v, at.D) - (in_a.value + in_b.value)};
  }
  __device__ CsoVertex<double> vertex(std::uint32_t ia, std::uint32_t ib) const {
    return {at.cso_vertex(a.vertex(ia), b.vertex(ib)), ia, ib};
  }
};

// Vertices of a surface, by index.
struct SurfaceVertices {
  const CsoVertex<double>* at;
  __device__ const Vec3d& operator[](std::uint32_t i) const { return at[i].w; }
};

// Same steps as narrow_phase() for a pair whose simplex encloses the origin, if a depth is requested. All threads of a
// warp call it with the same pair, and each gets the answer. Returns false if the CPU has to answer. The scratch holds
// the pair.
__device__ __forceinline__ bool prove_depth(const PairLimits& q, const Enclosed& e, const BodyPoseRef& at_a,
                                            const BodyPoseRef& at_b, PolytopeScratch& scratch, PairAnswer& answer) {
  const Hull<SceneVertices>&a = scratch.a, &b = scratch.b;
  const PairFrame<double>& at = scratch.at;
  const double radius = a.head->radius + b.head->radius, scale = pair_scale(at.D, a.head->rho, b.head->rho, radius);
  const SceneCso cso{a, b, at};
  Simplex<double> seed;
  seed.size = 4;
  for (int i = 0; i < 4; ++i) seed.vertex[i] = cso.vertex(e.a[i], e.b[i]);

  Epa<double, WarpPolytope> epa{WarpPolytope(scratch)};
  EpaLimits limits = epa_limits<double>(q.abs_tol, q.rel_tol, radius > 0, scale);
  limits.max_vertices = kMostCorners;
  const EpaEnd end = epa.run(cso, limits, seed);
  if (end == EpaEnd::kLimit || end == EpaEnd::kFlat || !epa.probed()) return false;

  const double units_lower = RoundingUnits<double>::kLower, units_upper = RoundingUnits<double>::kUpper;
  const double lower = lower_from_gap(epa.gap(), norm(epa.direction()), radius, rounding_error(units_lower, scale));
  const auto faces = epa.faces();
  const ProvedBall<double, WarpTeam> proved(SurfaceVertices{epa.vertices().data()}, faces.data(), faces.size(), scale);
  const double ball = proved.ball - rounding_error(double(RoundingUnits<double>::kBall), scale);
  if (!proved || !(ball > 0)) return false;
  const double upper = upper_of_overlap(a.head->radius, b.head->radius, ball);
  if (!(lower <= upper) || !is_narrow(upper - lower, lower, q.abs_tol, q.rel_tol)) return false;
  const Mat3d R_wa = at_a.rotation();
  const auto vertex_a = [&](std::uint32_t i) { return a.vertex(i); };
  const auto vertex_b = [&](std::uint32_t i) { return b.vertex(i); };
  const CsoPoint<double> point(epa.nearest(), R_wa, vertex_a, at_b.rotation(), vertex_b);
  const double upper_error = rounding_error(units_upper, scale);
  // Rounding left the surface concave, which needs double-double.
  if (norm(point.w) - ball > tolerance_at(ball, q.abs_tol, q.rel_tol) + 2 * upper_error) return false;

  decide(limits_of(q), lower, upper, [&] { return rounding_width(scale); }, answer);
  if (q.want_nonsmooth) answer.flags |= kFlagNonsmooth;
  if (!q.want_points) return true;
  const Vec3d n = rescaled(epa.direction()), normal = (R_wa * n) * (1 / norm(n));
  answer.part_a = answer.part_b = 0;
  answer.point_a = point.core_a + normal * a.head->radius;
  answer.point_b = point.core_b - normal * b.head->radius;
  answer.normal = normal;
  return true;
}

__global__ void __launch_bounds__(kDepthThreads, kDepthBlocksOfOne) prove_depths(const __grid_constant__ ChunkView c) {
  extern __shared__ uint4 shared_memory[];
  const std::uint32_t warp = threadIdx.x / 32, count = c.counts[kEnclosedPairs];
  PolytopeScratch& scratch = reinterpret_cast<PolytopeScratch*>(shared_memory)[warp];
  for (std::uint32_t i = blockIdx.x * kDepthWarps + warp; i < count; i += gridDim.x * kDepthWarps) {
    const Enclosed e = c.enclosed[i];
    const GroupItem item(c, e.pair, e.configuration);
    if (threadIdx.x % 32 == 0) {
      const HullHead *head_a = head_of(c, item.ref.a), *head_b = head_of(c, item.ref.b);
      scratch.a = scene_hull(c.hulls, head_a);
      scratch.b = scene_hull(c.hulls, head_b);
      scratch.at = place_pair<double>(item.at_a, *head_a, item.at_b, *head_b);
    }
    __syncwarp();
    PairAnswer answer;
    answer.flags = flags_of(item.at_a, item.at_b);
    const bool proved = prove_depth(c.pair_limits, e, item.at_a, item.at_b, scratch, answer);
    __syncwarp();
    if (threadIdx.x % 32 != 0) continue;
    if (proved)
      write_answer(c, item.row, item.k, item.at_a, item.at_b, answer);
    else
      c.rest[atomicAdd(c.counts + kRest, 1)] = static_cast<std::uint32_t>(item.row);
    if (proved) atomicAdd(c.counts + kConvergedRows, 1);
  }
  hand_over_counts(c);
}

}  // namespace clearance::cuda
