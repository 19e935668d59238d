// GJK for many pairs of cores at once, one pair in each SIMD lane. A core is a hull, or round (primitive.h) in float64.
//
// The iteration is that of gjk.h. A lane that ends writes its result and takes the next pair. Pairs of the same two
// hulls scan the same vertices, one vertex at a time for all lanes. Pairs of different hulls search their farthest
// vertices lane by lane, several vertices at a time, and do everything else in parallel. Each float64 lane computes
// exactly the same as a single pair would: the bits depend neither on the instruction set nor on the other lanes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "engine/hull/convex_part.h"
#include "engine/hull/primitive.h"
#include "engine/narrow/gjk/gjk.h"

namespace clearance {

/// A convex part for lanes. Plain pointers, so that files compiled for one instruction set share no code with others.
struct LaneHull : HullExtents {
  const double *x, *y, *z;             ///< (count,) the vertices of a small part
  const float *x_f32, *y_f32, *z_f32;  ///< the same, relative to its centre
  std::size_t count;
  const Vec3d* vertices;  ///< (vertex_count,) of any part
  std::size_t vertex_count;
  const std::uint32_t *cells, *lists;  ///< of a larger part: its DirectionTable
  std::uint32_t grid_bits;
  bool has_table;
  const Primitive* round;  ///< a round core, without vertices but its origin; null for a hull

  explicit LaneHull(const ConvexPart& part);
};

/// Two placed parts, and their own limits.
struct LanePair {
  const LaneHull *a, *b;
  const Mat3d* R_wa;
  const Mat3d* R_wb;
  const Vec3d* t_a;  ///< world, metres
  const Vec3d* t_b;
  double max_distance = std::numeric_limits<double>::infinity();  ///< as in the query; infinite without a cut-off
  double stop_below = -std::numeric_limits<double>::infinity();   ///< as NarrowLimits::stop_below
};

/// Bounds that a lane proves, as in NarrowAnswer and GjkLimits.
struct LaneAnswer {
  double lower, upper;  ///< -inf, +inf without a proof
  bool converged;       ///< apart, and narrow enough, beyond max_distance or near enough: no more work is needed
};

/// The witness of a converged pair, from which Witness is made.
struct LaneWitness {
  Vec3d n;           ///< world axes, towards b: the direction that proves `lower`
  Vec3d separation;  ///< p_b - p_a of the cores, world axes
  double n_length, separation_length;
  std::uint32_t size;
  std::uint32_t a[3], b[3];  ///< the vertices that carry the points
  double share[3];
};
/// The same, with the points of round cores, which vertices do not carry.
struct CoreWitness : LaneWitness {
  Vec3d core_a, core_b;  ///< of round cores: points from their bodies' origins, in their axes
};

struct LaneBatch {
  const LanePair* pairs;
  std::size_t count;        ///< of pairs
  bool same_hulls;          ///< all pairs have the first one's two parts, which are hulls
  double abs_tol, rel_tol;  ///< target width, as in the query
  int max_iterations;
  LaneAnswer* answers;      ///< (pairs,)
  CoreWitness* witnesses;   ///< (pairs,) of converged ones; null if not needed
  Gjk<double>* unresolved;  ///< (pairs,) GJK's last state of unresolved hulls; not written by run_f32
};

/// Whether float32 suits two parts: small hulls, of sizes that it can represent (sizes_fit_f32()).
bool fits_f32(const ConvexPart& a, const ConvexPart& b);

/// The kernels of one instruction set.
struct LaneKernel {
  std::string_view name;  ///< "avx512", "avx2", "baseline"
  int lanes;              ///< float64 pairs in parallel; twice as many in float32
  void (*run)(const LaneBatch&);
  void (*run_f32)(const LaneBatch&);  ///< for parts that fit; converges where float32 bounds suffice
};

/// The kernels that this machine can run, the fastest first.
std::span<const LaneKernel> lane_kernels();
/// The kernel of that name, or the fastest for "auto". Throws std::invalid_argument for an unknown name, and
/// std::runtime_error for an instruction set that this machine lacks.
const LaneKernel& lane_kernel(std::string_view name);

}  // namespace clearance
