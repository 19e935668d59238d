// Lower bounds on the distance between parts of a set of elements and one convex part.
#pragma once

#include "engine/cuda/mesh/element_set.cuh"

namespace clearance::cuda {

// Rounding units of a gap, and lower bounds on 1 / length of a computed unit direction and of a plane's normal. Same
// values as on the CPU (engine/mesh_distance/nearest_elements.cpp, part_gaps.cpp; docs/trust/bounds_bodies.md,
// "Surfaces").
inline constexpr double kGapUnits = 256 * 0x1p-53, kShortUnit = 1 - 0x1p-45, kShortNormal = 1 - 0x1p-13;

__device__ inline double above_zero(double x) {
  return x > 0 ? x : 0;
}

// The other body's convex part in the frame of the set, with lower bounds on its distance from parts of the set.
// Metres, the set's axes.
class PartBefore {
 public:
  __device__ PartBefore(const ElementSet& set, const PlacedFrame& elements, const HullHead& part,
                        const PlacedFrame& other)
      : R_(elements.R_wb.transpose_times(other.R_wb)),
        D_(elements.R_wb.transpose_times(other.t_w - elements.t_w)),
        own_{part.centre, part.half},
        box_{R_ * part.centre + D_, {0, 0, 0}} {
    for (int k = 0; k < 3; ++k) box_.half[k] = dot(absolute(R_.row[k]), part.half);
    const double radii = set.hull.radius + part.radius;
    margin_ = radii + (kGapUnits * (norm(D_) + set.hull.rho + part.rho + radii) + Arithmetic<double>::kUnderflowLength);
  }

  // Lower bound, at least 0.
  // \param cut_off the result may stop improving once it is greater
  template <class ElementBounds>
  __device__ double gap(const ElementBounds& x, double cut_off) const {
    const Vec3d d = box_.centre - x.centre;
    Vec3d apart;
    for (int k = 0; k < 3; ++k) apart[k] = above_zero(fabs(d[k]) - (x.half[k] + box_.half[k]));
    double gap = above_zero(norm(apart) - margin_);
    if (gap > cut_off) return gap;
    if (looks_) gap = fmax(gap, above_zero((from_ - x.reach(n_)) * kShortUnit - margin_));
    if constexpr (requires { x.normal; })
      if (!(gap > cut_off)) gap = fmax(gap, gap_across(x, d));
    const double length = norm(d);
    if (gap > cut_off || !(length > 1e-140 && length < __builtin_inf())) return gap;
    const Vec3d n = d * (1 / length);
    return fmax(gap, above_zero((before(n) - x.reach(n)) * kShortUnit - margin_));
  }
  __device__ double between_middles(const ElementBox& x) const { return squared_norm(box_.centre - x.centre); }

  // Adds a direction along which later gaps are measured.
  // \param n_c from the set towards the convex part, of any length
  __device__ void look_along(const Vec3d& n_c, const Part& part) {
    const double length = norm(n_c);
    if (!(length > 1e-140 && length < __builtin_inf())) return;
    n_ = n_c * (1 / length);
    from_ = dot(n_, D_) - support(part, R_.transpose_times(-n_)).value;
    looks_ = true;
  }
  // Rotates a direction from the convex part's axes to the set's.
  __device__ Vec3d turned(const Vec3d& v) const { return R_ * v; }

 private:
  // Least coordinate of its box along n.
  __device__ double before(const Vec3d& n) const { return dot(n, D_) - own_.reach(R_.transpose_times(-n)); }
  // Gap across the planes of x, on the side facing the convex part; 0 without planes.
  __device__ double gap_across(const TriangleBounds& x, const Vec3d& d) const {
    const bool is_ahead = !(dot(x.normal, d) < 0);
    const double end = is_ahead ? x.high : -x.low;
    return above_zero((before(is_ahead ? x.normal : -x.normal) - end) * kShortNormal - margin_);
  }

  Mat3d R_;  // with D_, maps the convex part's coordinates to the set's
  Vec3d D_;
  ElementBox own_, box_;  // in its own axes, and in the set's
  double margin_;         // part of a computed core gap that may be no gap between the grown elements
  bool looks_ = false;
  Vec3d n_{0, 0, 0};
  double from_ = 0;
};

}  // namespace clearance::cuda
