// Pairs whose simplex encloses the origin: the proof of overlap, and a common point. Same steps as narrow_phase()
// without depths.
#pragma once

#include "engine/cuda/pair/pair_kernel.cuh"
#include "engine/narrow/overlap.h"

namespace clearance::cuda {

// Returns false if the proof fails or double-double would give a better common point; the CPU then finishes the pair.
// \param vertex_a vertex of a by index
// \param vertex_b vertex of b by index
// \param outer of the pair's slack: the required depth of overlap
template <class VertexA, class VertexB>
__device__ inline bool prove_overlap_of(const PairLimits& q, const HullExtents& a, const VertexA& vertex_a,
                                        const HullExtents& b, const VertexB& vertex_b, const PairFrame<double>& at,
                                        const Enclosed& e, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                                        double outer, PairAnswer& answer) {
  const double scale = pair_scale(at.D, a.rho, b.rho, a.radius + b.radius);

  Simplex<double> s;
  s.size = 4;
  Vec3d w[4];
  for (int i = 0; i < 4; ++i) {
    w[i] = at.cso_vertex(vertex_a(e.a[i]), vertex_b(e.b[i]));
    s.vertex[i] = {w[i], e.a[i], e.b[i]};
  }
  CsoFace<double> faces[4];
  if (!tetrahedron_faces(s, faces)) return false;
  const SurfaceView<double> view = view_surface(w, faces, 4, scale);
  const double ball = view.ball, sure = ball - rounding_error(double(RoundingUnits<double>::kBall), scale);
  if (!(ball > 0) || !(sure > 0)) return false;
  // With a margin, so that the CPU, which rounds differently, also proves it.
  if (outer > 0 && !((sure + a.radius + b.radius) * (1 - 0x1p-40) > outer)) return false;
  if (!view.one_side() && !is_surrounded(w, faces, 4, ball)) return false;

  decide({}, -__builtin_inf(), 0, [] { return 0.0; }, answer);
  if (q.want_nonsmooth) answer.flags |= kFlagNonsmooth;
  if (!q.want_points) return true;
  const Simplex<double> around = around_origin(s.vertex, faces, 4);
  if (around.size == 0) return false;
  const CsoPoint<double> point(around, at_a.rotation(), vertex_a, at_b.rotation(), vertex_b);
  const Vec3d separation = point.separation;
  const double length = norm(point.w), radius = a.radius + b.radius;
  if (!(length <= 0.5 * rounding_error(double(RoundingUnits<double>::kUpper), scale))) return false;
  const double share = radius > 0 ? a.radius / radius : 0.5;
  answer.part_a = answer.part_b = 0;
  answer.point_a = point.core_a + separation * share;
  answer.point_b = point.core_b - separation * (1 - share);
  answer.normal = length > 0 ? separation * (1 / length) : Vec3d{1, 0, 0};
  return true;
}

// The same for two hulls. Not inlined, since few pairs get here.
__device__ __noinline__ inline bool prove_overlap(const ChunkView& c, const HullHead& a, const HullHead& b,
                                                  const Enclosed& e, const BodyPoseRef& at_a, const BodyPoseRef& at_b,
                                                  double outer, PairAnswer& answer) {
  const auto vertices_of = [&](const HullHead& hull) {
    return [&c, first = hull.first](std::uint32_t i) {
      return Vec3d{c.hulls.x[first + i], c.hulls.y[first + i], c.hulls.z[first + i]};
    };
  };
  return prove_overlap_of(c.pair_limits, a, vertices_of(a), b, vertices_of(b), place_pair<double>(at_a, a, at_b, b), e,
                          at_a, at_b, outer, answer);
}

// Outcome of an enclosed pair of single convex parts.
__device__ inline PairOutcome proved(const ChunkView& c, const Enclosed& e, const BodyPoseRef& at_a,
                                     const BodyPoseRef& at_b, double outer, PairAnswer& answer) {
  const HullHead &a = c.hulls.heads[c.hulls.of_body[at_a.body]], &b = c.hulls.heads[c.hulls.of_body[at_b.body]];
  return prove_overlap(c, a, b, e, at_a, at_b, outer, answer) ? PairOutcome::kConverged : PairOutcome::kUnresolved;
}

}  // namespace clearance::cuda
