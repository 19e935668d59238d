// The Gilbert-Johnson-Keerthi iteration over a scalar or a SIMD pack T, for host and device.
//
// Works on the configuration space obstacle (CSO), the Minkowski difference A - B = { a - b }: the bodies' distance is
// its distance from the origin, and its point v nearest to the origin joins their nearest points. It only proposes:
// certify.h makes the bounds.
//
// E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A fast procedure for computing the distance between complex objects in
// three-dimensional space", IEEE J. Robotics and Automation 4(2), 1988; termination after G. van den Bergen, "A fast
// and robust GJK implementation for collision detection of convex objects", J. Graphics Tools 4(2), 1999.
#pragma once

#include <cstdint>

#include "engine/base/arithmetic.h"
#include "engine/base/lane.h"
#include "engine/base/vec.h"
#include "engine/narrow/gjk/careful_simplex.h"
#include "engine/narrow/gjk/simplex.h"

namespace clearance {

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
  T contact_tol{0};      ///< replaces abs_tol as long as the parts are not proved apart
  T radius{0};           ///< sum of the parts' radii, which is taken off |v| later
  T max_distance{0};     ///< stop once the origin is proved farther
  bool bounded = false;  ///< whether max_distance counts
  bool squared = true;   ///< radius and abs_tol are 0 in all lanes, so that no root is needed
  int max_iterations = 256;
};

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
    return again | (slack <= limits.rel_tol * select(rest < zero, -rest, rest)) |
           (slack <= limits.contact_tol * length) |
           ((slack <= limits.abs_tol * length) & (gap > limits.radius * length));
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
