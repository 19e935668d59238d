// The Gilbert-Johnson-Keerthi iteration, written once over a scalar T and a support functor.
//
// Works on the configuration space obstacle (CSO) A - B = { a - b }: the bodies' distance is its distance from the origin,
// and its point v nearest to the origin joins their nearest points. It only proposes: certify.h makes the bounds.
//
// E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A fast procedure for computing the distance between complex objects in
// three-dimensional space", IEEE J. Robotics and Automation 4(2), 1988; termination after G. van den Bergen, "A fast and
// robust GJK implementation for collision detection of convex objects", J. Graphics Tools 4(2), 1999. Departure: the
// nearest feature of a simplex is chosen by comparing the distances of all features, not by signs of determinants, which
// pick wrong features on slivers in any precision.
#pragma once

#include <cstdint>

#include "arithmetic.h"
#include "math.h"

namespace clearance {

/// A vertex of the CSO: w = a - b for vertices `a`, `b` of the two pieces.
template <class T>
struct CsoVertex {
  Vec3<T> w;
  std::uint32_t a, b;

  friend bool same(const CsoVertex& p, const CsoVertex& q) { return p.a == q.a && p.b == q.b; }
};

/// Up to four CSO vertices; the weights are those of the point nearest to the origin.
template <class T>
struct Simplex {
  CsoVertex<T> vertex[4];
  T weight[4];
  int size = 0;
};

enum class GjkEnd : std::uint8_t {
  kConverged,  ///< no vertex is nearer than the tolerance asks
  kBeyond,     ///< the origin is farther than max_distance
  kEncloses,   ///< the simplex holds the origin (four vertices), or it lies on it within rounding
  kStalled,    ///< rounding: no more decrease
  kLimit,      ///< iteration limit
};

template <class T>
struct GjkResult {
  Vec3<T> v;                ///< point of the simplex nearest to the origin; along a face's normal where it lies on a face
  T squared_distance;
  Simplex<T> simplex;       ///< up to three vertices and their weights; four if it encloses the origin
  CsoVertex<T> last;        ///< the last support vertex found along -v
  GjkEnd end = GjkEnd::kLimit;
  int iterations = 0;
};

struct GjkLimits {
  double rel_tol = 1e-6;       ///< stop once |v| - v.w/|v| <= max(rel_tol |v|, abs_tol)
  double abs_tol = 0;
  double max_distance = 0;     ///< stop once the origin is proved farther, if positive and finite
  int max_iterations = 256;
};

/// The nearest point to the origin of a simplex whose last vertex is the newest and takes part (the GJK invariant).
/// Reduces `s` to the vertices that carry it. Returns true if the origin is inside (then `s` keeps its four vertices).
template <class T>
CLEARANCE_HD bool reduce_to_nearest(Simplex<T>& s, Vec3<T>& v, T& vv) {
  const T flat = T(Arithmetic<T>::kFlatFace);
  const T zero = T(0), one = T(1);
  const int last = s.size - 1;
  const CsoVertex<T> a = s.vertex[last];
  const Vec3<T> q = -a.w;

  // The vertex itself, then edges from it, then faces at it: the valid one of least distance wins.
  T best = squared_norm(a.w);
  int kept[2] = {-1, -1};
  T weight[2] = {zero, zero};
  Vec3<T> nearest = a.w;

  Vec3<T> e[3], m[3];
  T g[3];
  for (int i = 0; i < last; ++i) {
    e[i] = s.vertex[i].w - a.w;
    m[i] = cross(q, e[i]);
    g[i] = squared_norm(e[i]);
    const T p = dot(q, e[i]);
    if (!(p > zero) || !(p < g[i])) continue;
    const T d = squared_norm(m[i]) / g[i];
    if (!(d < best)) continue;
    best = d;
    kept[0] = i;
    kept[1] = -1;
    weight[0] = p / g[i];
    nearest = cross(m[i], e[i]) * (one / g[i]);  // e x (a x e) / |e|^2: the part of a normal to the edge
  }
  int above = 0, below = 0;  // sides of the origin with regard to the three faces at `a`
  for (int i = 0; i < last; ++i) {
    for (int j = i + 1; j < last; ++j) {
      const Vec3<T> n = cross(e[i], e[j]);
      const T nn = squared_norm(n), u = dot(m[j], n), w = -dot(m[i], n), x = dot(q, n);
      if (last == 3) {
        const T opposite = dot(e[3 - i - j], n);
        if (x * opposite > zero) ++above; else ++below;
      }
      if (!(u > zero) || !(w > zero) || !(u + w < nn) || !(nn > flat * g[i] * g[j])) continue;
      const T d = x * x / nn;
      if (!(d < best)) continue;
      best = d;
      kept[0] = i;
      kept[1] = j;
      weight[0] = u / nn;
      weight[1] = w / nn;
      nearest = n * (-x / nn);
    }
  }
  if (last == 3 && below == 0) {
    // Inside the three planes at `a`; inside the tetrahedron if also on the inner side of the face across from it.
    const Vec3<T> n = cross(e[1] - e[0], e[2] - e[0]);
    const T origin_side = dot(q - e[0], n), a_side = -dot(e[0], n);
    if (origin_side * a_side > zero) {
      v = {zero, zero, zero};
      vv = zero;
      return true;
    }
  }
  Simplex<T> r;
  T rest = one;
  for (int k = 0; k < 2; ++k) {
    if (kept[k] < 0) break;
    r.vertex[r.size] = s.vertex[kept[k]];
    r.weight[r.size++] = weight[k];
    rest = rest - weight[k];
  }
  r.vertex[r.size] = a;
  r.weight[r.size++] = rest > zero ? rest : zero;
  s = r;
  v = nearest;
  vv = squared_norm(nearest);
  return false;
}

/// The same for the last resort, where bodies of sizes in the ratio 1e12 leave features 1e-10 wide and 1e2 long: a plane is
/// spanned by its two shortest edges and measured from its vertex nearest to the origin, since the cross product of two long,
/// almost parallel edges, or a far vertex, would lose that ratio's digits.
template <class T>
CLEARANCE_HD bool reduce_carefully(Simplex<T>& s, Vec3<T>& v, T& vv) {
  const T zero = T(0);
  const int newest = 1 << (s.size - 1);
  Simplex<T> best;
  bool found = false;
  for (int mask = newest; mask < 2 * newest; ++mask) {
    Simplex<T> f;
    for (int i = 0; i < s.size; ++i)
      if (mask >> i & 1) f.vertex[f.size++] = s.vertex[i];
    int near = 0;  // the vertex nearest to the origin goes first
    for (int i = 1; i < f.size; ++i)
      if (squared_norm(f.vertex[i].w) < squared_norm(f.vertex[near].w)) near = i;
    const CsoVertex<T> first = f.vertex[near];
    f.vertex[near] = f.vertex[0];
    f.vertex[0] = first;
    const Vec3<T>&p = f.vertex[0].w, &q = f.vertex[1].w, &r = f.vertex[2].w, &t = f.vertex[3].w;
    Vec3<T> point = p;
    if (f.size == 1) {
      f.weight[0] = T(1);
    } else if (f.size == 2) {
      const Vec3<T> e = q - p;
      const T ee = squared_norm(e), along = -dot(p, e);
      if (!(ee > zero)) continue;
      f.weight[0] = ee - along;
      f.weight[1] = along;
      point = cross(e, cross(p, e)) * (T(1) / ee);
    } else if (f.size == 3) {
      Vec3<T> e[3] = {q - p, r - q, p - r};
      int longest = 0;
      for (int i = 1; i < 3; ++i)
        if (squared_norm(e[i]) > squared_norm(e[longest])) longest = i;
      const Vec3<T> n = cross(e[(longest + 1) % 3], e[(longest + 2) % 3]);
      const T nn = squared_norm(n);
      if (!(nn > zero)) continue;
      f.weight[0] = dot(n, cross(q, r));
      f.weight[1] = dot(n, cross(r, p));
      f.weight[2] = dot(n, cross(p, q));
      point = n * (dot(n, p) / nn);
    } else {
      const T w[4] = {dot(q, cross(r, t)), -dot(p, cross(r, t)), dot(p, cross(q, t)), -dot(p, cross(q, r))};
      const bool positive = w[0] > zero;
      bool inside = true;
      for (int i = 0; i < 4; ++i) inside = inside && (positive ? w[i] > zero : w[i] < zero);
      if (!inside) continue;
      v = {zero, zero, zero};
      vv = zero;
      return true;
    }
    T sum = zero;
    bool inside = true;
    for (int i = 0; i < f.size; ++i) {
      inside = inside && f.weight[i] > zero;
      sum = sum + f.weight[i];
    }
    const T d = squared_norm(point);
    if (!inside || (found && !(d < vv))) continue;
    for (int i = 0; i < f.size; ++i) f.weight[i] = f.weight[i] / sum;
    found = true;
    best = f;
    v = point;
    vv = d;
  }
  s = best;
  return false;
}

/// Runs GJK. `cso(d)` returns the CSO's vertex farthest along d.
/// \param v0 a first guess of v (any direction but zero). \param seed vertices to begin from, in order of age (may be empty).
template <class T, class Cso>
CLEARANCE_HD GjkResult<T> gjk(Cso&& cso, const Vec3<T>& v0, const Simplex<T>& seed, const GjkLimits& limits) {
  const T zero = T(0);
  const auto reduce = [](Simplex<T>& s, Vec3<T>& v, T& vv) {
    return Arithmetic<T>::kCareful ? reduce_carefully(s, v, vv) : reduce_to_nearest(s, v, vv);
  };
  GjkResult<T> r;
  r.v = v0;
  r.squared_distance = zero;
  for (int i = 0; i < seed.size; ++i) {
    Simplex<T> grown = r.simplex;
    grown.vertex[grown.size++] = seed.vertex[i];
    Vec3<T> v;
    T vv;
    if (reduce(grown, v, vv) || !(vv > zero)) break;
    if (r.simplex.size > 0 && !(vv < r.squared_distance)) continue;
    r.simplex = grown;
    r.v = v;
    r.squared_distance = vv;
    r.last = seed.vertex[i];
  }
  const T rel = T(limits.rel_tol), abs2 = T(limits.abs_tol) * T(limits.abs_tol);
  const T far2 = T(limits.max_distance) * T(limits.max_distance);
  const bool bounded = limits.max_distance > 0 && limits.max_distance < 1e150;
  while (r.iterations < limits.max_iterations) {
    ++r.iterations;
    const CsoVertex<T> w = cso(-r.v);
    r.last = w;
    if (r.simplex.size > 0) {
      const T vw = dot(r.v, w.w), vv = r.squared_distance, gap = vv - vw;
      // The vertex is in the simplex already: the polytope has no point nearer in any direction that v can see.
      for (int i = 0; i < r.simplex.size; ++i)
        if (same(r.simplex.vertex[i], w)) {
          r.end = GjkEnd::kConverged;
          return r;
        }
      // |v| - v.w/|v| is how much v could still shrink.
      if (gap <= rel * vv || gap * gap <= abs2 * vv) {
        r.end = GjkEnd::kConverged;
        return r;
      }
      // The plane through w normal to v keeps the whole CSO farther than max_distance.
      if (bounded && vw > zero && vw * vw > far2 * vv) {
        r.end = GjkEnd::kBeyond;
        return r;
      }
    }
    Simplex<T> grown = r.simplex;
    grown.vertex[grown.size++] = w;
    Vec3<T> v;
    T vv;
    if (reduce(grown, v, vv) || !(vv > zero)) {
      r.simplex = grown;
      r.v = {zero, zero, zero};
      r.squared_distance = zero;
      r.end = GjkEnd::kEncloses;
      return r;
    }
    if (r.simplex.size > 0 && !(vv < r.squared_distance)) {
      r.end = GjkEnd::kStalled;
      return r;
    }
    r.simplex = grown;
    r.v = v;
    r.squared_distance = vv;
  }
  return r;
}

}  // namespace clearance
