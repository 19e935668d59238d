// The Gilbert-Johnson-Keerthi iteration over a scalar or a SIMD pack T, for host and device.
//
// Works on the configuration space obstacle (CSO), the Minkowski difference A - B = { a - b }: the bodies' distance is
// its distance from the origin, and its point v nearest to the origin joins their nearest points. It only proposes:
// certify.h makes the bounds.
//
// E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A fast procedure for computing the distance between complex objects in
// three-dimensional space", IEEE J. Robotics and Automation 4(2), 1988; termination after G. van den Bergen, "A fast
// and robust GJK implementation for collision detection of convex objects", J. Graphics Tools 4(2), 1999. Departure:
// the nearest feature of a simplex is chosen by comparing the distances of all features, not by signs of determinants,
// which pick wrong features on slivers in any precision.
#pragma once

#include <cstdint>

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

enum class GjkEnd : std::uint8_t {
  kRunning,
  kConverged,  ///< no vertex is nearer by more than the tolerance
  kBeyond,     ///< the origin is farther than max_distance
  kEncloses,   ///< the simplex holds the origin (four vertices), or the origin lies on it within rounding
  kStalled,    ///< rounding: no more decrease
  kLimit,      ///< iteration limit
};

/// Conditions to stop. Lengths in metres, of the distance between the CSO and the origin.
template <class T>
struct GjkLimits {
  T rel_tol{1e-6};  ///< stop once |v| - v.w/|v| <= max(rel_tol ||v| - radius|, abs_tol)
  T abs_tol{0};
  T radius{0};           ///< sum of the parts' radii, which is taken off |v| later
  T max_distance{0};     ///< stop once the origin is proved farther
  bool bounded = false;  ///< whether max_distance counts
  bool squared = true;   ///< radius and abs_tol are 0 in all lanes, so that no root is needed
  int max_iterations = 256;
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

enum class Carries : std::uint8_t { kNo, kPoint, kOrigin };

/// The point of a feature's plane (of its line, its vertex) that is nearest to the origin, and the unscaled weights of
/// its vertices there. A plane is spanned by the two shortest edges and measured from vertex 0. Returns kOrigin for a
/// tetrahedron around the origin, and kNo for a flat feature or a tetrahedron without the origin.
template <class T>
CLEARANCE_HD inline Carries weigh(Simplex<T>& f, Vec3<T>& point) {
  const T zero = T(0);
  const Vec3<T>&p = f.vertex[0].w, &q = f.vertex[1].w, &r = f.vertex[2].w, &t = f.vertex[3].w;
  point = p;
  if (f.size == 1) {
    f.weight[0] = T(1);
  } else if (f.size == 2) {
    const Vec3<T> e = q - p;
    const T ee = squared_norm(e), along = -dot(p, e);
    if (!(ee > zero)) return Carries::kNo;
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
    if (!(nn > zero)) return Carries::kNo;
    f.weight[0] = dot(n, cross(q, r));
    f.weight[1] = dot(n, cross(r, p));
    f.weight[2] = dot(n, cross(p, q));
    point = n * (dot(n, p) / nn);
  } else {
    const T w[4] = {dot(q, cross(r, t)), -dot(p, cross(r, t)), dot(p, cross(q, t)), -dot(p, cross(q, r))};
    const bool positive = w[0] > zero;
    for (int i = 0; i < 4; ++i)
      if (!(positive ? w[i] > zero : w[i] < zero)) return Carries::kNo;
    return Carries::kOrigin;
  }
  return Carries::kPoint;
}

/// Last resort of reduce_to_nearest(), for bodies of sizes in the ratio 1e12 with features 1e-10 wide and 1e2 long.
/// Weighs every feature from its vertex nearest to the origin, since the cross product of two long, almost parallel
/// edges, or a far vertex, would lose that ratio's digits. Scalars only.
template <class T>
CLEARANCE_HD inline Nearest<T> reduce_carefully(const Simplex<T>& old, const CsoVertex<T>& newest) {
  const T zero = T(0);
  Nearest<T> best;
  best.encloses = false;
  bool found = false;
  for (int mask = 0; mask < 1 << old.size; ++mask) {
    Simplex<T> f;
    f.vertex[f.size++] = newest;
    for (int i = 0; i < old.size; ++i)
      if (mask >> i & 1) f.vertex[f.size++] = old.vertex[i];
    int near = 0;
    for (int i = 1; i < f.size; ++i)
      if (squared_norm(f.vertex[i].w) < squared_norm(f.vertex[near].w)) near = i;
    const CsoVertex<T> first = f.vertex[near];
    f.vertex[near] = f.vertex[0];
    f.vertex[0] = first;
    Vec3<T> point;
    const Carries carries = weigh(f, point);
    best.encloses = carries == Carries::kOrigin;
    if (best.encloses) return best;
    if (carries == Carries::kNo) continue;
    T sum = zero;
    bool inside = true;
    for (int i = 0; i < f.size; ++i) {
      inside = inside && f.weight[i] > zero;
      sum = sum + f.weight[i];
    }
    const T d = squared_norm(point);
    if (!inside || (found && !(d < best.squared_distance))) continue;
    for (int i = 0; i < f.size; ++i) f.weight[i] = f.weight[i] / sum;
    found = true;
    best.simplex = f;
    best.v = point;
    best.squared_distance = d;
  }
  return best;
}

/// State of one run of GJK, or of each lane's run.
template <class T>
struct Gjk {
  using Mask = typename Lane<T>::Mask;
  using Count = typename Lane<T>::Count;

  Vec3<T> v;              ///< point of the simplex nearest to the origin; before the first step a guess other than zero
  T squared_distance{0};  ///< |v|^2, once the simplex has a vertex
  Simplex<T> simplex;     ///< up to three vertices and their weights; four if it encloses the origin
  CsoVertex<T> last;      ///< the last support vertex found along -v
  T gap{0};      ///< of the supporting planes normal to v, times |v|: proves a lower bound if v did not move since
  Count end{0};  ///< a GjkEnd

  /// Begins at the simplex of a run in coarser arithmetic: one to three vertices, the newest first.
  CLEARANCE_HD void begin(const Simplex<T>& start) {
    Simplex<T> others;
    others.vertex[0] = start.vertex[1];
    others.vertex[1] = others.vertex[2] = start.vertex[2];
    others.size = start.size - Count(1);
    const Nearest<T> next = reduce(others, start.vertex[0]);
    const Mask take = next.squared_distance > T(0);
    advance(next, take);
    last = select(take, start.vertex[0], last);
  }

  /// One step.
  /// \param vertex the CSO's farthest vertex along -v
  /// \param support_gap v.w, computed from the support values
  /// \param running lanes that have not ended; the others stay as they are
  CLEARANCE_INLINE void step(const CsoVertex<T>& vertex, const T& support_gap, const GjkLimits<T>& limits,
                             const Mask& running) {
    const T zero(0), vv = squared_distance;
    last = select(running, vertex, last);
    gap = select(running, support_gap, gap);
    const Mask begun = simplex.size > Count(0);
    const Mask converged = converges(limits) & begun & running;
    const Mask beyond = begun & running & !converged & is_beyond(limits);
    end = select(converged, code(GjkEnd::kConverged), end);
    end = select(beyond, code(GjkEnd::kBeyond), end);
    const Mask going = running & !converged & !beyond;
    if (!any(going)) return;
    const Nearest<T> next = reduce(simplex, vertex);
    const Mask encloses = going & (next.encloses | !(next.squared_distance > zero));
    const Mask stalled = going & !encloses & begun & !(next.squared_distance < vv);
    if (any(encloses)) {
      simplex.vertex[3] = select(encloses, simplex.vertex[2], simplex.vertex[3]);
      simplex.vertex[2] = select(encloses, simplex.vertex[1], simplex.vertex[2]);
      simplex.vertex[1] = select(encloses, simplex.vertex[0], simplex.vertex[1]);
      simplex.vertex[0] = select(encloses, vertex, simplex.vertex[0]);
      simplex.size = select(encloses, simplex.size + Count(1), simplex.size);
      v = select(encloses, Vec3<T>{zero, zero, zero}, v);
      squared_distance = select(encloses, zero, squared_distance);
    }
    advance(next, going & !encloses & !stalled);
    end = select(encloses, code(GjkEnd::kEncloses), end);
    end = select(stalled, code(GjkEnd::kStalled), end);
  }

  /// The same for a single run, in two parts: its end, if any, and the state to continue with. No state of a continuing
  /// run is written at the end, so that a GPU thread need not select between both. After the end comes close().
  CLEARANCE_INLINE GjkEnd try_step(const CsoVertex<T>& vertex, const T& support_gap, const GjkLimits<T>& limits,
                                   Nearest<T>& next) {
    last = vertex;
    gap = support_gap;
    if (simplex.size == 0) {  // as reduce() does for a first vertex
      next.simplex.vertex[0] = vertex;
      next.simplex.weight[0] = T(1);
      next.simplex.weight[1] = next.simplex.weight[2] = T(0);
      next.simplex.size = 1;
      next.v = vertex.w;
      next.squared_distance = squared_norm(vertex.w);
      return next.squared_distance > T(0) ? GjkEnd::kRunning : GjkEnd::kEncloses;
    }
    if (converges(limits)) return GjkEnd::kConverged;
    if (is_beyond(limits)) return GjkEnd::kBeyond;
    next = reduce(simplex, vertex);
    if (next.encloses || !(next.squared_distance > T(0))) return GjkEnd::kEncloses;
    return next.squared_distance < squared_distance ? GjkEnd::kRunning : GjkEnd::kStalled;
  }
  CLEARANCE_INLINE void go_on(const Nearest<T>& next) {
    CLEARANCE_UNROLL
    for (int i = 0; i < 3; ++i) {
      simplex.vertex[i] = next.simplex.vertex[i];
      simplex.weight[i] = next.simplex.weight[i];
    }
    simplex.size = next.simplex.size;
    v = next.v;
    squared_distance = next.squared_distance;
  }
  /// Ends a single run. A simplex that encloses the origin receives the vertex that closed it.
  CLEARANCE_HD void close(GjkEnd how) {
    end = code(how);
    if (how != GjkEnd::kEncloses) return;
    CLEARANCE_UNROLL
    for (int i = 3; i > 0; --i) simplex.vertex[i] = simplex.vertex[i - 1];
    simplex.vertex[0] = last;
    ++simplex.size;
    v = {T(0), T(0), T(0)};
    squared_distance = T(0);
  }

  CLEARANCE_HD static Count code(GjkEnd e) { return Count(static_cast<int>(e)); }

 private:
  CLEARANCE_HD static Nearest<T> reduce(const Simplex<T>& old, const CsoVertex<T>& newest) {
    if constexpr (Arithmetic<T>::kCareful)
      return reduce_carefully(old, newest);
    else
      return reduce_to_nearest(old, newest);
  }
  // For lanes that have begun: after the support vertex `last` with its gap.
  CLEARANCE_INLINE Mask converges(const GjkLimits<T>& limits) const {
    const T zero(0), vv = squared_distance;
    // The vertex is in the simplex already: along -v the polytope has no nearer point.
    const Mask again = ((simplex.size > Count(0)) & same(simplex.vertex[0], last)) |
                       ((simplex.size > Count(1)) & same(simplex.vertex[1], last)) |
                       ((simplex.size > Count(2)) & same(simplex.vertex[2], last));
    // The length of v could still shrink by |v| - v.w/|v|.
    const T slack = vv - gap;
    if (limits.squared) return again | (slack <= limits.rel_tol * vv);
    using std::sqrt;
    const T length = sqrt(vv), rest = vv - limits.radius * length;
    return again | (slack <= limits.rel_tol * select(rest < zero, -rest, rest)) | (slack <= limits.abs_tol * length);
  }
  // The plane through the vertex normal to v keeps the whole CSO farther than max_distance.
  CLEARANCE_INLINE Mask is_beyond(const GjkLimits<T>& limits) const {
    const T zero(0);
    if (!limits.bounded) return zero > zero;
    return (gap > zero) & (gap * gap > limits.max_distance * limits.max_distance * squared_distance);
  }
  CLEARANCE_HD void advance(const Nearest<T>& next, const Mask& take) {
    CLEARANCE_UNROLL
    for (int i = 0; i < 3; ++i) {
      simplex.vertex[i] = select(take, next.simplex.vertex[i], simplex.vertex[i]);
      simplex.weight[i] = select(take, next.simplex.weight[i], simplex.weight[i]);
    }
    simplex.size = select(take, next.simplex.size, simplex.size);
    v = select(take, next.v, v);
    squared_distance = select(take, next.squared_distance, squared_distance);
  }
};

/// A CSO vertex, and v.w computed from the support values.
template <class T>
struct CsoSupport {
  CsoVertex<T> vertex;
  T gap;
};

/// Runs GJK on one pair.
/// \param cso returns, as `cso(v)`, the CSO's vertex farthest along -v
/// \param v0 a first guess of v (any direction but zero)
/// \param seed a simplex to begin from (may be empty)
template <class T, class Cso>
CLEARANCE_HD inline Gjk<T> gjk(Cso&& cso, const Vec3<T>& v0, const Simplex<T>& seed, const GjkLimits<T>& limits) {
  Gjk<T> g;
  g.v = v0;
  if (seed.size > 0) g.begin(seed);
  GjkEnd end = GjkEnd::kRunning;
  for (int i = 0; i < limits.max_iterations && end == GjkEnd::kRunning; ++i) {
    const CsoSupport<T> s = cso(g.v);
    Nearest<T> next;
    end = g.try_step(s.vertex, s.gap, limits, next);
    if (end == GjkEnd::kRunning) g.go_on(next);
  }
  g.close(end == GjkEnd::kRunning ? GjkEnd::kLimit : end);
  return g;
}

}  // namespace clearance
