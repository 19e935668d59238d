// One attempt at a pair in one arithmetic: GJK, then EPA for overlaps. Internal to narrow_phase.cpp.
#pragma once

#include <algorithm>
#include <cassert>
#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>

#include "engine/narrow/bounds_collector.h"
#include "engine/narrow/epa.h"
#include "engine/narrow/overlap.h"
#include "engine/narrow/pair_run.h"

namespace clearance {

/// The CSO of two convex parts for GJK and EPA, in the frame of a.
template <class T>
class SupportedCso {
 public:
  SupportedCso(const PlacedPair<T>& pair, WorkMeter* meter)
      : pair_(pair), meter_(meter), units_(kDearer * WorkMeter::units_of(*pair.a, *pair.b)) {}

  CsoSupport<T> operator()(const Vec3<T>& v) const {
    if (meter_) meter_->spend(units_);
    const SupportPoint<T> a = pair_.points_a.farthest(-v);
    const SupportPoint<T> b = pair_.points_b.farthest(pair_.R.transpose_times(v));
    return {vertex(a.index, b.index), -dot(v, pair_.D) - (a.value + b.value)};
  }

  CsoVertex<T> vertex(std::uint32_t ia, std::uint32_t ib) const { return {pair_.cso_vertex(ia, ib), ia, ib}; }

  /// Counts a step of EPA in addition to its support: each vertex adds two faces, and each step scans all faces.
  /// Returns whether the slice is over.
  bool count_step(std::size_t vertices) const {
    if (!meter_) return false;
    meter_->spend(kDearer * (vertices / kVerticesPerUnit));
    return meter_->is_over();
  }

  /// From the centre of b to the centre of a, the centre of the CSO.
  Vec3<T> centre() const { return cast<T>(pair_.a->centre) - pair_.R * cast<T>(pair_.b->centre) - pair_.D; }

 private:
  static constexpr std::uint64_t kDearer = std::is_same_v<T, DoubleDouble> ? 16 : 1, kVerticesPerUnit = 32;

  const PlacedPair<T>& pair_;
  WorkMeter* meter_;
  std::uint64_t units_;
};

template <class T>
GjkLimits<T> gjk_limits(const NarrowLimits& limits, const PlacedPair<T>& pair) {
  GjkLimits<T> g =
      run_limits<T>(limits.abs_tol, limits.rel_tol, pair.radius > T(0), limits.max_distance < RunSetup<T>::kUnbounded);
  g.radius = pair.radius;
  if (g.bounded)
    g.max_distance = T(core_cut_off(limits.max_distance, static_cast<double>(pair.radius), pair.lower_error()));
  g.max_iterations = limits.max_iterations;
  return g;
}

/// Tries the normals of all faces that the last simplex and the last support span. Near contact they are exact where v
/// is not.
template <class T>
void try_face_normals(const PlacedPair<T>& pair, const Gjk<T>& g, BoundsCollector& answer) {
  CsoVertex<T> p[4];
  int n = 0;
  for (int i = 0; i < g.simplex.size && n < 4; ++i) p[n++] = g.simplex.vertex[i];
  if (n < 4 && !std::any_of(p, p + n, [&](const CsoVertex<T>& q) { return same(q, g.last); })) p[n++] = g.last;
  for (int i = 0; i < n; ++i)
    for (int j = i + 1; j < n; ++j)
      for (int k = j + 1; k < n; ++k) {
        Vec3<T> normal = cross(p[j].w - p[i].w, p[k].w - p[i].w);
        if (!(squared_norm(normal) > T(0))) continue;
        if (dot(normal, p[i].w) > T(0)) normal = -normal;
        answer.raise_lower(certify_lower(pair, normal), normal);
        if (answer.converged()) return;
      }
}

/// Tries the nearest points of every vertex, edge and triangle of a few vertices, for simplices of which GJK kept no
/// nearest point.
template <class T>
void try_witnesses(const PlacedPair<T>& pair, const Simplex<T>& s, BoundsCollector& answer) {
  for (int mask = 1; mask < 1 << s.size; ++mask) {
    Simplex<T> part;
    for (int i = 0; i < s.size; ++i)
      if (mask >> i & 1) part.vertex[part.size++] = s.vertex[i];
    const Vec3<T>&p = part.vertex[0].w, &q = part.vertex[1].w, &r = part.vertex[2].w;
    if (part.size == 1) {
      part.weight[0] = T(1);
    } else if (part.size == 2) {
      part.weight[0] = dot(q, q - p);
      part.weight[1] = -dot(p, q - p);
    } else if (part.size == 3) {
      const Vec3<T> n = cross(q - p, r - p);
      part.weight[0] = dot(n, cross(q, r));
      part.weight[1] = dot(n, cross(r, p));
      part.weight[2] = dot(n, cross(p, q));
    } else {
      weigh_origin(part);
    }
    bool inside = true;
    for (int i = 0; i < part.size; ++i) inside = inside && part.weight[i] > T(0);
    if (inside) answer.take_witness(pair, part);
  }
}

template <class T>
void take_overlap(const PlacedPair<T>& pair, std::span<const CsoVertex<T>> vertices, std::span<const CsoFace<T>> faces,
                  const Simplex<T>& nearest, BoundsCollector& answer) {
  const double ball = certify_ball(pair, vertices, faces);
  if (!(ball > 0)) return;
  const Witness witness = certify_upper(
      pair, answer.wants_depth() ? nearest : around_origin<T>(vertices.data(), faces.data(), faces.size()));
  // Rounding left the surface concave, so that its nearest point is far from its nearest plane. Double-double resolves
  // it.
  if (std::is_same_v<T, double> && answer.wants_depth() &&
      witness.length - ball > answer.tolerance(ball) + 2 * pair.upper_error())
    return;
  answer.mark_deep();
  if (!answer.wants_depth() && !(witness.length <= 0.5 * pair.upper_error()) && !pair.is_round())
    answer.keep_surface<T>(vertices, faces);
  answer.lower_upper(pair, certify_overlap(*pair.a, *pair.b, ball), witness, vertices, faces);
}

/// State of a paused EPA, and the answer before it.
template <class T>
struct PausedEpa final : PausedPair {
  PausedEpa(const BoundsCollector& before, const Gjk<T>& g) : answer(before), gjk(g) {}
  BoundsCollector answer;
  Gjk<T> gjk;
  Epa<T> epa;
};
using PausedPairPtr = std::unique_ptr<PausedPair>;

/// Takes a paused EPA in this arithmetic, or null.
template <class T>
std::unique_ptr<PausedEpa<T>> take_paused(PausedPairPtr* paused) {
  auto* const epa = paused ? dynamic_cast<PausedEpa<T>*>(paused->get()) : nullptr;
  if (epa) paused->release();
  return std::unique_ptr<PausedEpa<T>>(epa);
}

/// Limit for the surface around the overlap of a round core. No number of vertices makes it exact, and each step scans
/// all of them. The interval of the depth includes the rest.
constexpr std::size_t kMostRoundVertices = 256;

/// Throws WorkMeter::PairUnfinished.
/// \param resumed the paused EPA to continue, or null to begin
template <class T>
void expand_polytope(const PlacedPair<T>& pair, SupportedCso<T>& cso, const NarrowLimits& limits, const Gjk<T>& g,
                     BoundsCollector& answer, std::unique_ptr<PausedEpa<T>> resumed, PausedPairPtr* paused) {
  EpaLimits e = epa_limits<T>(limits.abs_tol, limits.rel_tol, pair.radius > T(0) && !pair.is_round(), pair.scale);
  if (!limits.signed_distance)
    e.stop_below = 2 * pair.ball_error() + std::max(0.0, limits.min_penetration - static_cast<double>(pair.radius));
  if (pair.is_round()) e.max_vertices = kMostRoundVertices;
  static thread_local Epa<T> epa;
  std::size_t steps = 0;  // one at least, however short the slice is
  const auto pause = [&](std::size_t vertices) { return cso.count_step(vertices) && paused && steps++ > 0; };
  if (resumed) std::swap(epa, resumed->epa);
  if ((resumed ? epa.go_on(cso, pause) : epa.run(cso, e, g.simplex, pause)) == EpaEnd::kPaused) {
    if (!resumed) resumed = std::make_unique<PausedEpa<T>>(answer, g);
    std::swap(epa, resumed->epa);
    *paused = std::move(resumed);
    throw WorkMeter::PairUnfinished();
  }
  if (epa.probed()) answer.raise_lower(certify_lower(pair, epa.gap(), norm(epa.direction())), epa.direction());
  if (!epa.faces().empty()) take_overlap<T>(pair, epa.vertices(), epa.faces(), epa.nearest(), answer);
  if (answer.bounds().upper > 0) {  // no overlap proved: touching or apart, where points prove the most
    if (epa.nearest().size > 0) answer.take_witness(pair, epa.nearest());
    try_witnesses(pair, g.simplex, answer);
  }
}

/// The tetrahedron that GJK ended with, as a surface with outward faces.
template <class T>
void take_tetrahedron(const PlacedPair<T>& pair, const Simplex<T>& s, BoundsCollector& answer) {
  assert(s.size == 4);
  CsoFace<T> faces[4];
  if (!tetrahedron_faces(s, faces)) return;
  take_overlap<T>(pair, std::span<const CsoVertex<T>>(s.vertex, 4), faces, s, answer);
}

/// The simplex with which float64 ended, as vertex indices: double-double begins from it.
struct SeedSimplex {
  std::uint32_t a[3] = {}, b[3] = {};
  int size = 0;
};

template <class T>
Gjk<T> run_gjk(const PlacedPair<T>& pair, const NarrowLimits& limits, SupportedCso<T>& cso, const SeedSimplex& seed) {
  Simplex<T> start;
  for (int i = 0; i < seed.size; ++i) start.vertex[start.size++] = cso.vertex(seed.a[i], seed.b[i]);
  return gjk<T>(cso, first_direction(cso.centre()), start, gjk_limits(limits, pair));
}

/// One attempt in one arithmetic. Returns GJK's last simplex, from which the next attempt begins.
/// \param done a run of GJK on this pair, if there was one already
template <class T>
Simplex<T> attempt(const PlacedPair<T>& pair, const NarrowLimits& limits, const SeedSimplex& seed,
                   BoundsCollector& answer, WorkMeter* meter, PausedPairPtr* paused = nullptr,
                   const Gjk<T>* done = nullptr) {
  SupportedCso<T> cso(pair, meter);
  if (auto resumed = take_paused<T>(paused)) {
    answer = resumed->answer;
    const Gjk<T> g = resumed->gjk;
    expand_polytope(pair, cso, limits, g, answer, std::move(resumed), paused);
    return g.simplex;
  }
  const Gjk<T> g = done ? *done : run_gjk(pair, limits, cso, seed);
  const auto end = static_cast<GjkEnd>(g.end);

  if (end == GjkEnd::kEncloses && g.simplex.size == 4) {
    if (!limits.signed_distance) {
      take_tetrahedron(pair, g.simplex, answer);
      if (answer.converged() && !answer.is_shallow()) return g.simplex;
    }
  } else {
    answer.take_witness(pair, g.simplex);
    if (g.squared_distance > T(Arithmetic<T>::kSafelySquared) && end != GjkEnd::kLimit)
      answer.raise_lower(certify_lower(pair, g.gap, norm(g.v)), -g.v);
    else if (squared_norm(g.v) > T(0))
      answer.raise_lower(certify_lower(pair, -g.v), -g.v);
    if (answer.converged()) return g.simplex;
    try_face_normals(pair, g, answer);
    if (answer.converged() || answer.bounds().lower > 0) return g.simplex;
  }
  expand_polytope<T>(pair, cso, limits, g, answer, nullptr, paused);
  return g.simplex;
}

template <class T>
SeedSimplex seed_of(const Simplex<T>& s) {
  SeedSimplex seed;
  seed.size = std::min(s.size, 3);
  for (int i = 0; i < seed.size; ++i) {
    seed.a[i] = s.vertex[i].a;
    seed.b[i] = s.vertex[i].b;
  }
  return seed;
}

}  // namespace clearance
