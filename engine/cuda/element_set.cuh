// Elements (points, voxels, triangles) as a thread finds them in device memory: what a node or an element lies within,
// and an element as a hull for GJK.
#pragma once

#include "engine/cuda/pair_kernel.cuh"
#include "engine/hull/measure.h"

namespace clearance::cuda {

// A piece of a body, or an element.
struct PartVertices {
  using Scalar = double;
  using Words = const std::uint16_t*;
  const double *x, *y, *z;  // null: a point or a voxel
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

__device__ inline Vec3d absolute(const Vec3d& v) {
  return {fabs(v.x), fabs(v.y), fabs(v.z)};
}

struct ElementBox {
  Vec3d centre, half;
  // How far it reaches along n.
  __device__ double reach(const Vec3d& n) const { return dot(n, centre) + dot(absolute(n), half); }
};
// What a node or an element lies within: a box and, of triangles, two planes. Metres, the body's axes.
struct ElementBulk : ElementBox {
  Vec3d normal{0, 0, 0};     // no longer than 1 + 2^-14; 0: there are no planes
  double low = 0, high = 0;  // of normal . x
  PartVertices corners{};    // of a triangle, whose hull it is; else x is null
  __device__ bool has_planes() const { return squared_norm(normal) > 0; }
  // Of a node by its box, or by its planes and what is left of n along its box.
  __device__ double reach(const Vec3d& n) const {
    if (corners.x) return fmax(fmax(dot(n, corners[0]), dot(n, corners[1])), dot(n, corners[2]));
    const double by_box = ElementBox::reach(n);
    if (!has_planes()) return by_box;
    const double along = dot(n, normal);
    return fmin(by_box, ElementBox::reach(n - along * normal) + along * (along > 0 ? high : low));
  }
};

__device__ inline PartVertices triangle_corners(const ElementSet& set, std::uint32_t i) {
  const double* const p = set.corners + std::size_t{i} * 9;
  return {p, p + 3, p + 6, {0, 0, 0}, 0};
}
__device__ inline ElementBulk bulk_of_triangle(const PartVertices& corners) {
  const Vec3d u = corners[0], v = corners[1], w = corners[2];
  ElementBulk bulk;
  bulk.corners = corners;
  for (int k = 0; k < 3; ++k) {
    const double low = fmin(fmin(u[k], v[k]), w[k]), high = fmax(fmax(u[k], v[k]), w[k]);
    bulk.centre[k] = 0.5 * low + 0.5 * high;
    bulk.half[k] = 0.5 * high - 0.5 * low;
  }
  const Vec3d across = cross(v - u, w - u);
  const double length = norm(across);
  if (!(length > 1e-140 && length < __builtin_inf())) return bulk;
  bulk.normal = across * (1 / length);
  const double at_u = dot(bulk.normal, u), at_v = dot(bulk.normal, v), at_w = dot(bulk.normal, w);
  bulk.low = fmin(fmin(at_u, at_v), at_w);
  bulk.high = fmax(fmax(at_u, at_v), at_w);
  return bulk;
}
__device__ inline ElementBulk bulk_of_element(const ElementSet& set, std::uint32_t i) {
  if (set.is_mesh()) return bulk_of_triangle(triangle_corners(set, i));
  const float* const p = set.points + std::size_t{i} * 3;
  return {{{__ldg(p), __ldg(p + 1), __ldg(p + 2)}, {set.reach, set.reach, set.reach}}};
}

// An element as a hull. Its part() is of use as long as this is there.
class ElementHull {
 public:
  __device__ ElementHull(const ElementSet& set, std::uint32_t i) {
    head_.radius = set.hull.radius;
    if (set.is_mesh()) {
      corners_ = triangle_corners(set, i);
      head_.count = 3;
      measure_hull(3u, [&](std::uint32_t k) { return corners_[k]; }, head_);
      return;
    }
    constexpr double kRoot3 = 1.7320508075688774, kMore = 1 + 0x1p-50;
    const Vec3d middle = bulk_of_element(set, i).centre;
    corners_ = {nullptr, nullptr, nullptr, middle, set.half};
    head_.count = set.half > 0 ? 8 : 1;
    head_.centre = middle;
    head_.half = {set.reach, set.reach, set.reach};
    head_.spread = kRoot3 * set.reach * kMore;
    head_.rho = (norm(middle) + head_.spread) * kMore;
  }
  ElementHull(const ElementHull&) = delete;
  __device__ Part part() const { return {corners_, nullptr, &head_}; }

 private:
  HullHead head_{};
  PartVertices corners_{};
};

// A node of the tree, its box as seen from the tree's centre.
struct LoadedBox {
  Vec3d low, high;
  std::uint32_t right, few;
  __device__ LoadedBox(const ElementSet& set, std::uint32_t at) {
    const auto* const halves = reinterpret_cast<const float4*>(set.nodes + at);
    const float4 p = __ldg(halves), q = __ldg(halves + 1);
    low = {p.x, p.y, p.z};
    high = {p.w, q.x, q.y};
    right = __float_as_uint(q.z);
    few = __float_as_uint(q.w);
  }
  __device__ bool is_leaf() const { return right == 0; }
  __device__ std::uint32_t begin() const { return few / 4; }
  __device__ std::uint32_t count() const { return few % 4 + 1; }
};
struct LoadedNode : LoadedBox {
  ElementBulk bulk;
  __device__ LoadedNode(const ElementSet& set, std::uint32_t at) : LoadedBox(set, at) {
    bulk = {{set.centre + (0.5 * low + 0.5 * high), 0.5 * high - 0.5 * low}};
    if (!set.is_mesh()) return;
    const ElementSlab slab = set.slabs[at];
    bulk.normal = slab.normal();
    const double middle = dot(bulk.normal, set.centre);
    bulk.low = middle + slab.low;
    bulk.high = middle + slab.high;
  }
};

}  // namespace clearance::cuda
