// The expanding polytope algorithm (EPA): grows a polytope of CSO vertices around the origin until its nearest face is
// a face of the CSO.
//
// Like GJK it only proposes: certify_ball() checks its surface, and certify_lower() its direction. It also decides
// between contact and overlap when GJK stops with the origin on a flat simplex.
//
// G. van den Bergen, "Proximity queries and penetration depth computation on 3D game objects", GDC 2001. Departure: the
// first tetrahedron need not hold the origin; faces may have negative offsets until the polytope has grown over it.
// There are tens of faces, seldom hundreds: a scan over all of them for the nearest and for those that a new vertex
// sees is faster than a heap and a walk, whose branches cannot be predicted.
#pragma once

#include <algorithm>
#include <array>
#include <span>
#include <utility>
#include <vector>

#include "engine/narrow/polytope.h"

namespace clearance {

struct EpaLimits {
  double rel_tol = 1e-6;  ///< stop once the nearest face is within this of the CSO's surface, relatively
  double abs_tol = 0;     ///< ... or absolutely
  double stop_below = 0;  ///< if positive, stop once the whole surface is farther than this from the origin
  double noise = 0;       ///< lengths below this are rounding
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
  using Team = typename Polytope::Team;

 public:
  CLEARANCE_HD Epa() {}
  CLEARANCE_HD explicit Epa(const Polytope& polytope) : p_(polytope) {}

  /// \param cso as for gjk()
  /// \param seed vertices to begin from, any number
  /// \param pause called before each step with the number of vertices; pauses the run if true
  template <class Cso, class Pause = NeverPause>
  CLEARANCE_HD EpaEnd run(const Cso& cso, const EpaLimits& limits, const Simplex<T>& seed, const Pause& pause = {}) {
    limits_ = limits;
    noise_ = T(limits.noise);
    direction_ = {T(1), T(0), T(0)};
    reach_ = gap_ = T(0);
    probed_ = false;
    nearest_.size = 0;
    p_.vertices.clear();
    p_.faces.clear();
    bool has_volume = enclose(seed);
    if constexpr (Polytope::kGrows) has_volume = has_volume || spread_out(cso, seed);
    if (!has_volume) {
      p_.faces.clear();
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
  CLEARANCE_HD std::span<const CsoVertex<T>> vertices() const { return {p_.vertices.data(), p_.vertices.size()}; }
  CLEARANCE_HD std::span<const CsoFace<T>> faces() const { return {p_.faces.data(), p_.faces.size()}; }
  /// The point of the surface nearest to the origin.
  CLEARANCE_HD const Simplex<T>& nearest() const { return nearest_; }
  /// Whether any direction was tried; if so, the unit one along which the CSO reaches least far beyond the origin, and
  /// the gap of its supporting planes there.
  CLEARANCE_HD bool probed() const { return probed_; }
  CLEARANCE_HD const Vec3<T>& direction() const { return direction_; }
  CLEARANCE_HD const T& gap() const { return gap_; }

 private:
  CLEARANCE_HD const Vec3<T>& w(std::uint32_t i) const { return p_.vertices[i].w; }

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
    return growth <= T(limits_.rel_tol) * reach || growth <= T(limits_.abs_tol) || growth <= noise_;
  }

  // Begins with GJK's last tetrahedron, if it has volume.
  CLEARANCE_HD bool enclose(const Simplex<T>& seed) {
    if (seed.size != 4) return false;
    CsoVertex<T> t[4] = {seed.vertex[0], seed.vertex[1], seed.vertex[2], seed.vertex[3]};
    if (dot(cross(t[1].w - t[0].w, t[2].w - t[0].w), t[3].w - t[0].w) > T(0)) std::swap(t[1], t[2]);
    if (!make_tetrahedron(t)) return false;
    for (int f = 0; f < 4; ++f) {
      const auto& [i, j, k] = p_.faces[f].vertex;
      const std::uint32_t opposite = 6 - (i + j + k);
      if (!(dot(p_.faces[f].normal, w(opposite)) - p_.offsets[f] < -noise_)) return false;
    }
    return true;
  }

  // Begins with four vertices with volume, from the seed and from supports along the axes and along normals of the
  // vertices found so far.
  template <class Cso>
  bool spread_out(const Cso& cso, const Simplex<T>& seed) {
    using std::abs;
    std::vector<CsoVertex<T>> found(seed.vertex, seed.vertex + seed.size);
    const auto try_direction = [&](const Vec3<T>& d) {
      T reach;
      found.push_back(probe(cso, d, reach));
    };
    for (int k = 0; k < 3; ++k)
      for (const double s : {1.0, -1.0}) {
        Vec3<T> d{T(0), T(0), T(0)};
        d[k] = T(s);
        try_direction(d);
      }
    CsoVertex<T> t[4];
    T best = T(-1);
    for (const CsoVertex<T>& p : found)
      for (const CsoVertex<T>& q : found)
        if (const T d = squared_norm(p.w - q.w); d > best) {
          best = d;
          t[0] = p;
          t[1] = q;
        }
    if (!(best > noise_ * noise_)) return false;
    const Vec3<T> edge = unit(t[1].w - t[0].w);
    best = T(-1);
    for (int round = 0; round < 2 && !(best > noise_); ++round) {
      if (round == 1) {  // everything so far is on a line, so try sideways
        const Vec3<T> side =
            unit(cross(edge, abs(edge.x) < T(0.6) ? Vec3<T>{T(1), T(0), T(0)} : Vec3<T>{T(0), T(1), T(0)}));
        for (const Vec3<T>& d : {side, -side, cross(edge, side), -cross(edge, side)}) try_direction(d);
      }
      for (const CsoVertex<T>& p : found)
        if (const T d = norm(cross(edge, p.w - t[0].w)); d > best) {
          best = d;
          t[2] = p;
        }
    }
    if (!(best > noise_)) return false;
    const Vec3<T> n = unit(cross(t[1].w - t[0].w, t[2].w - t[0].w));
    try_direction(n);
    try_direction(-n);
    best = T(-1);
    for (const CsoVertex<T>& p : found)
      if (const T d = abs(dot(n, p.w - t[0].w)); d > best) {
        best = d;
        t[3] = p;
      }
    if (dot(n, t[3].w - t[0].w) > T(0)) std::swap(t[1], t[2]);  // outward means away from t[3]
    return make_tetrahedron(t);
  }

  // \param t t[3] is on the inner side of the triangle t[0], t[1], t[2]
  CLEARANCE_HD bool make_tetrahedron(const CsoVertex<T> (&t)[4]) {
    Simplex<T> s;
    for (int i = 0; i < 4; ++i) s.vertex[i] = t[i];
    CsoFace<T> faces[4];
    if (!tetrahedron_faces(s, faces)) return false;
    T offsets[4];
    for (int f = 0; f < 4; ++f) {
      CsoFace<T>& face = faces[f];
      const Vec3<T>&a = t[face.vertex[0]].w, &b = t[face.vertex[1]].w, &c = t[face.vertex[2]].w;
      const Vec3<T> e1 = b - a, e2 = c - a;
      if (!find_plane(cross(e1, e2), squared_norm(e1) * squared_norm(e2), a, b, c, face.normal, offsets[f]))
        return false;
    }
    p_.vertices.assign(t, t + 4);
    p_.faces.assign(faces, faces + 4);
    p_.offsets.assign(offsets, offsets + 4);
    Team::sync();
    return true;
  }

  // The plane that three points span, as far out as possible with all of them beyond it.
  // \param n normal to it
  // \param sides product of the squared lengths of the sides whose product n is
  CLEARANCE_HD static bool find_plane(const Vec3<T>& n, const T& sides, const Vec3<T>& a, const Vec3<T>& b,
                                      const Vec3<T>& c, Vec3<T>& normal, T& offset) {
    using std::sqrt;
    const T nn = squared_norm(n);
    normal = n * (T(1) / sqrt(nn));
    const T on_a = dot(normal, a), on_b = dot(normal, b), on_c = dot(normal, c), least = on_b < on_a ? on_b : on_a;
    offset = on_c < least ? on_c : least;
    return nn > T(Arithmetic<T>::kFlatFace) * sides;
  }

  // The nearest face; among equally near ones the first with an even index, or else the first. One thread scans both
  // halves in parallel, so that fewer steps wait for the one before, and without branches, since the nearer face cannot
  // be predicted.
  CLEARANCE_HD std::uint32_t nearest_face() const {
    const std::size_t count = p_.offsets.size();
    const T* offsets = p_.offsets.data();
    if constexpr (Team::kSize == 1) {
      T least[2] = {offsets[0], offsets[1]};
      std::size_t face[2] = {0, 1};
      for (std::size_t f = 2; f < count; f += 2)
        for (std::size_t k = 0; k < 2; ++k) {
          const std::size_t at = std::min(f + k, count - 1);
          const bool nearer = offsets[at] < least[k];
          least[k] = nearer ? offsets[at] : least[k];
          face[k] = nearer ? at : face[k];
        }
      return static_cast<std::uint32_t>(least[1] < least[0] ? face[1] : face[0]);
    } else {
      static_assert(Team::kSize % 2 == 0);  // each scans one half
      Ranked<T> least{T(__builtin_inf()), Team::rank()};
      for (std::uint32_t f = Team::rank(); f < count; f += Team::kSize)
        if (offsets[f] < least.value) least = {offsets[f], f};
      return Team::best(least,
                        [](const Ranked<T>& p, const Ranked<T>& q) {
                          if (p.value != q.value) return p.value < q.value;
                          return p.index % 2 != q.index % 2 ? p.index % 2 < q.index % 2 : p.index < q.index;
                        })
          .index;
    }
  }

  template <class Cso, class Pause>
  CLEARANCE_HD EpaEnd expand(const Cso& cso, const Pause& pause) {
    while (true) {
      if (pause(p_.vertices.size())) return EpaEnd::kPaused;
      const std::uint32_t nearest = nearest_face();
      const T offset = p_.offsets[nearest];
      if (limits_.stop_below > 0 && offset > T(limits_.stop_below)) return EpaEnd::kStopped;
      if (probed_ && is_close(offset, reach_)) return EpaEnd::kConverged;
      T reach;
      const CsoVertex<T> v = probe(cso, p_.faces[nearest].normal, reach);
      if (!(reach > T(0))) return EpaEnd::kOutside;
      if (is_close(offset, reach)) return EpaEnd::kConverged;
      bool known = p_.vertices.size() >= limits_.max_vertices;
      for (std::size_t u = Team::rank(); u < p_.vertices.size(); u += Team::kSize) known |= same(p_.vertices[u], v);
      if (Team::any(known)) return EpaEnd::kLimit;
      p_.vertices.push_back(v);
      Team::sync();
      if (!grow(nearest)) {
        p_.vertices.pop_back();
        return EpaEnd::kLimit;
      }
    }
  }

  // Replaces the faces that the last vertex sees, `nearest` among them, by a fan over their outline. Returns false and
  // changes nothing if rounding made the outline unusable.
  CLEARANCE_HD bool grow(std::uint32_t nearest) {
    const auto apex = static_cast<std::uint32_t>(p_.vertices.size() - 1);
    find_seen(apex);
    if (!plan(apex)) {
      if constexpr (Polytope::kGrows) keep_connected(nearest);
      if (!Polytope::kGrows || !plan(apex)) return false;
    }
    place_fan();
    return true;
  }

  // The outline of the seen faces, and the faces from there to the last vertex. False if they are unusable.
  CLEARANCE_HD bool plan(std::uint32_t apex) {
    outline_count_ = Team::lead([&] {
      const std::uint32_t edges = find_outline();
      return plan_fan(apex, edges) ? edges : 0;
    });
    return outline_count_ > 0 && find_planes();
  }

  // Writes every face to the list, and advances only past those that are seen, since a branch could not be predicted.
  // Edges are found the same way below.
  CLEARANCE_HD void find_seen(std::uint32_t apex) {
    const std::size_t count = p_.faces.size();
    p_.reserve();
    const Vec3<T> p = w(apex);
    const T noise = noise_;
    const CsoFace<T>* faces = p_.faces.data();
    const T* offsets = p_.offsets.data();
    std::uint8_t* is_seen = p_.is_seen.data();
    std::uint32_t* seen = p_.seen.data();
    std::size_t seen_count = 0;
    for (std::size_t first = 0; first < count; first += Team::kSize) {
      const std::size_t f = first + Team::rank();
      bool sees = false;
      if (Team::kSize == 1 || f < count) {
        sees = dot(faces[f].normal, p) - offsets[f] > noise;
        is_seen[f] = static_cast<std::uint8_t>(sees);
      }
      Team::append(seen, seen_count, static_cast<std::uint32_t>(f), sees);
    }
    seen_count_ = static_cast<std::uint32_t>(seen_count);
    Team::sync();
  }

  // Finds the edges between seen and other faces, and for each vertex the one that begins there. Returns their number.
  CLEARANCE_HD std::uint32_t find_outline() {
    const CsoFace<T>* faces = p_.faces.data();
    const std::uint8_t* is_seen = p_.is_seen.data();
    OutlineEdge* outline = p_.outline.data();
    std::uint32_t *begins = p_.begins.data(), edges = 0;
    const std::uint32_t *seen = p_.seen.data(), count = seen_count_;
    for (std::uint32_t k = 0; k < count; ++k) {
      const CsoFace<T>& f = faces[seen[k]];
      for (std::uint32_t e = 0; e < 3; ++e) {
        const bool borders = !is_seen[face_of(f.twin[e])];
        outline[edges] = {f.vertex[e], f.vertex[e == 2 ? 0 : e + 1], f.twin[e]};
        const std::uint32_t before = begins[f.vertex[e]];
        begins[f.vertex[e]] = borders ? edges : before;
        edges += borders;
      }
    }
    return edges;
  }

  // Keeps only seen faces that are connected with the nearest, where rounding let the vertex see others.
  void keep_connected(std::uint32_t nearest) {
    seen_count_ = 1;
    p_.seen[0] = nearest;
    p_.is_seen.swap(p_.was_seen);
    p_.is_seen.assign(p_.was_seen.size(), false);
    p_.is_seen[nearest] = true;
    for (std::size_t k = 0; k < seen_count_; ++k)
      for (const std::uint32_t twin : p_.faces[p_.seen[k]].twin)
        if (const std::uint32_t f = face_of(twin); p_.was_seen[f] && !p_.is_seen[f]) {
          p_.is_seen[f] = true;
          p_.seen[seen_count_++] = f;
        }
    std::sort(p_.seen.begin(), p_.seen.begin() + static_cast<std::ptrdiff_t>(seen_count_));
  }

  // Plans one triangle for each edge of the outline, without its plane. False if the outline is not one loop.
  CLEARANCE_HD bool plan_fan(std::uint32_t apex, std::uint32_t count) {
    if (count < 3 || !p_.reserve_fan(count, seen_count_)) return false;
    // Places of the new faces: those of the seen ones, then after the last.
    std::uint32_t* places = p_.seen.data();
    for (std::uint32_t i = seen_count_; i < count; ++i)
      places[i] = static_cast<std::uint32_t>(p_.faces.size()) + (i - seen_count_);
    const OutlineEdge* outline = p_.outline.data();
    const std::uint32_t* begins = p_.begins.data();
    std::uint32_t at = 0, before = places[count - 1], here = places[0];
    bool usable = true;
    for (std::uint32_t i = 0; i < count && at < count; ++i) {
      const OutlineEdge e = outline[at];
      const std::uint32_t after = places[i + 1 == count ? 0 : i + 1];
      CsoFace<T>& face = p_.fan[i].face;
      face.vertex = {e.from, e.to, apex};
      face.twin = {e.outside, half_edge(after, 2), half_edge(before, 1)};
      at = begins[e.to];
      usable &= (at == 0) == (i + 1 == count) && (at >= count || outline[at].from == e.to);
      before = here;
      here = after;
    }
    return usable && at == 0;
  }
  // False if a triangle is flat.
  CLEARANCE_HD bool find_planes() {
    const CsoVertex<T>* vertices = p_.vertices.data();
    bool usable = true;
    for (std::uint32_t i = Team::rank(); i < outline_count_; i += Team::kSize) {
      auto& [face, offset] = p_.fan[i];
      const Vec3<T>&from = vertices[face.vertex[0]].w, &to = vertices[face.vertex[1]].w,
            &apex = vertices[face.vertex[2]].w;
      const Vec3<T> u = from - apex, v = to - apex;
      usable &= find_plane(cross(u, v), squared_norm(u) * squared_norm(v), from, to, apex, face.normal, offset);
    }
    return Team::all(usable);
  }

  CLEARANCE_HD void place_fan() {
    const std::size_t before = p_.faces.size(), after = before + outline_count_ - seen_count_;
    if (before < after) {
      p_.faces.resize(after);
      p_.offsets.resize(after);
    }
    for (std::uint32_t i = Team::rank(); i < outline_count_; i += Team::kSize) {
      const std::uint32_t f = p_.seen[i];
      p_.faces[f] = p_.fan[i].face;
      p_.offsets[f] = p_.fan[i].offset;
      link(f, 0);
    }
    Team::sync();
    // A fan smaller than the faces it replaces leaves gaps, which the last faces fill.
    if (before <= after) return;
    Team::lead([&] {
      std::size_t last = before;
      for (std::uint32_t i = seen_count_; i-- > outline_count_;) {
        const std::uint32_t f = p_.seen[i];
        if (f == --last) continue;
        p_.faces[f] = p_.faces[last];
        p_.offsets[f] = p_.offsets[last];
        for (std::uint32_t e = 0; e < 3; ++e) link(f, e);
      }
      return 0u;
    });
    p_.faces.resize(after);
    p_.offsets.resize(after);
  }

  // Updates the twin of an edge in the face across it.
  CLEARANCE_HD void link(std::uint32_t face, std::uint32_t edge) {
    const std::uint32_t across = p_.faces[face].twin[edge];
    p_.faces[face_of(across)].twin[edge_of(across)] = half_edge(face, edge);
  }

  // The surface's point nearest to the origin. Only one of several coplanar triangles holds it, and not always the one
  // with the nearest computed plane, so all faces with a plane near enough are tried.
  CLEARANCE_HD void find_nearest() {
    const std::uint32_t first = nearest_face();
    T best = try_face(first, T(__builtin_inf()));
    for (std::uint32_t f = 0; f < p_.faces.size(); ++f)
      if (const T& offset = p_.offsets[f]; f != first && !(offset > T(0) && offset * offset >= best))
        best = try_face(f, best);
  }

  // Takes the point of a face that is nearest to the origin, if its squared distance is less than `best`. Returns the
  // least squared distance so far.
  CLEARANCE_HD T try_face(std::uint32_t face, const T& best) {
    const CsoFace<T>& f = p_.faces[face];
    const Vec3<T>&a = w(f.vertex[0]), &b = w(f.vertex[1]), &c = w(f.vertex[2]);
    // Barycentric coordinates of the origin's projection, clamped into the triangle: good enough to propose.
    const Vec3<T> p = f.normal * p_.offsets[face];
    T weight[3] = {dot(f.normal, cross(b - p, c - p)), dot(f.normal, cross(c - p, a - p)),
                   dot(f.normal, cross(a - p, b - p))};
    for (T& x : weight) x = x > T(0) ? x : T(0);
    const Vec3<T> nearest =
        (a * weight[0] + b * weight[1] + c * weight[2]) * (T(1) / (weight[0] + weight[1] + weight[2]));
    const T d = squared_norm(nearest);
    if (!(d < best)) return best;
    nearest_.size = 3;
    for (int i = 0; i < 3; ++i) {
      nearest_.vertex[i] = p_.vertices[f.vertex[i]];
      nearest_.weight[i] = weight[i];
    }
    return d;
  }

  EpaLimits limits_;
  T noise_;
  Polytope p_;
  std::uint32_t seen_count_ = 0, outline_count_ = 0;
  Simplex<T> nearest_;
  bool probed_ = false;
  T reach_, gap_;
  Vec3<T> direction_;
};

}  // namespace clearance
