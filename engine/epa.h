// The expanding polytope: grows a polytope of CSO vertices around the origin until its nearest face is the CSO's.
//
// Like GJK it only proposes: certify_ball() judges its surface, certify_lower() its direction. It also serves where GJK
// stops with the origin on a flat simplex: then it decides between contact and overlap.
// G. van den Bergen, "Proximity queries and penetration depth computation on 3D game objects", GDC 2001. Departure: the
// first tetrahedron need not hold the origin; faces may have negative offsets until the polytope has grown over it.
#pragma once

#include <algorithm>
#include <array>
#include <queue>
#include <utility>
#include <vector>

#include "certify.h"

namespace clearance {

struct EpaLimits {
  double rel_tol = 1e-6;     ///< stop once the nearest face is within this of the CSO's surface, relatively
  double abs_tol = 0;        ///< ... or absolutely
  double enough = 0;         ///< stop once the whole surface is farther than this from the origin, if positive
  double noise = 0;          ///< lengths below this are rounding
  int max_vertices = 4000;
};

enum class EpaEnd : std::uint8_t {
  kConverged,
  kEnough,
  kOutside,   ///< a direction was found along which the CSO does not reach the origin
  kFlat,      ///< the CSO has no volume above rounding
  kLimit,     ///< too many vertices, or rounding broke the surface
};

template <class T>
struct EpaResult {
  EpaEnd end = EpaEnd::kFlat;
  std::vector<CsoVertex<T>> vertices;
  std::vector<CsoFace<T>> faces;      ///< a closed surface around the polytope (empty if kFlat)
  Vec3<T> direction{T(1), T(0), T(0)};  ///< along which the CSO reaches least far beyond the origin, as far as was seen
  Simplex<T> nearest;                 ///< the point of the surface nearest to the origin
};

template <class T, class Cso>
class Epa {
 public:
  Epa(Cso& cso, const EpaLimits& limits) : cso_(cso), limits_(limits), noise_(T(limits.noise)) {}

  EpaResult<T> run(const Simplex<T>& seed, const Vec3<T>& direction) {
    r_.direction = direction;
    if (build_tetrahedron(seed)) expand();
    for (const Face& f : faces_)
      if (f.alive) r_.faces.push_back({f.vertex, f.normal});
    return std::move(r_);
  }

 private:
  struct Face {
    std::array<std::uint32_t, 3> vertex;
    std::array<std::uint32_t, 3> neighbour;  ///< across the edge from vertex[i] to vertex[i + 1]
    Vec3<T> normal;                          ///< unit, outward
    T offset;                                ///< normal . w of its vertices
    bool alive = true;
  };

  const Vec3<T>& w(std::uint32_t i) const { return r_.vertices[i].w; }

  std::uint32_t add(const CsoVertex<T>& v) {
    for (std::uint32_t i = 0; i < r_.vertices.size(); ++i)
      if (same(r_.vertices[i], v)) return i;
    r_.vertices.push_back(v);
    on_surface_.push_back(false);
    return static_cast<std::uint32_t>(r_.vertices.size() - 1);
  }

  // The support along d, remembering the direction along which the CSO reaches least.
  CsoVertex<T> probe(const Vec3<T>& d, T& reach) {
    const CsoVertex<T> v = cso_(-d).vertex;
    reach = dot(d, v.w);
    if (!have_reach_ || reach < least_reach_) {
      have_reach_ = true;
      least_reach_ = reach;
      r_.direction = d;
    }
    return v;
  }

  static Vec3<T> unit(const Vec3<T>& v) { return v * (T(1) / norm(v)); }

  // Four vertices with volume, from the seed and supports along the axes and along normals of what is there already.
  bool build_tetrahedron(const Simplex<T>& seed) {
    using std::abs;
    for (int i = 0; i < seed.size; ++i) add(seed.vertex[i]);
    T reach;
    for (int k = 0; k < 3; ++k)
      for (const double s : {1.0, -1.0}) {
        Vec3<T> d{T(0), T(0), T(0)};
        d[k] = T(s);
        add(probe(d, reach));
      }
    std::uint32_t t[4] = {};
    T best = T(-1);
    for (std::uint32_t i = 0; i < r_.vertices.size(); ++i)
      for (std::uint32_t j = 0; j < i; ++j)
        if (const T d = squared_norm(w(i) - w(j)); d > best) {
          best = d;
          t[0] = i;
          t[1] = j;
        }
    if (!(best > noise_ * noise_)) return false;
    const Vec3<T> edge = unit(w(t[1]) - w(t[0]));
    const auto off_edge = [&](std::uint32_t i) { return norm(cross(edge, w(i) - w(t[0]))); };
    best = T(-1);
    for (int round = 0; round < 2 && !(best > noise_); ++round) {
      if (round == 1) {  // everything so far is on a line: look sideways
        const Vec3<T> side = unit(cross(edge, abs(edge.x) < T(0.6) ? Vec3<T>{T(1), T(0), T(0)} : Vec3<T>{T(0), T(1), T(0)}));
        for (const Vec3<T>& d : {side, -side, cross(edge, side), -cross(edge, side)}) add(probe(d, reach));
      }
      for (std::uint32_t i = 0; i < r_.vertices.size(); ++i)
        if (const T d = off_edge(i); d > best) {
          best = d;
          t[2] = i;
        }
    }
    if (!(best > noise_)) return false;
    const Vec3<T> n = unit(cross(w(t[1]) - w(t[0]), w(t[2]) - w(t[0])));
    add(probe(n, reach));
    add(probe(-n, reach));
    best = T(-1);
    for (std::uint32_t i = 0; i < r_.vertices.size(); ++i)
      if (const T d = abs(dot(n, w(i) - w(t[0]))); d > best) {
        best = d;
        t[3] = i;
      }
    if (!(best > noise_)) return false;
    if (dot(n, w(t[3]) - w(t[0])) > T(0)) std::swap(t[1], t[2]);  // outward means away from t[3]
    return make_face({t[0], t[1], t[2]}, {3, 1, 2}) && make_face({t[1], t[3], t[2]}, {3, 2, 0}) &&
           make_face({t[2], t[3], t[0]}, {1, 3, 0}) && make_face({t[0], t[3], t[1]}, {2, 1, 0});
  }

  bool make_face(const std::array<std::uint32_t, 3>& vertex, const std::array<std::uint32_t, 3>& neighbour) {
    Face f;
    f.vertex = vertex;
    f.neighbour = neighbour;
    const Vec3<T> e1 = w(vertex[1]) - w(vertex[0]), e2 = w(vertex[2]) - w(vertex[0]), n = cross(e1, e2);
    const T nn = squared_norm(n);
    if (!(nn > T(Arithmetic<T>::kFlatFace) * squared_norm(e1) * squared_norm(e2))) return false;
    f.normal = unit(n);
    f.offset = dot(f.normal, w(vertex[0]));
    for (int i = 1; i < 3; ++i)
      if (const T o = dot(f.normal, w(vertex[i])); o < f.offset) f.offset = o;
    for (const std::uint32_t i : vertex) on_surface_[i] = true;
    faces_.push_back(f);
    queue_.push({static_cast<double>(f.offset), static_cast<std::uint32_t>(faces_.size() - 1)});
    return true;
  }

  void expand() {
    while (true) {
      while (!queue_.empty() && !faces_[queue_.top().second].alive) queue_.pop();
      if (queue_.empty()) return finish(EpaEnd::kLimit);
      const std::uint32_t nearest = queue_.top().second;
      const Vec3<T> normal = faces_[nearest].normal;
      const T offset = faces_[nearest].offset;
      if (limits_.enough > 0 && offset > T(limits_.enough)) return finish(EpaEnd::kEnough);
      T reach;
      const CsoVertex<T> v = probe(normal, reach);
      if (!(reach > T(0))) return finish(EpaEnd::kOutside);
      const T growth = reach - offset;
      if (growth <= T(limits_.rel_tol) * reach || growth <= T(limits_.abs_tol) || growth <= noise_)
        return finish(EpaEnd::kConverged);
      const std::uint32_t index = add(v);
      if (on_surface_[index] || r_.vertices.size() > static_cast<std::size_t>(limits_.max_vertices) ||
          !grow(nearest, index))
        return finish(EpaEnd::kLimit);
    }
  }

  // Replaces the faces that vertex `index` sees by a fan over their outline. The outline must be one simple loop.
  bool grow(std::uint32_t seen_first, std::uint32_t index) {
    struct Edge {
      std::uint32_t from, to, outside;
    };
    std::vector<Edge> outline;
    std::vector<std::uint32_t> seen{seen_first};
    faces_[seen_first].alive = false;
    for (std::size_t k = 0; k < seen.size(); ++k)
      for (int i = 0; i < 3; ++i) {
        const Face f = faces_[seen[k]];
        const std::uint32_t next = f.neighbour[i];
        if (!faces_[next].alive) continue;
        if (dot(faces_[next].normal, w(index)) - faces_[next].offset > noise_) {
          faces_[next].alive = false;
          seen.push_back(next);
        }
      }
    for (const std::uint32_t s : seen)
      for (int i = 0; i < 3; ++i)
        if (const std::uint32_t next = faces_[s].neighbour[i]; faces_[next].alive)
          outline.push_back({faces_[s].vertex[i], faces_[s].vertex[(i + 1) % 3], next});
    for (std::size_t i = 0; i + 1 < outline.size(); ++i) {  // chain the edges head to tail
      std::size_t j = i + 1;
      while (j < outline.size() && outline[j].from != outline[i].to) ++j;
      if (j == outline.size()) return revive(seen);
      std::swap(outline[i + 1], outline[j]);
    }
    if (outline.size() < 3 || outline.back().to != outline.front().from) return revive(seen);
    for (std::size_t i = 0; i < outline.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        if (outline[i].from == outline[j].from) return revive(seen);
    const auto first = static_cast<std::uint32_t>(faces_.size()), count = static_cast<std::uint32_t>(outline.size());
    for (std::uint32_t i = 0; i < count; ++i) {
      const Edge& e = outline[i];
      if (!make_face({e.from, e.to, index}, {e.outside, first + (i + 1) % count, first + (i + count - 1) % count})) {
        faces_.resize(first);
        return revive(seen);
      }
    }
    for (std::uint32_t i = 0; i < count; ++i) {
      Face& outside = faces_[outline[i].outside];
      for (int k = 0; k < 3; ++k)
        if (outside.vertex[k] == outline[i].to && outside.vertex[(k + 1) % 3] == outline[i].from)
          outside.neighbour[k] = first + i;
    }
    return true;
  }

  // Rounding made the outline unusable: leave the surface as it was, closed, for certify_ball() to judge.
  bool revive(const std::vector<std::uint32_t>& seen) {
    for (const std::uint32_t s : seen) faces_[s].alive = true;
    return false;
  }

  // The surface's point nearest to the origin. Among coplanar triangles only one holds it, and not always the one whose plane
  // came out nearest, so look at them all.
  void finish(EpaEnd end) {
    r_.end = end;
    T best = T(-1);
    for (const Face& f : faces_) {
      if (!f.alive) continue;
      const Vec3<T>&a = w(f.vertex[0]), &b = w(f.vertex[1]), &c = w(f.vertex[2]);
      // Barycentric coordinates of the origin's projection, clamped into the triangle: good enough to propose.
      const Vec3<T> p = f.normal * f.offset;
      T weight[3] = {dot(f.normal, cross(b - p, c - p)), dot(f.normal, cross(c - p, a - p)), dot(f.normal, cross(a - p, b - p))};
      for (T& x : weight) x = x > T(0) ? x : T(0);
      const Vec3<T> nearest = (a * weight[0] + b * weight[1] + c * weight[2]) * (T(1) / (weight[0] + weight[1] + weight[2]));
      const T d = squared_norm(nearest);
      if (best >= T(0) && !(d < best)) continue;
      best = d;
      r_.nearest.size = 3;
      for (int i = 0; i < 3; ++i) {
        r_.nearest.vertex[i] = r_.vertices[f.vertex[i]];
        r_.nearest.weight[i] = weight[i];
      }
    }
  }

  Cso& cso_;
  EpaLimits limits_;
  T noise_;
  EpaResult<T> r_;
  std::vector<Face> faces_;
  std::vector<bool> on_surface_;  ///< of r_.vertices: some were only probed
  using Entry = std::pair<double, std::uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue_;
  bool have_reach_ = false;
  T least_reach_ = T(0);
};

}  // namespace clearance
