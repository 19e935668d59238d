// Parts of two meshes on their way down both trees, and lower bounds on the distance between them.
#pragma once

#include "engine/cuda/mesh/element_parts.cuh"

namespace clearance::cuda {

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

}  // namespace clearance::cuda
