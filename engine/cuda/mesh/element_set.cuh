// Elements (points, voxels, triangles) in device memory: bounds of a node or an element, and an element as a hull for
// GJK.
#pragma once

#include "engine/cuda/pair/pair_kernel.cuh"
#include "engine/device/reduced_layout.h"
#include "engine/hull/measure.h"

namespace clearance::cuda {

// Vertices of a body's convex part or of an element.
struct PartVertices {
  using Scalar = double;
  using Words = const std::uint16_t*;
  const double *x, *y, *z;  // null for a point or a voxel
  Vec3d middle;
  double half;  // of a voxel; 0 for a point
  __device__ Vec3d operator[](std::uint32_t i) const {
    if (x) return {__ldg(x + i), __ldg(y + i), __ldg(z + i)};
    return {middle.x + (i & 1 ? half : -half), middle.y + (i & 2 ? half : -half), middle.z + (i & 4 ? half : -half)};
  }
};
using Part = Hull<PartVertices>;

__device__ inline Part hull_part(const HullsView& hulls, const HullHead* head) {
  return {{hulls.x + head->first, hulls.y + head->first, hulls.z + head->first, {0, 0, 0}, 0},
          hulls.words + head->first_word,
          head};
}

__device__ inline Vec3d absolute(const Vec3d& v) {
  return {fabs(v.x), fabs(v.y), fabs(v.z)};
}

struct ElementBox {
  Vec3d centre, half;
  // Support value along n.
  __device__ double reach(const Vec3d& n) const { return dot(n, centre) + dot(absolute(n), half); }
};
// A node of the tree. Its box is relative to the tree's centre.
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
// Kinds of elements. Each defines the bounds of a node and of an element (metres, the body's axes) and the hull of an
// element. Kernels are compiled per kind, so that points do not pay for triangles.

struct Points {
  static constexpr std::uint32_t kTaken = kPointsTaken;
  static constexpr bool kIsMesh = false;
  using ElementBounds = ElementBox;

  __device__ static ElementBounds of_node(const ElementSet&, std::uint32_t, const LoadedBox& node) {
    return {0.5 * node.low + 0.5 * node.high, 0.5 * node.high - 0.5 * node.low};  // the tree's centre is the origin
  }
  __device__ static ElementBounds of_element(const ElementSet& set, std::uint32_t i) {
    const float* const p = set.points + std::size_t{i} * 3;
    return {{__ldg(p), __ldg(p + 1), __ldg(p + 2)}, {set.reach, set.reach, set.reach}};
  }
  __device__ static PartVertices as_hull(const ElementSet& set, std::uint32_t i, HullHead& head) {
    constexpr double kRoot3 = 1.7320508075688774, kMore = 1 + 0x1p-50;
    const Vec3d middle = of_element(set, i).centre;
    head.count = set.half > 0 ? 8 : 1;
    head.centre = middle;
    head.half = {set.reach, set.reach, set.reach};
    head.spread = kRoot3 * set.reach * kMore;
    head.rho = (norm(middle) + head.spread) * kMore;
    return {nullptr, nullptr, nullptr, middle, set.half};
  }
};

// A box and two planes.
struct TriangleBounds : ElementBox {
  Vec3d normal{0, 0, 0};     // length at most 1 + 2^-14; 0 without planes
  double low = 0, high = 0;  // range of normal . x
  PartVertices corners{};    // of a triangle, which is its own hull; x is null for nodes
  // Support value. For a node it is the lesser of two bounds: by its box, and by its planes plus the rest of n along
  // its box.
  __device__ double reach(const Vec3d& n) const {
    if (corners.x) return fmax(fmax(dot(n, corners[0]), dot(n, corners[1])), dot(n, corners[2]));
    const double along = dot(n, normal);
    return fmin(ElementBox::reach(n), ElementBox::reach(n - along * normal) + along * (along > 0 ? high : low));
  }
};
struct Triangles {
  static constexpr std::uint32_t kTaken = kTrianglesTaken;
  static constexpr bool kIsMesh = true;
  using ElementBounds = TriangleBounds;

  __device__ static PartVertices corners(const ElementSet& set, std::uint32_t i) {
    const double* const p = set.corners + std::size_t{i} * 9;
    return {p, p + 3, p + 6, {0, 0, 0}, 0};
  }
  __device__ static ElementBounds of_node(const ElementSet& set, std::uint32_t at, const LoadedBox& node) {
    ElementBounds bounds{{set.centre + (0.5 * node.low + 0.5 * node.high), 0.5 * node.high - 0.5 * node.low}};
    const ElementSlab slab = set.slabs[at];
    bounds.normal = slab.normal();
    const double middle = dot(bounds.normal, set.centre);
    bounds.low = middle + slab.low;
    bounds.high = middle + slab.high;
    return bounds;
  }
  __device__ static ElementBounds of_element(const ElementSet& set, std::uint32_t i) {
    ElementBounds bounds{};
    bounds.corners = corners(set, i);
    const Vec3d u = bounds.corners[0], v = bounds.corners[1], w = bounds.corners[2];
    for (int k = 0; k < 3; ++k) {
      const double low = fmin(fmin(u[k], v[k]), w[k]), high = fmax(fmax(u[k], v[k]), w[k]);
      bounds.centre[k] = 0.5 * low + 0.5 * high;
      bounds.half[k] = 0.5 * high - 0.5 * low;
    }
    const Vec3d across = cross(v - u, w - u);
    const double length = norm(across);
    if (!(length > 1e-140 && length < __builtin_inf())) return bounds;
    bounds.normal = across * (1 / length);
    const double at_u = dot(bounds.normal, u), at_v = dot(bounds.normal, v), at_w = dot(bounds.normal, w);
    bounds.low = fmin(fmin(at_u, at_v), at_w);
    bounds.high = fmax(fmax(at_u, at_v), at_w);
    return bounds;
  }
  __device__ static PartVertices as_hull(const ElementSet& set, std::uint32_t i, HullHead& head) {
    const PartVertices vertices = corners(set, i);
    head.count = 3;
    measure_hull(3u, [&](std::uint32_t k) { return vertices[k]; }, head);
    return vertices;
  }
};

// An element as a hull. part() refers to this object.
template <class Elements>
class ElementHull {
 public:
  __device__ ElementHull(const ElementSet& set, std::uint32_t i) : vertices_(Elements::as_hull(set, i, head_)) {
    head_.radius = set.hull.radius;
  }
  ElementHull(const ElementHull&) = delete;
  __device__ Part part() const { return {vertices_, nullptr, &head_}; }

 private:
  HullHead head_{};
  PartVertices vertices_;
};

template <class Elements>
struct LoadedNode : LoadedBox {
  typename Elements::ElementBounds bounds;
  __device__ LoadedNode(const ElementSet& set, std::uint32_t at)
      : LoadedBox(set, at), bounds(Elements::of_node(set, at, *this)) {}
};

}  // namespace clearance::cuda
