// A hull and a placed body as a thread sees them.
#pragma once

#include <cstddef>

#include "engine/device/layout.h"
#include "engine/hull/box.h"
#include "engine/hull/direction_table.h"
#include "engine/narrow/certify.h"

namespace clearance::cuda {

// Vertices in float64 from the body's origin, or in float32 from the hull's centre: a block's copy, or the scene's.
struct SharedVertices {
  using Scalar = double;
  const double2* xy;
  const double* z;
  __device__ Vec3d operator[](std::uint32_t i) const {
    const double2 p = xy[i];
    return {p.x, p.y, z[i]};
  }
};
struct SceneVertices {
  using Scalar = double;
  const double *x, *y, *z;
  __device__ Vec3d operator[](std::uint32_t i) const { return {__ldg(x + i), __ldg(y + i), __ldg(z + i)}; }
};
struct SharedFloats {
  using Scalar = float;
  const float4* at;
  __device__ Vec3<float> operator[](std::uint32_t i) const {
    const float4 p = at[i];
    return {p.x, p.y, p.z};
  }
};
struct SceneFloats {
  using Scalar = float;
  const float4* at;
  __device__ Vec3<float> operator[](std::uint32_t i) const {
    const float4 p = __ldg(at + i);
    return {p.x, p.y, p.z};
  }
};

// A hull: its vertices, and its direction table if it has one.
template <class Vertices>
struct Hull {
  using T = typename Vertices::Scalar;
  Vertices vertices;
  const std::uint16_t *cells, *lists;  // null: no table
  std::uint32_t grid_bits, size;
  const HullHead* head;

  __device__ Hull(const Vertices& v, const std::uint16_t* words, const HullHead* h)
      : vertices(v),
        cells(h->words > 0 ? words : nullptr),
        lists(words + h->cell_words),
        grid_bits(h->grid_bits),
        size(h->count),
        head(h) {}
  __device__ Vec3<T> vertex(std::uint32_t i) const { return vertices[i]; }
  __device__ std::uint32_t count() const { return size; }
  __device__ const HullExtents& extents() const { return *head; }

  // The farthest vertex along n, ties to the lowest index, as support() of a Piece.
  __device__ friend SupportPoint<T> support(const Hull& hull, const Vec3<T>& n) {
    if (!hull.cells) return hull.scan(n);
    const std::uint16_t* list = hull.lists + hull.list_along(n);
    const std::uint32_t candidates = list[0];
    SupportPoint<T> best = hull.look_at(list[1], n);
    for (std::uint32_t k = 2; k <= candidates; ++k) take_farther(hull.look_at(list[k], n), best);
    return best;
  }
  __device__ SupportPoint<T> look_at(std::uint32_t i, const Vec3<T>& n) const { return {i, dot(n, vertex(i))}; }
  __device__ static void take_farther(const SupportPoint<T>& p, SupportPoint<T>& best) {
    if (p.value > best.value) best = p;
  }
  // The tables are blurred (float_blur()), so that float32 finds a list where it can hold the direction.
  __device__ std::uint32_t list_along(const Vec3<T>& n) const {
    const Vec3<float> f = cast<float>(n);
    const float length = fabsf(f.x) + fabsf(f.y) + fabsf(f.z);
    if (length > 1e-30f && length < 1e30f) {
      const MapPoint<float> at = map_point(f);
      return find_list(cells, grid_bits, at.u, at.v);
    }
    const MapPoint<double> at = map_point(cast<double>(n));
    return find_list(cells, grid_bits, at.u, at.v);
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

// Both hulls' farthest vertices. Where both have tables the lists are walked side by side, so that one's loads fill the
// other's waits; who has the shorter list looks at its last vertex again, which changes nothing.
template <class Vertices, class T>
__device__ inline void find_farthest(const Hull<Vertices>& a, const Vec3<T>& n_a, SupportPoint<T>& in_a,
                                     const Hull<Vertices>& b, const Vec3<T>& n_b, SupportPoint<T>& in_b) {
  if (!a.cells || !b.cells) {
    in_a = support(a, n_a);
    in_b = support(b, n_b);
    return;
  }
  const std::uint16_t *list_a = a.lists + a.list_along(n_a), *list_b = b.lists + b.list_along(n_b);
  const std::uint32_t count_a = list_a[0], count_b = list_b[0], most = count_a < count_b ? count_b : count_a;
  in_a = a.look_at(list_a[1], n_a);
  in_b = b.look_at(list_b[1], n_b);
  for (std::uint32_t k = 2; k <= most; ++k) {
    const SupportPoint<T> next_a = a.look_at(list_a[k < count_a ? k : count_a], n_a),
                          next_b = b.look_at(list_b[k < count_b ? k : count_b], n_b);
    a.take_farther(next_a, in_a);
    b.take_farther(next_b, in_b);
  }
}

__device__ inline std::uint32_t body_of(const BodiesView& bodies, std::uint32_t ref) {
  return ref & kMovedBit ? bodies.moved_body[ref & ~kMovedBit] : ref;
}
// A body's hull where the scene has it.
__device__ inline const HullHead* head_of(const ChunkView& c, std::uint32_t ref) {
  return c.hulls.heads + c.hulls.of_body[body_of(c.bodies, ref)];
}
__device__ inline Hull<SceneVertices> scene_hull(const HullsView& hulls, const HullHead* head) {
  return {{hulls.x + head->first, hulls.y + head->first, hulls.z + head->first}, hulls.words + head->first_word, head};
}
__device__ inline Hull<SceneFloats> scene_hull_f32(const HullsView& hulls, const HullHead* head) {
  return {{reinterpret_cast<const float4*>(hulls.f32) + head->first}, hulls.words + head->first_word, head};
}

// Whether a body of a pair has several pieces.
__device__ inline bool has_several(const HullsView& hulls, std::uint32_t body_a, std::uint32_t body_b) {
  return hulls.of_body[body_a] == kSeveral || hulls.of_body[body_b] == kSeveral;
}

// A body where this thread finds it.
struct Where {
  const double* components;
  std::size_t stride;
  std::uint8_t state;
  std::uint32_t body;

  __device__ Where(const BodiesView& bodies, std::uint32_t configurations, std::uint32_t ref, std::uint32_t k) {
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
  __device__ Aabb box() const { return {at(12), at(15)}; }
  __device__ Status status() const { return static_cast<Status>(state & kStateStatus); }
};

}  // namespace clearance::cuda
