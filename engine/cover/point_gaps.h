// Distances of eight points from an obstacle, in plain loops. GCC vectorises them with -fno-math-errno, for the square
// roots, and -fno-trapping-math, for the comparisons; neither changes a result.
#pragma once

#include "engine/cover/obstacle.h"

// GCC must not unroll loops of eight rounds before it vectorises them.
#if defined(__GNUC__) && !defined(__clang__)
#define CLEARANCE_LANES _Pragma("GCC unroll 1")
#else
#define CLEARANCE_LANES
#endif

namespace clearance {

namespace point_gaps_detail {

/// A number for each of eight points.
struct GapLanes {
  alignas(32) float at[8];
};

CLEARANCE_INLINE float larger(float a, float b) {
  return a > b ? a : b;
}
CLEARANCE_INLINE float lesser(float a, float b) {
  return a < b ? a : b;
}
CLEARANCE_INLINE float magnitude(float a) {
  return __builtin_fabsf(a);
}
CLEARANCE_INLINE float root(float a) {
  return __builtin_sqrtf(a);
}

/// Signed distance of a point, in the core's axes, from the core.
/// \tparam T a number, or numbers side by side
template <class T>
CLEARANCE_INLINE T core_gap(Obstacle::Kind kind, const float (&half)[3], const T& x, const T& y, const T& z) {
  if (kind == Obstacle::Kind::kHalfSpace) return z;
  const T zero(0.0f), beyond_z = magnitude(z) - T(half[2]), out_z = larger(beyond_z, zero);
  if (kind == Obstacle::Kind::kSegment) return root(x * x + y * y + out_z * out_z);
  if (kind == Obstacle::Kind::kCylinder) {
    const T beyond = root(x * x + y * y) - T(half[0]), out = larger(beyond, zero);
    return root(out * out + out_z * out_z) + lesser(larger(beyond, beyond_z), zero);
  }
  const T beyond_x = magnitude(x) - T(half[0]), out_x = larger(beyond_x, zero);
  const T beyond_y = magnitude(y) - T(half[1]), out_y = larger(beyond_y, zero);
  return root(out_x * out_x + out_y * out_y + out_z * out_z) +
         lesser(larger(larger(beyond_x, beyond_y), beyond_z), zero);
}

template <Obstacle::Kind kKind>
CLEARANCE_INLINE void exact_gaps(const Obstacle& o, const float (&x)[8], const float (&y)[8], const float (&z)[8],
                                 PointGaps& gaps) {
  const float at[3] = {o.at[0], o.at[1], o.at[2]}, half[3] = {o.half[0], o.half[1], o.half[2]}, radius = o.radius;
  GapLanes gap;
  if (o.is_aligned) {
    CLEARANCE_LANES
    for (int k = 0; k < 8; ++k) gap.at[k] = core_gap(kKind, half, x[k] - at[0], y[k] - at[1], z[k] - at[2]) - radius;
  } else {
    float m[9];
    for (int k = 0; k < 9; ++k) m[k] = o.axes[static_cast<std::size_t>(k)];
    CLEARANCE_LANES
    for (int k = 0; k < 8; ++k) {
      const float dx = x[k] - at[0], dy = y[k] - at[1], dz = z[k] - at[2];
      gap.at[k] = core_gap(kKind, half, m[0] * dx + m[1] * dy + m[2] * dz, m[3] * dx + m[4] * dy + m[5] * dz,
                           m[6] * dx + m[7] * dy + m[8] * dz) -
                  radius;
    }
  }
  CLEARANCE_LANES
  for (int k = 0; k < 8; ++k) gaps.low[k] = gaps.high[k] = gap.at[k];
}

/// On the segment to `at`, the heights over the planes sink to those of `at`: where all are 0, it enters the core.
CLEARANCE_INLINE void gaps_of_planes(const Obstacle& o, const float (&x)[8], const float (&y)[8], const float (&z)[8],
                                     PointGaps& gaps) {
  GapLanes low, above, high;
  CLEARANCE_LANES
  for (int k = 0; k < 8; ++k) low.at[k] = above.at[k] = -1e30f;
  const std::size_t count = o.outer.size();
  for (std::size_t i = 0; i < count; ++i) {
    const float nx = o.normal_x[i], ny = o.normal_y[i], nz = o.normal_z[i], outer = o.outer[i], inner = o.inner[i];
    CLEARANCE_LANES
    for (int k = 0; k < 8; ++k) {
      const float height = nx * x[k] + ny * y[k] + nz * z[k];
      low.at[k] = larger(height - outer, low.at[k]);
      above.at[k] = larger(height - inner, above.at[k]);
    }
  }
  const float at[3] = {o.at[0], o.at[1], o.at[2]}, radius = o.radius;
  const float inner_radius = o.inner_radius, outer_radius = o.outer_radius;
  CLEARANCE_LANES
  for (int k = 0; k < 8; ++k) {
    const float dx = x[k] - at[0], dy = y[k] - at[1], dz = z[k] - at[2], up = larger(above.at[k], 0.0f);
    const float way = root(dx * dx + dy * dy + dz * dz);
    low.at[k] = larger(low.at[k], way - outer_radius) - radius;
    high.at[k] = way * up / (up + inner_radius) + lesser(above.at[k], 0.0f) - radius;
  }
  CLEARANCE_LANES
  for (int k = 0; k < 8; ++k) {
    gaps.low[k] = low.at[k];
    gaps.high[k] = high.at[k];
  }
}

}  // namespace point_gaps_detail

/// Bounds on the distances of eight points, in the common frame and within the reach for which the obstacle was made.
CLEARANCE_INLINE void point_gaps(const Obstacle& obstacle, const float (&x)[8], const float (&y)[8],
                                 const float (&z)[8], PointGaps& gaps) {
  using namespace point_gaps_detail;
  using Kind = Obstacle::Kind;
  switch (obstacle.kind) {
    case Kind::kSegment:
      return exact_gaps<Kind::kSegment>(obstacle, x, y, z, gaps);
    case Kind::kBox:
      return exact_gaps<Kind::kBox>(obstacle, x, y, z, gaps);
    case Kind::kCylinder:
      return exact_gaps<Kind::kCylinder>(obstacle, x, y, z, gaps);
    case Kind::kHalfSpace:
      return exact_gaps<Kind::kHalfSpace>(obstacle, x, y, z, gaps);
    case Kind::kPlanes:
      return gaps_of_planes(obstacle, x, y, z, gaps);
    case Kind::kCloud:  // engine/decision/kernel/cloud_gaps.h
      return;
  }
}

}  // namespace clearance
