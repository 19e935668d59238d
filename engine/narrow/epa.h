// The expanding polytope algorithm (EPA): grows a polytope of CSO vertices around the origin until its nearest face is
// a face of the CSO.
//
// Like GJK it only proposes: certify_ball() checks its surface, and certify_lower() its direction. It also decides
// between contact and overlap when GJK stops with the origin on a flat simplex.
//
// G. van den Bergen, "Proximity queries and penetration depth computation on 3D game objects", GDC 2001. Departure: the
// first tetrahedron need not hold the origin; faces may have negative offsets until the polytope has grown over it.
#pragma once

#include <initializer_list>
#include <span>
#include <utility>
#include <vector>

#include "engine/narrow/answer.h"
#include "engine/narrow/epa_surface.h"

namespace clearance {

struct EpaLimits {
  double rel_tol = 1e-6;   ///< stop once the nearest face is within this of the CSO's surface, relatively
  double abs_tol = 0;      ///< ... or absolutely
  double contact_tol = 0;  ///< replaces abs_tol while the surface is nearer to the origin than this
  double stop_below = 0;   ///< if positive, stop once the whole surface is farther than this from the origin
  double noise = 0;        ///< lengths below this are rounding
  std::size_t max_vertices = 4000;
};

/// Limits for a query's tolerances, half of which are EPA's share.
/// \param exact whether the nearest face itself is needed, since radii are added to it
/// \param scale of the pair
template <class T>
CLEARANCE_HD inline EpaLimits epa_limits(double abs_tol, double rel_tol, bool exact, double scale) {
  EpaLimits limits;
  limits.rel_tol = exact ? 4 * Arithmetic<T>::kUnit : rel_tol / 2;
  limits.abs_tol = abs_tol / 2;
  limits.contact_tol = contact_tolerance(abs_tol) / 2;
  limits.noise = 8 * Arithmetic<T>::kUnit * scale;
  return limits;
}

enum class EpaEnd : std::uint8_t {
  kConverged,
  kStopped,
  kOutside,  ///< there is a direction along which the CSO does not reach the origin
  kFlat,     ///< the CSO has no volume above rounding
  kLimit,    ///< too many vertices, or rounding broke the surface
  kPaused,   ///< go_on() continues
};

/// For a run without slices.
struct NeverPause {
  CLEARANCE_HD bool operator()(std::size_t) const { return false; }
};

/// Runs in turn, in the same memory.
template <class T, class Polytope = GrowingPolytope<T>>
class Epa {
 public:
  CLEARANCE_HD Epa() {}
  CLEARANCE_HD explicit Epa(const Polytope& polytope) : surface_(polytope) {}

  /// \param cso as for gjk()
  /// \param seed vertices to begin from, any number
  /// \param pause called before each step with the number of vertices; pauses the run if true
  template <class Cso, class Pause = NeverPause>
  CLEARANCE_HD EpaEnd run(const Cso& cso, const EpaLimits& limits, const Simplex<T>& seed, const Pause& pause = {}) {
    limits_ = limits;
    direction_ = {T(1), T(0), T(0)};
    reach_ = gap_ = T(0);
    probed_ = false;
    nearest_.size = 0;
    surface_.begin(T(limits.noise));
    bool has_volume = enclose(seed);
    if constexpr (Polytope::kGrows) has_volume = has_volume || spread_out(cso, seed);
    if (!has_volume) {
      surface_.remove_faces();
      return EpaEnd::kFlat;
    }
    return go_on(cso, pause);
  }
  /// Continues a paused run. The bits are those of a run without a pause.
  template <class Cso, class Pause>
  CLEARANCE_HD EpaEnd go_on(const Cso& cso, const Pause& pause) {
    const EpaEnd end = expand(cso, pause);
    if (end != EpaEnd::kPaused) find_nearest();
    return end;
  }

  /// A closed surface around the polytope, outward; empty if the CSO is flat.
  CLEARANCE_HD std::span<const CsoVertex<T>> vertices() const { return surface_.vertices(); }
  CLEARANCE_HD std::span<const CsoFace<T>> faces() const { return surface_.faces(); }
  /// The point of the surface nearest to the origin.
  CLEARANCE_HD const Simplex<T>& nearest() const { return nearest_; }
  /// Whether any direction was tried; if so, the unit one along which the CSO reaches least far beyond the origin, and
  /// the gap of its supporting planes there.
  CLEARANCE_HD bool probed() const { return probed_; }
  CLEARANCE_HD const Vec3<T>& direction() const { return direction_; }
  CLEARANCE_HD const T& gap() const { return gap_; }

 private:
  // The support along the unit vector d. Keeps the direction along which the CSO reaches least.
  template <class Cso>
  CLEARANCE_HD CsoVertex<T> probe(const Cso& cso, const Vec3<T>& d, T& reach) {
    const CsoSupport<T> s = cso(-d);
    reach = dot(d, s.vertex.w);
    if (!probed_ || reach < reach_) {
      probed_ = true;
      reach_ = reach;
      direction_ = d;
      gap_ = s.gap;
    }
    return s.vertex;
  }

  CLEARANCE_HD static Vec3<T> unit(const Vec3<T>& v) { return v * (T(1) / norm(v)); }

  CLEARANCE_HD bool is_close(const T& offset, const T& reach) const {
    const T growth = reach - offset;
    const T absolute = T(offset > T(limits_.contact_tol) ? limits_.abs_tol : limits_.contact_tol);
    return growth <= T(limits_.rel_tol) * reach || growth <= absolute || growth <= surface_.noise();
  }

  // Begins with GJK's last tetrahedron, if it has volume.
  CLEARANCE_HD bool enclose(const Simplex<T>& seed) {
    if (seed.size != 4) return false;
    CsoVertex<T> t[4] = {seed.vertex[0], seed.vertex[1], seed.vertex[2], seed.vertex[3]};
    if (dot(cross(t[1].w - t[0].w, t[2].w - t[0].w), t[3].w - t[0].w) > T(0)) std::swap(t[1], t[2]);
    if (!surface_.make_tetrahedron(t)) return false;
    for (std::uint32_t f = 0; f < 4; ++f) {
      const auto& [i, j, k] = surface_.face(f).vertex;
      const std::uint32_t opposite = 6 - (i + j + k);
      if (!(dot(surface_.face(f).normal, surface_.w(opposite)) - surface_.offset(f) < -surface_.noise())) return false;
    }
    return true;
  }

  // Begins with four vertices with volume, from the seed and from supports along the axes and along normals of the
  // vertices found so far.
  template <class Cso>
  bool spread_out(const Cso& cso, const Simplex<T>& seed) {
    using std::abs;
    const T noise = surface_.noise();
    std::vector<CsoVertex<T>> found(seed.vertex, seed.vertex + seed.size);
    const auto probe_along = [&](std::initializer_list<Vec3<T>> directions) {
      T reach;
      for (const Vec3<T>& d : directions) found.push_back(probe(cso, d, reach));
    };
    for (int k = 0; k < 3; ++k)
      for (const double s : {1.0, -1.0}) {
        Vec3<T> d{T(0), T(0), T(0)};
        d[k] = T(s);
        probe_along({d});
      }
    CsoVertex<T> t[4];
    T longest = T(-1);
    for (const CsoVertex<T>& p : found) {
      const auto from_p = [&](const Vec3<T>& w) { return squared_norm(p.w - w); };
      if (take_farthest(found, from_p, longest, t[1])) t[0] = p;
    }
    if (!(longest > noise * noise)) return false;
    const Vec3<T> edge = unit(t[1].w - t[0].w);
    const auto from_edge = [&](const Vec3<T>& w) { return norm(cross(edge, w - t[0].w)); };
    T width = T(-1);
    take_farthest(found, from_edge, width, t[2]);
    if (!(width > noise)) {  // everything so far is on a line, so try sideways
      const Vec3<T> side =
          unit(cross(edge, abs(edge.x) < T(0.6) ? Vec3<T>{T(1), T(0), T(0)} : Vec3<T>{T(0), T(1), T(0)}));
      probe_along({side, -side, cross(edge, side), -cross(edge, side)});
      take_farthest(found, from_edge, width, t[2]);
    }
    if (!(width > noise)) return false;
    const Vec3<T> n = unit(cross(t[1].w - t[0].w, t[2].w - t[0].w));
    probe_along({n, -n});
    const auto from_face = [&](const Vec3<T>& w) { return abs(dot(n, w - t[0].w)); };
    T height = T(-1);
    take_farthest(found, from_face, height, t[3]);
    if (dot(n, t[3].w - t[0].w) > T(0)) std::swap(t[1], t[2]);  // outward means away from t[3]
    return surface_.make_tetrahedron(t);
  }

  // Takes the vertex whose distance is greatest and greater than `most`, if any.
  template <class Distance>
  static bool take_farthest(const std::vector<CsoVertex<T>>& found, const Distance& distance_of, T& most,
                            CsoVertex<T>& farthest) {
    bool is_taken = false;
    for (const CsoVertex<T>& p : found)
      if (const T d = distance_of(p.w); d > most) {
        most = d;
        farthest = p;
        is_taken = true;
      }
    return is_taken;
  }

  // Grows the surface by supports along the normals of its nearest faces.
  template <class Cso, class Pause>
  CLEARANCE_HD EpaEnd expand(const Cso& cso, const Pause& pause) {
    while (true) {
      if (pause(surface_.vertices().size())) return EpaEnd::kPaused;
      const std::uint32_t nearest = surface_.nearest_face();
      const T offset = surface_.offset(nearest);
      if (limits_.stop_below > 0 && offset > T(limits_.stop_below)) return EpaEnd::kStopped;
      if (probed_ && is_close(offset, reach_)) return EpaEnd::kConverged;
      T reach;
      const CsoVertex<T> v = probe(cso, surface_.face(nearest).normal, reach);
      if (!(reach > T(0))) return EpaEnd::kOutside;
      if (is_close(offset, reach)) return EpaEnd::kConverged;
      if (surface_.has(v) || surface_.vertices().size() >= limits_.max_vertices || !surface_.grow(v, nearest))
        return EpaEnd::kLimit;
    }
  }

  // The surface's point nearest to the origin. Only one of several coplanar triangles holds it, and not always the one
  // with the nearest computed plane, so all faces with a plane near enough are tried.
  CLEARANCE_HD void find_nearest() {
    const std::uint32_t first = surface_.nearest_face();
    T best = try_face(first, T(__builtin_inf()));
    for (std::uint32_t f = 0; f < surface_.faces().size(); ++f)
      if (const T& offset = surface_.offset(f); f != first && !(offset > T(0) && offset * offset >= best))
        best = try_face(f, best);
  }

  // Takes the point of a face that is nearest to the origin, if its squared distance is less than `best`. Returns the
  // least squared distance so far.
  CLEARANCE_HD T try_face(std::uint32_t face, const T& best) {
    const CsoFace<T>& f = surface_.face(face);
    const Vec3<T>&a = surface_.w(f.vertex[0]), &b = surface_.w(f.vertex[1]), &c = surface_.w(f.vertex[2]);
    // Barycentric coordinates of the origin's projection, clamped into the triangle: good enough to propose.
    const Vec3<T> p = f.normal * surface_.offset(face);
    T weight[3] = {dot(f.normal, cross(b - p, c - p)), dot(f.normal, cross(c - p, a - p)),
                   dot(f.normal, cross(a - p, b - p))};
    for (T& x : weight) x = x > T(0) ? x : T(0);
    const Vec3<T> nearest =
        (a * weight[0] + b * weight[1] + c * weight[2]) * (T(1) / (weight[0] + weight[1] + weight[2]));
    const T d = squared_norm(nearest);
    if (!(d < best)) return best;
    nearest_.size = 3;
    for (int i = 0; i < 3; ++i) {
      nearest_.vertex[i] = surface_.vertices()[f.vertex[i]];
      nearest_.weight[i] = weight[i];
    }
    return d;
  }

  EpaLimits limits_;
  EpaSurface<T, Polytope> surface_;
  Simplex<T> nearest_;
  bool probed_ = false;
  T reach_, gap_;
  Vec3<T> direction_;
};

}  // namespace clearance
