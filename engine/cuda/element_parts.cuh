// A cloud and one convex piece before each other: lower bounds on how far boxes of the cloud are from it, and both as
// hulls for GJK.
#pragma once

#include "engine/cuda/pair_kernel.cuh"

namespace clearance::cuda {

// Rounding units of a gap, and what is left of 1 over the length of a direction: as the CPU has them
// (engine/query/nearest_elements.cpp; docs/bounds.md, "Surfaces").
inline constexpr double kGapUnits = 256 * 0x1p-53, kShortUnit = 1 - 0x1p-45;

// A piece of a body, or an element.
struct PartVertices {
  using Scalar = double;
  using Words = const std::uint16_t*;
  const double *x, *y, *z;  // null: an element
  Vec3d middle;
  double half;  // of a voxel; 0: a point
  __device__ Vec3d operator[](std::uint32_t i) const {
    if (x) return {__ldg(x + i), __ldg(y + i), __ldg(z + i)};
    return {middle.x + (i & 1 ? half : -half), middle.y + (i & 2 ? half : -half), middle.z + (i & 4 ? half : -half)};
  }
};
using Part = Hull<PartVertices>;

__device__ inline Part piece_part(const HullsView& hulls, const HullHead* head) {
  return {{hulls.x + head->first, hulls.y + head->first, hulls.z + head->first, {0, 0, 0}, 0},
          hulls.words + head->first_word,
          head};
}
__device__ inline HullHead element_head(const ElementSet& set, const Vec3d& middle) {
  constexpr double kRoot3 = 1.7320508075688774, kMore = 1 + 0x1p-50;
  HullHead head{};
  head.centre = middle;
  head.half = {set.reach, set.reach, set.reach};
  head.spread = kRoot3 * set.reach * kMore;
  head.rho = (norm(middle) + head.spread) * kMore;
  head.radius = set.hull.radius;
  head.count = set.half > 0 ? 8 : 1;
  return head;
}
__device__ inline Part element_part(const ElementSet& set, const Vec3d& middle, const HullHead* head) {
  return {{nullptr, nullptr, nullptr, middle, set.half}, nullptr, head};
}

struct ElementBox {
  Vec3d centre, half;
};
__device__ inline ElementBox box_of_element(const ElementSet& set, std::uint32_t i) {
  const float* const p = set.points + std::size_t{i} * 3;
  return {{__ldg(p), __ldg(p + 1), __ldg(p + 2)}, {set.reach, set.reach, set.reach}};
}
struct LoadedNode {
  ElementBox box;
  std::uint32_t right, few;
  __device__ LoadedNode(const ElementSet& set, std::uint32_t at) {
    const auto* const halves = reinterpret_cast<const float4*>(set.nodes + at);
    const float4 p = __ldg(halves), q = __ldg(halves + 1);
    const Vec3d low{p.x, p.y, p.z}, high{p.w, q.x, q.y};
    box = {0.5 * low + 0.5 * high, 0.5 * high - 0.5 * low};
    right = __float_as_uint(q.z);
    few = __float_as_uint(q.w);
  }
  __device__ bool is_leaf() const { return right == 0; }
  __device__ std::uint32_t begin() const { return few / 4; }
  __device__ std::uint32_t count() const { return few % 4 + 1; }
};

__device__ inline Vec3d absolute(const Vec3d& v) {
  return {fabs(v.x), fabs(v.y), fabs(v.z)};
}
__device__ inline double above_zero(double x) {
  return x > 0 ? x : 0;
}

// The other body's piece as the cloud sees it, and lower bounds on how far from it are boxes of the cloud. Metres, the
// cloud's axes.
class PieceBefore {
 public:
  __device__ PieceBefore(const ElementSet& set, const PlacedFrame& cloud, const HullHead& piece,
                         const PlacedFrame& other)
      : R_(cloud.R_wb.transpose_times(other.R_wb)),
        D_(cloud.R_wb.transpose_times(other.t_w - cloud.t_w)),
        own_{piece.centre, piece.half},
        box_{R_ * piece.centre + D_, {0, 0, 0}} {
    for (int k = 0; k < 3; ++k) box_.half[k] = dot(absolute(R_.row[k]), piece.half);
    const double radii = set.hull.radius + piece.radius;
    margin_ =
        radii + (kGapUnits * (norm(D_) + set.hull.rho + piece.rho + radii) + Arithmetic<double>::kUnderflowLength);
  }

  // Not below 0. \param cut_off no more is asked than whether it is greater
  __device__ double gap(const ElementBox& x, double cut_off) const {
    const Vec3d d = box_.centre - x.centre;
    Vec3d apart;
    for (int k = 0; k < 3; ++k) apart[k] = above_zero(fabs(d[k]) - (x.half[k] + box_.half[k]));
    double gap = above_zero(norm(apart) - margin_);
    if (gap > cut_off) return gap;
    if (looks_) gap = fmax(gap, above_zero((from_ - reach(x, n_)) * kShortUnit - margin_));
    const double length = norm(d);
    if (gap > cut_off || !(length > 1e-140 && length < __builtin_inf())) return gap;
    const Vec3d n = d * (1 / length);
    const double far = reach(own_, R_.transpose_times(-n));
    return fmax(gap, above_zero(((dot(n, D_) - far) - reach(x, n)) * kShortUnit - margin_));
  }
  __device__ double between_middles(const ElementBox& x) const { return squared_norm(box_.centre - x.centre); }

  // From here on gaps along this direction count, too. \param n_c from the cloud towards the piece, of any length
  __device__ void look_along(const Vec3d& n_c, const Part& piece) {
    const double length = norm(n_c);
    if (!(length > 1e-140 && length < __builtin_inf())) return;
    n_ = n_c * (1 / length);
    from_ = dot(n_, D_) - support(piece, R_.transpose_times(-n_)).value;
    looks_ = true;
  }
  // Turns a direction of the piece's axes.
  __device__ Vec3d turned(const Vec3d& v) const { return R_ * v; }

 private:
  __device__ static double reach(const ElementBox& x, const Vec3d& n) {
    return dot(n, x.centre) + dot(absolute(n), x.half);
  }

  Mat3d R_;  // takes the piece's coordinates, with D_, to the cloud's
  Vec3d D_;
  ElementBox own_, box_;  // in its own axes, in the cloud's
  double margin_;         // what of a gap between cores is none between the grown elements, as computed
  bool looks_ = false;
  Vec3d n_{0, 0, 0};
  double from_ = 0;
};

}  // namespace clearance::cuda
