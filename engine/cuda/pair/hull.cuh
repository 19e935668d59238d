// A hull and a placed body, as one thread accesses them.
#pragma once

#include <cstddef>

#include "engine/device/layout.h"
#include "engine/hull/box.h"
#include "engine/hull/direction_table.h"
#include "engine/narrow/certify.h"

namespace clearance::cuda {

// Array in the block's shared memory, addressed by a 32-bit byte offset. The compiler then knows the address space.
template <class T>
struct Shared {
  std::uint32_t at;
  __device__ T& operator[](std::uint32_t i) const {
    extern __shared__ uint4 shared_memory[];
    return reinterpret_cast<T*>(reinterpret_cast<std::byte*>(shared_memory) + at)[i];
  }
};

// Vertices in float64 relative to the body's origin, or in float32 relative to the hull's centre, and the table's
// words: a block's copy in shared memory, or the scene's.
struct SharedVertices {
  using Scalar = double;
  using Words = Shared<std::uint16_t>;
  Shared<double2> xy;
  Shared<double> z;
  __device__ Vec3d operator[](std::uint32_t i) const {
    const double2 p = xy[i];
    return {p.x, p.y, z[i]};
  }
};
struct SceneVertices {
  using Scalar = double;
  using Words = const std::uint16_t*;
  const double *x, *y, *z;
  __device__ Vec3d operator[](std::uint32_t i) const { return {__ldg(x + i), __ldg(y + i), __ldg(z + i)}; }
};
struct SharedFloats {
  using Scalar = float;
  using Words = Shared<std::uint16_t>;
  Shared<float4> at;
  __device__ Vec3<float> operator[](std::uint32_t i) const {
    const float4 p = at[i];
    return {p.x, p.y, p.z};
  }
};
struct SceneFloats {
  using Scalar = float;
  using Words = const std::uint16_t*;
  const float4* at;
  __device__ Vec3<float> operator[](std::uint32_t i) const {
    const float4 p = __ldg(at + i);
    return {p.x, p.y, p.z};
  }
};

// 1 / x to within 2^-23 of its value, for x whose reciprocal float32 can represent.
__device__ inline float quick_reciprocal(float x) {
#ifdef __CUDA_ARCH__
  float r;
  asm("rcp.approx.ftz.f32 %0, %1;" : "=f"(r) : "f"(x));
  return r;
#else
  return 1 / x;
#endif
}

// A hull: its vertices, and its direction table if any.
template <class Vertices>
struct Hull {
  using T = typename Vertices::Scalar;
  Vertices vertices;
  typename Vertices::Words words;  // cells, then lists
  std::uint32_t lists, grid_bits, size;
  bool has_table;
  const HullHead* head;

  __device__ Hull(const Vertices& v, const typename Vertices::Words& w, const HullHead* h)
      : vertices(v),
        words(w),
        lists(h->cell_words),
        grid_bits(h->grid_bits),
        size(h->count),
        has_table(h->words > 0),
        head(h) {}
  __device__ Vec3<T> vertex(std::uint32_t i) const { return vertices[i]; }
  __device__ std::uint32_t count() const { return size; }
  __device__ const HullExtents& extents() const { return *head; }

  // The farthest vertex along n; ties go to the lowest index, as in support() of a `ConvexPart`.
  __device__ friend SupportPoint<T> support(const Hull& hull, const Vec3<T>& n) {
    const Vec3<float> f = cast<float>(n);
    if (!hull.has_table || !is_on_map(f)) return hull.scan(n);
    const std::uint32_t list = hull.list_along(f), candidates = hull.words[list];
    SupportPoint<T> best = hull.support_point(hull.words[list + 1], n);
#pragma unroll 1
    for (std::uint32_t k = 2; k <= candidates; ++k) take_farther(hull.support_point(hull.words[list + k], n), best);
    return best;
  }
  __device__ SupportPoint<T> support_point(std::uint32_t i, const Vec3<T>& n) const { return {i, dot(n, vertex(i))}; }
  __device__ static void take_farther(const SupportPoint<T>& p, SupportPoint<T>& best) {
    if (p.value > best.value) best = p;
  }
  // Whether float32 represents a direction accurately enough for the tables, which are blurred for it (float_blur()).
  // Other directions are rare and scan all vertices.
  __device__ static bool is_on_map(const Vec3<float>& n) {
    const float length = fabsf(n.x) + fabsf(n.y) + fabsf(n.z);
    return length > 1e-29f && length < 1e29f;
  }
  // Index of the first word of the list along a direction.
  __device__ std::uint32_t list_along(const Vec3<float>& n) const {
    const CellPoint at = cell_point(n, quick_reciprocal(fabsf(n.x) + fabsf(n.y) + fabsf(n.z)));
    return lists + find_list(words, grid_bits, at.u, at.v);
  }
  __device__ SupportPoint<T> scan(const Vec3<T>& n) const {
    SupportPoint<T> best{0, dot(n, vertex(0))};
#pragma unroll 4
    for (std::uint32_t i = 1; i < size; ++i) {
      const T s = dot(n, vertex(i));
      if (s > best.value) best = {i, s};
    }
    return best;
  }
};

// Farthest vertices of both hulls, along n_a and along the same direction in the axes of b, n_b, whose length is equal
// up to rounding. If both have tables, the lists are walked in step, so that loads of one hide the latency of the
// other. The shorter list repeats its last vertex, which changes nothing.
template <class Vertices, class T>
__device__ inline void find_farthest(const Hull<Vertices>& a, const Vec3<T>& n_a, SupportPoint<T>& in_a,
                                     const Hull<Vertices>& b, const Vec3<T>& n_b, SupportPoint<T>& in_b) {
  const Vec3<float> f = cast<float>(n_a);
  if (!a.has_table || !b.has_table || !a.is_on_map(f)) {
    in_a = support(a, n_a);
    in_b = support(b, n_b);
    return;
  }
  const std::uint32_t list_a = a.list_along(f), list_b = b.list_along(cast<float>(n_b));
  const std::uint32_t count_a = a.words[list_a], count_b = b.words[list_b],
                      most = count_a < count_b ? count_b : count_a;
  in_a = a.support_point(a.words[list_a + 1], n_a);
  in_b = b.support_point(b.words[list_b + 1], n_b);
#pragma unroll 1
  for (std::uint32_t k = 2; k <= most; ++k) {
    const SupportPoint<T> next_a = a.support_point(a.words[list_a + (k < count_a ? k : count_a)], n_a),
                          next_b = b.support_point(b.words[list_b + (k < count_b ? k : count_b)], n_b);
    a.take_farther(next_a, in_a);
    b.take_farther(next_b, in_b);
  }
}

__device__ inline std::uint32_t body_of(const BodiesView& bodies, std::uint32_t ref) {
  return ref & kMovedBit ? bodies.moved_body[ref & ~kMovedBit] : ref;
}
// A body's hull in the scene's arrays.
__device__ inline const HullHead* head_of(const ChunkView& c, std::uint32_t ref) {
  return c.hulls.heads + c.hulls.of_body[body_of(c.bodies, ref)];
}
__device__ inline Hull<SceneVertices> scene_hull(const HullsView& hulls, const HullHead* head) {
  return {{hulls.x + head->first, hulls.y + head->first, hulls.z + head->first}, hulls.words + head->first_word, head};
}
__device__ inline Hull<SceneFloats> scene_hull_f32(const HullsView& hulls, const HullHead* head) {
  return {{reinterpret_cast<const float4*>(hulls.f32) + head->first}, hulls.words + head->first_word, head};
}

// A hull in the scene's arrays, by 32-bit indices, for kernels with few registers: pointers take twice as many.
struct IndexedWords {
  const HullsView& hulls;
  std::uint32_t first;
  __device__ std::uint16_t operator[](std::uint32_t i) const { return __ldg(hulls.words + (first + i)); }
};
struct IndexedVertices {
  using Scalar = double;
  using Words = IndexedWords;
  const HullsView& hulls;
  std::uint32_t first;
  __device__ Vec3d operator[](std::uint32_t i) const {
    return {__ldg(hulls.x + (first + i)), __ldg(hulls.y + (first + i)), __ldg(hulls.z + (first + i))};
  }
};
__device__ inline Hull<IndexedVertices> indexed_hull(const HullsView& hulls, const HullHead* head) {
  return {{hulls, head->first}, {hulls, head->first_word}, head};
}

// Whether a body of the pair has several convex parts.
__device__ inline bool has_several(const HullsView& hulls, std::uint32_t body_a, std::uint32_t body_b) {
  return hulls.of_body[body_a] == kSeveral || hulls.of_body[body_b] == kSeveral;
}

// Rotation and origin of a placed body.
struct PlacedFrame {
  Mat3d R_wb;
  Vec3d t_w;
};

// Reference to a body's pose and state in one configuration.
struct BodyPoseRef {
  const double* components;
  std::size_t stride;
  std::uint8_t state;
  std::uint32_t body;

  __device__ BodyPoseRef(const BodiesView& bodies, std::uint32_t configurations, std::uint32_t ref, std::uint32_t k) {
    if (ref & kMovedBit) {
      const std::uint32_t slot = ref & ~kMovedBit;
      components = bodies.moved + std::size_t{slot} * bodies.components * configurations + k;
      stride = configurations;
      state = bodies.moved_state[std::size_t{slot} * configurations + k];
      body = bodies.moved_body[slot];
    } else {
      components = bodies.fixed + ref;
      stride = bodies.bodies;
      state = bodies.fixed_state[ref];
      body = ref;
    }
  }
  __device__ Vec3d at(std::uint32_t c) const {
    return {components[c * stride], components[(c + 1) * stride], components[(c + 2) * stride]};
  }
  __device__ Mat3d rotation() const { return {{at(0), at(3), at(6)}}; }
  __device__ Vec3d translation() const { return at(9); }
  // Rotation and translation. If contiguous, they are loaded 16 bytes at a time.
  __device__ PlacedFrame frame() const {
    if (stride != 1) return {rotation(), translation()};
    const auto* const p = reinterpret_cast<const double2*>(components);
    const double2 c0 = p[0], c2 = p[1], c4 = p[2], c6 = p[3], c8 = p[4], c10 = p[5];
    return {{{{c0.x, c0.y, c2.x}, {c2.y, c4.x, c4.y}, {c6.x, c6.y, c8.x}}}, {c8.y, c10.x, c10.y}};
  }
  __device__ Aabb box() const { return {at(12), at(15)}; }
  __device__ Status status() const { return static_cast<Status>(state & kStateStatus); }
};

struct PairPoses {
  BodyPoseRef a, b;
};
__device__ inline PairPoses poses_of(const ChunkView& c, PairRef ref, std::uint32_t k) {
  return {{c.bodies, c.configurations, ref.a, k}, {c.bodies, c.configurations, ref.b, k}};
}

}  // namespace clearance::cuda
