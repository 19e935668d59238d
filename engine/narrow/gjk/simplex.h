// A simplex of up to four CSO vertices (gjk.h), and its point nearest to the origin, over a scalar or a SIMD pack T.
//
// Departure from GJK's authors: the nearest feature is chosen by comparing the distances of all features, not by signs
// of determinants, which pick wrong features on slivers in any precision.
#pragma once

#include "engine/base/arithmetic.h"
#include "engine/base/lane.h"
#include "engine/base/vec.h"

namespace clearance {

/// A vertex of the CSO: w = a - b for vertices `a`, `b` of the two convex parts.
template <class T>
struct CsoVertex {
  Vec3<T> w;
  typename Lane<T>::Index a, b;

  CLEARANCE_HD friend auto same(const CsoVertex& p, const CsoVertex& q) { return (p.a == q.a) & (p.b == q.b); }
};

template <class Mask, class T>
CLEARANCE_HD inline CsoVertex<T> select(const Mask& mask, const CsoVertex<T>& yes, const CsoVertex<T>& no) {
  return {select(mask, yes.w, no.w), select(mask, yes.a, no.a), select(mask, yes.b, no.b)};
}
template <class T>
#ifdef __CUDA_ARCH__
CLEARANCE_HD inline CsoVertex<T> select(bool mask, const CsoVertex<T>& yes, const CsoVertex<T>& no) {
  return {select(mask, yes.w, no.w), mask ? yes.a : no.a, mask ? yes.b : no.b};
}
#else
CLEARANCE_HD inline const CsoVertex<T>& select(bool mask, const CsoVertex<T>& yes, const CsoVertex<T>& no) {
  return mask ? yes : no;
}
#endif

/// Up to four CSO vertices; the weights are those of the point nearest to the origin.
template <class T>
struct Simplex {
  CsoVertex<T> vertex[4];
  T weight[4];
  typename Lane<T>::Count size{0};
};

/// Result of reduce_to_nearest(): the face, edge or vertex of a simplex that is nearest to the origin.
template <class T>
struct Nearest {
  Simplex<T> simplex;  ///< the vertices that carry the nearest point, the newest first
  Vec3<T> v;           ///< that point; along a face's normal if it lies on a face
  T squared_distance;
  typename Lane<T>::Mask encloses;  ///< the origin is inside the tetrahedron; no other member is set
};

/// The vertex, edge or face at the newest vertex of a simplex that is nearest to the origin.
template <class T>
struct NearestFeature {
  typename Lane<T>::Count which{
      0};  ///< 0 the vertex; 1, 2, 3 the edge to old vertex 0, 1, 2; 4, 5, 6 the face with 01, 12, 02
  T squared_distance;
  T first_weight{0}, second_weight{0};  ///< of the feature's old vertices, in that order
  T scale{0};                           ///< factor of the vector along the nearest point
  Vec3<T> normal;                       ///< of a face, not normalised
  typename Lane<T>::Mask encloses;      ///< the origin is inside the tetrahedron; the other members are not used
};

/// Compares the vertex itself, then edges from it, then faces at it: the valid one of least distance wins.
template <class T>
CLEARANCE_INLINE NearestFeature<T> nearest_feature(const Simplex<T>& old, const CsoVertex<T>& newest) {
  using Count = typename Lane<T>::Count;
  using Mask = typename Lane<T>::Mask;
  const T zero(0), one(1), flat(Arithmetic<T>::kFlatFace);
  const Vec3<T> q = -newest.w;
  NearestFeature<T> best;
  best.squared_distance = squared_norm(q);
  best.normal = q;

  Vec3<T> e[3], m[3];
  T g[3];
  CLEARANCE_UNROLL
  for (int i = 0; i < 3; ++i) {
    const Mask there = old.size > Count(i);
    if (!any(there)) {
#ifndef __CUDA_ARCH__  // a thread of a GPU reads none of them, and need not set them
      e[i] = m[i] = {zero, zero, zero};
      g[i] = zero;
#endif
      continue;
    }
    e[i] = old.vertex[i].w - newest.w;
    m[i] = cross(q, e[i]);
    g[i] = squared_norm(e[i]);
    const T p = dot(q, e[i]), r = one / g[i], d = squared_norm(m[i]) * r;
    const Mask nearer = there & (p > zero) & (p < g[i]) & (d < best.squared_distance);
    best.squared_distance = select(nearer, d, best.squared_distance);
    best.first_weight = select(nearer, p * r, best.first_weight);
    best.scale = select(nearer, r, best.scale);
    best.which = select(nearer, Count(i + 1), best.which);
  }
  Mask inside = old.size > Count(2);
  const auto face = [&](int i, int j, int code, const Vec3<T>& n, const T& x) {
    const T nn = squared_norm(n), u = dot(m[j], n), w = -dot(m[i], n), r = one / nn, d = x * x * r;
    const Mask nearer = (old.size > Count(j)) & (u > zero) & (w > zero) & (u + w < nn) & (nn > flat * g[i] * g[j]) &
                        (d < best.squared_distance);
    best.squared_distance = select(nearer, d, best.squared_distance);
    best.first_weight = select(nearer, u * r, best.first_weight);
    best.second_weight = select(nearer, w * r, best.second_weight);
    best.scale = select(nearer, -x * r, best.scale);
    best.normal = select(nearer, n, best.normal);
    best.which = select(nearer, Count(code), best.which);
  };
  if (any(old.size > Count(1))) {
    const Vec3<T> n01 = cross(e[0], e[1]);
    const T x01 = dot(q, n01);
    face(0, 1, 4, n01, x01);
    if (any(inside)) {
      const Vec3<T> n12 = cross(e[1], e[2]), n02 = cross(e[0], e[2]);
      const T x12 = dot(q, n12), x02 = dot(q, n02);
      face(1, 2, 5, n12, x12);
      face(0, 2, 6, n02, x02);
      // Inside the three planes at the newest vertex, then on the inner side of the face across from it.
      inside = inside & (x01 * dot(e[2], n01) > zero) & (x12 * dot(e[0], n12) > zero) & (x02 * dot(e[1], n02) > zero);
      if (any(inside)) {
        const Vec3<T> n = cross(e[1] - e[0], e[2] - e[0]);
        inside = inside & (dot(q - e[0], n) * -dot(e[0], n) > zero);
      }
    }
  }
  best.encloses = inside;
  return best;
}

/// The point nearest to the origin of the hull of `newest` and up to three older vertices. `newest` takes part in it
/// (the GJK invariant).
template <class T>
CLEARANCE_INLINE Nearest<T> reduce_to_nearest(const Simplex<T>& old, const CsoVertex<T>& newest) {
  using Count = typename Lane<T>::Count;
  using Mask = typename Lane<T>::Mask;
  const T zero(0), one(1);
  const NearestFeature<T> best = nearest_feature(old, newest);
  Nearest<T> r;
  r.encloses = best.encloses;
  const Mask on_face = best.which > Count(3), on_edge = (best.which > Count(0)) & !on_face;
  const Mask first_is_0 = (best.which == Count(1)) | (best.which == Count(4)) | (best.which == Count(6));
  const Mask first_is_1 = (best.which == Count(2)) | (best.which == Count(5));
  const Mask second_is_1 = best.which == Count(4);
  const T second_weight = select(on_face, best.second_weight, zero);
  const T rest = (one - best.first_weight) - second_weight;
  Simplex<T>& s = r.simplex;
  s.vertex[0] = newest;
  s.vertex[1] = select(first_is_0, old.vertex[0], select(first_is_1, old.vertex[1], old.vertex[2]));
  s.vertex[2] = select(second_is_1, old.vertex[1], old.vertex[2]);
  s.weight[0] = select(rest > zero, rest, zero);
  s.weight[1] = best.first_weight;
  s.weight[2] = second_weight;
  s.size = select(on_face, Count(3), select(on_edge, Count(2), Count(1)));
  r.v = newest.w;
  if (any(on_edge)) {  // e x (a x e) / |e|^2 is the part of a that is normal to the edge
    const Vec3<T> edge = s.vertex[1].w - newest.w;
    r.v = select(on_edge, cross(cross(-newest.w, edge), edge) * best.scale, r.v);
  }
  if (any(on_face)) r.v = select(on_face, best.normal * best.scale, r.v);
  r.squared_distance = squared_norm(r.v);
  return r;
}

}  // namespace clearance
