// The surface of EPA's polytope (epa.h), and how it grows by a vertex.
//
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

/// A closed surface of triangles with their planes, outward. The threads of its team call each function together.
template <class T, class Polytope = GrowingPolytope<T>>
class EpaSurface {
 public:
  using Team = typename Polytope::Team;

  CLEARANCE_HD EpaSurface() {}
  CLEARANCE_HD explicit EpaSurface(const Polytope& polytope) : p_(polytope) {}

  /// Removes all faces, and vertices.
  /// \param noise lengths below this are rounding
  CLEARANCE_HD void begin(const T& noise) {
    noise_ = noise;
    p_.vertices.clear();
    p_.faces.clear();
  }
  CLEARANCE_HD void remove_faces() { p_.faces.clear(); }

  CLEARANCE_HD const T& noise() const { return noise_; }
  CLEARANCE_HD std::span<const CsoVertex<T>> vertices() const { return {p_.vertices.data(), p_.vertices.size()}; }
  CLEARANCE_HD std::span<const CsoFace<T>> faces() const { return {p_.faces.data(), p_.faces.size()}; }
  CLEARANCE_HD const CsoFace<T>& face(std::uint32_t i) const { return p_.faces[i]; }
  /// Offset of a face's plane from the origin; negative where the origin lies outside.
  CLEARANCE_HD const T& offset(std::uint32_t face) const { return p_.offsets[face]; }
  /// Position of a vertex.
  CLEARANCE_HD const Vec3<T>& w(std::uint32_t i) const { return p_.vertices[i].w; }

  /// Begins with a tetrahedron. Returns false if it is flat.
  /// \param t t[3] is on the inner side of the triangle t[0], t[1], t[2]
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

  /// The nearest face; among equally near ones the first with an even index, or else the first. One thread scans both
  /// halves in parallel, so that fewer steps wait for the one before, and without branches, since the nearer face cannot
  /// be predicted.
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

  CLEARANCE_HD bool has(const CsoVertex<T>& vertex) const {
    bool known = false;
    for (std::size_t u = Team::rank(); u < p_.vertices.size(); u += Team::kSize) known |= same(p_.vertices[u], vertex);
    return Team::any(known);
  }

  /// Adds a vertex: replaces the faces that it sees, `nearest` among them, by a fan over their outline. Returns false and
  /// changes nothing if rounding made the outline unusable.
  CLEARANCE_HD bool grow(const CsoVertex<T>& vertex, std::uint32_t nearest) {
    p_.vertices.push_back(vertex);
    Team::sync();
    const auto apex = static_cast<std::uint32_t>(p_.vertices.size() - 1);
    find_seen(apex);
    if (!plan(apex)) {
      if constexpr (Polytope::kGrows) keep_connected(nearest);
      if (!Polytope::kGrows || !plan(apex)) {
        p_.vertices.pop_back();
        return false;
      }
    }
    place_fan();
    return true;
  }

 private:
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

  T noise_;
  Polytope p_;
  std::uint32_t seen_count_ = 0, outline_count_ = 0;
};

}  // namespace clearance
