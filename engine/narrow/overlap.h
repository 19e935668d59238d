// Proof that two convex parts overlap: a closed surface of CSO triangles with the origin well inside. For host and
// device.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "engine/narrow/certify.h"
#include "engine/narrow/team.h"

namespace clearance {

// Winding number of the surface around the point `o`, from the faces that a ray along g crosses; 0 if any sign is
// uncertain. All faces lie beyond planes that keep them from `o`.
template <class T, class Vertices>
CLEARANCE_HD inline int winding(const Vertices& w, const CsoFace<T>* faces, std::size_t count, const Vec3<T>& o,
                                const Vec3<T>& g) {
  const T uncertain = T(32 * Arithmetic<T>::kUnit);
  using std::abs;
  int turns = 0;
  for (std::size_t f = 0; f < count; ++f) {
    const CsoFace<T>& face = faces[f];
    Vec3<T> q[3];
    for (int i = 0; i < 3; ++i) q[i] = w[face.vertex[i]] - o;
    int sign = 0;
    bool same_side = true;
    for (int i = 0; i < 3 && same_side; ++i) {
      const Vec3<T>&p = q[i], &r = q[(i + 1) % 3];
      const T side = dot(g, cross(p, r));
      if (!(abs(side) > uncertain * (norm(p) * norm(r)))) return 0;
      const int s = side > T(0) ? 1 : -1;
      same_side = i == 0 || s == sign;
      sign = s;
    }
    if (!same_side) continue;
    const T ahead = dot(g, face.normal);
    if (!(abs(ahead) > uncertain * norm(face.normal))) return 0;
    if (ahead > T(0)) turns += sign;
  }
  return turns;
}

/// No overlap is proved for pairs whose S is at most this, in metres: triple products, and squares of values far below
/// S, underflow there, and with them the errors that they are compared with (docs/trust/bounds.md).
template <class T>
inline constexpr double kLeastOverlapScale = Arithmetic<T>::kCareful ? 1e-63 : 1e-78;

/// View of some faces of a surface from the origin.
template <class T>
struct SurfaceView {
  /// Depth of the origin below the least distant of the faces' planes: the radius of a ball that no triangle enters. 0
  /// or less, or NaN, if there is none.
  T ball = T(__builtin_inf());
  /// The origin sees every triangle certainly from outside, or certainly from inside.
  bool outward = true, inward = true;

  /// For all faces of a closed surface: it goes around the origin.
  CLEARANCE_HD bool one_side() const { return outward || inward; }
};
/// \param w the vertices by number, in axes of a
/// \param first,step the faces of the view
/// \param scale no vertex is farther from the origin
template <class T, class Vertices>
CLEARANCE_HD inline SurfaceView<T> view_surface(const Vertices& w, const CsoFace<T>* faces, std::size_t count,
                                                const T& scale, std::size_t first = 0, std::size_t step = 1) {
  if (!(scale > T(kLeastOverlapScale<T>))) return {T(-1), false, false};
  const T uncertain = T(32 * Arithmetic<T>::kUnit) * scale * scale * scale;
  SurfaceView<T> view;
  T clearly_beyond = view.ball;
  for (std::size_t f = first; f < count; f += step) {
    const Vec3<T>&p = w[faces[f].vertex[0]], &q = w[faces[f].vertex[1]], &r = w[faces[f].vertex[2]];
    const T volume = dot(p, cross(q, r));
    view.outward &= volume > uncertain;
    view.inward &= volume < -uncertain;
    Vec3<T> n = faces[f].normal;
    T nn = squared_norm(n);
    if (!(nn > T(1e-20) && nn < T(1e20))) {
      n = rescaled(n);
      nn = squared_norm(n);
    }
    const T on_p = dot(n, p), on_q = dot(n, q), on_r = dot(n, r);
    T beyond = on_q < on_p ? on_q : on_p;
    beyond = on_r < beyond ? on_r : beyond;
    // also for a NaN, which proves nothing
    if (!(on_p > T(0) && on_q > T(0) && on_r > T(0))) return {T(-1), false, false};
    if (beyond * beyond > clearly_beyond * nn) continue;
    using std::sqrt;
    beyond = beyond / sqrt(nn);
    if (!(beyond >= view.ball)) view.ball = beyond;
    clearly_beyond = view.ball * view.ball * T(1 + 1e-9);
  }
  return view;
}

/// Whether the edges of some faces are twins of others', in opposite senses. If this holds for all faces, the surface
/// has no border.
template <class T>
CLEARANCE_HD inline bool is_closed(const CsoFace<T>* faces, std::size_t count, std::size_t first = 0,
                                   std::size_t step = 1) {
  std::uint32_t wrong = 0;
  for (std::size_t f = first; f < count; f += step)
    for (std::uint32_t e = 0; e < 3; ++e) {
      const std::uint32_t twin = faces[f].twin[e], g = face_of(twin), k = edge_of(twin);
      if (g >= count || k > 2) return false;
      // The twin begins where this edge ends. Its own turn checks that it ends where this one begins.
      wrong |= (faces[g].twin[k] ^ half_edge(static_cast<std::uint32_t>(f), e)) |
               (faces[g].vertex[k] ^ faces[f].vertex[e == 2 ? 0 : e + 1]);
    }
  return wrong == 0 && count > 0;
}

/// Whether a closed surface goes around the ball of radius `ball` that none of its triangles enters. Tests by rays.
template <class T, class Vertices>
CLEARANCE_HD inline bool is_surrounded(const Vertices& w, const CsoFace<T>* faces, std::size_t count, const T& ball) {
  // The origin may lie on a line through two vertices (concentric boxes), where no ray is certain. Every point within
  // the ball has the same winding number as the origin, so one off centre is used, in a direction without pattern.
  const double rays[4][2][3] = {{{0.31, -0.52, 0.79}, {0.732, 0.481, -0.4829}},
                                {{-0.67, 0.23, 0.21}, {-0.377, 0.618, 0.6899}},
                                {{0.19, 0.71, -0.43}, {0.127, -0.911, 0.3923}},
                                {{-0.53, -0.37, -0.59}, {-0.802, -0.2231, -0.554}}};
  for (const auto& ray : rays) {
    const T step = ball * T(0.5);
    const Vec3<T> o = Vec3<T>{T(ray[0][0]), T(ray[0][1]), T(ray[0][2])} * step;
    const Vec3<T> g{T(ray[1][0]), T(ray[1][1]), T(ray[1][2])};
    if (winding(w, faces, count, o, g) != 0) return true;
  }
  return false;
}

/// Proof that a surface goes around a ball around the origin. A team shares the faces.
template <class T, class Team = OneThread>
struct ProvedBall {
  T ball = T(-1);  ///< its radius, axes of a; 0 or less, or NaN, without a proof

  /// \param w,scale as for view_surface()
  template <class Vertices>
  CLEARANCE_HD ProvedBall(const Vertices& w, const CsoFace<T>* faces, std::size_t count, const T& scale) {
    const SurfaceView<T> mine = view_surface(w, faces, count, scale, Team::rank(), Team::kSize);
    const T least = Team::best(Ranked<T>{mine.ball, 0}, [](const Ranked<T>& p, const Ranked<T>& q) {
                      return p.value < q.value;
                    }).value;
    const bool outward = Team::all(mine.outward), inward = Team::all(mine.inward);
    if (!(least > T(0)) || !Team::all(Team::rank() >= count || is_closed(faces, count, Team::rank(), Team::kSize)))
      return;
    if (outward || inward || is_surrounded(w, faces, count, least)) ball = least;
  }
  CLEARANCE_HD explicit operator bool() const { return ball > T(0); }
};

/// Upper bound on the signed distance of two grown parts whose cores' overlap holds a ball.
CLEARANCE_HD inline double upper_of_overlap(double radius_a, double radius_b, double ball) {
  using std::nextafter;
  return nextafter((-(dd::two_sum(radius_a, radius_b) + DoubleDouble(ball))).hi, __builtin_inf());
}

/// The four faces of a tetrahedron with their outward normals; false if one has none.
template <class T>
CLEARANCE_HD inline bool tetrahedron_faces(const Simplex<T>& s, CsoFace<T> (&faces)[4]) {
  const std::uint32_t corners[4][3] = {{0, 1, 2}, {1, 0, 3}, {2, 1, 3}, {0, 2, 3}};
  const std::uint32_t twins[4][3] = {{4, 8, 12}, {0, 14, 9}, {1, 6, 13}, {2, 10, 5}};
  const int opposite[4] = {3, 2, 0, 1};
  for (int f = 0; f < 4; ++f) {
    const Vec3<T>&a = s.vertex[corners[f][0]].w, &b = s.vertex[corners[f][1]].w, &c = s.vertex[corners[f][2]].w;
    Vec3<T> n = cross(b - a, c - a);
    if (dot(n, s.vertex[opposite[f]].w - a) > T(0)) n = -n;
    if (!(squared_norm(n) > T(0))) return false;
    faces[f].normal = n;
    for (int i = 0; i < 3; ++i) {
      faces[f].vertex[i] = corners[f][i];
      faces[f].twin[i] = twins[f][i];
    }
  }
  return true;
}

// Weights that make the origin of four points: barycentric coordinates, those below 0 taken for 0. Returns the squared
// distance by which they miss it. Each round subtracts the miss of the round before, since a single one loses the
// digits of the tetrahedron's aspect.
template <class T>
CLEARANCE_HD inline T weigh_origin(Simplex<T>& s) {
  Vec3<T> slope[4];  // of the i-th coordinate
  for (int i = 0; i < 4; ++i) {
    const Vec3<T>&p = s.vertex[(i + 1) % 4].w, &q = s.vertex[(i + 2) % 4].w, &r = s.vertex[(i + 3) % 4].w;
    const Vec3<T> n = cross(q - p, r - p);
    slope[i] = n * (T(1) / dot(n, s.vertex[i].w - p));
    s.weight[i] = T(0.25);
  }
  const auto missed = [&] {
    Vec3<T> m = s.vertex[0].w * s.weight[0];
    for (int i = 1; i < 4; ++i) m += s.vertex[i].w * s.weight[i];
    return m;
  };
  for (int round = 0; round < 3; ++round) {
    const Vec3<T> m = missed();
    for (int i = 0; i < 4; ++i) s.weight[i] -= dot(slope[i], m);
  }
  T sum = T(0);
  for (T& w : s.weight) {
    if (!(w > T(0))) w = T(0);
    sum += w;
  }
  for (T& w : s.weight) w = w / sum;
  return squared_norm(missed());
}

// The tetrahedron of one vertex and a face of a surface that holds the origin best. Its weights give a common point.
template <class T>
CLEARANCE_HD inline Simplex<T> around_origin(const CsoVertex<T>* vertices, const CsoFace<T>* faces, std::size_t count) {
  Simplex<T> best;
  T least = T(__builtin_inf());
  for (std::size_t k = 0; k < count; ++k) {
    const CsoFace<T>& f = faces[k];
    const std::uint32_t first = faces[0].vertex[0];
    if (f.vertex[0] == first || f.vertex[1] == first || f.vertex[2] == first) continue;  // flat
    Simplex<T> s;
    s.size = 4;
    s.vertex[0] = vertices[first];
    for (int i = 0; i < 3; ++i) s.vertex[i + 1] = vertices[f.vertex[i]];
    if (const T miss = weigh_origin(s); miss < least) {
      least = miss;
      best = s;
    }
  }
  return best;
}

/// Points of both cores given by a simplex, from their bodies' origins in world axes.
/// \param a,b vertices by index
template <class T>
struct CsoPoint {
  Vec3<T> core_a, core_b;
  Vec3<T> w;           ///< the point of the CSO, axes of a
  Vec3<T> separation;  ///< from the core of a to that of b, world axes

  template <class A, class B>
  CLEARANCE_HD CsoPoint(const Simplex<T>& simplex, const Mat3<T>& R_wa, const A& a, const Mat3<T>& R_wb, const B& b) {
    const SimplexPoint<T> point(simplex);
    Vec3<T> on_a{T(0), T(0), T(0)}, on_b = on_a;
    for (int i = 0; i < simplex.size; ++i) {
      on_a += a(simplex.vertex[i].a) * point.share[i];
      on_b += b(simplex.vertex[i].b) * point.share[i];
    }
    core_a = R_wa * on_a;
    core_b = R_wb * on_b;
    w = point.w;
    separation = -(R_wa * w);
  }
};

}  // namespace clearance
