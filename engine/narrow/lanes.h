// GJK for many pairs of hulls at once, one pair in each SIMD lane.
//
// The iteration is gjk.h's; what is added is how lanes are filled: a lane that ends hands its result out and takes the
// next pair. Pairs of the same two hulls walk the same vertices, a vertex at a time for all lanes. Pairs of different
// hulls look for their farthest vertices lane after lane, several vertices at a time, and do everything else side by
// side. Each float64 lane computes exactly what one pair alone would: the bits do not depend on the instruction set or
// the neighbours.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "engine/hull/piece.h"
#include "engine/narrow/gjk.h"
#include "engine/narrow/warm.h"

namespace clearance {

/// A piece as lanes see it: plain pointers, so that files compiled for one instruction set share no code with others.
struct LaneHull : HullExtents {
  const double *x, *y, *z;             ///< (count,) the vertices of a small piece
  const float *x_f32, *y_f32, *z_f32;  ///< the same relative to its centre
  std::size_t count;
  const Vec3d* vertices;  ///< (vertex_count,) of any piece
  std::size_t vertex_count;
  const std::uint32_t *cells, *lists;  ///< of a larger piece: its DirectionTable
  std::uint32_t grid_bits;
  bool has_table;

  explicit LaneHull(const Piece& piece);
};

/// Two pieces, where they are, and what is asked of them alone.
struct LanePair {
  const LaneHull *a, *b;
  const Mat3d* R_wa;
  const Mat3d* R_wb;
  const Vec3d* t_a;  ///< world, metres
  const Vec3d* t_b;
  double max_distance = std::numeric_limits<double>::infinity();  ///< as in the query; infinite: no cut-off
  WarmSimplex* warm = nullptr;  ///< read for a first simplex and overwritten with the last one; may be null
  double stop_below = -std::numeric_limits<double>::infinity();  ///< as NarrowLimits::stop_below
};

/// What a lane proves, in the words of NarrowAnswer and GjkLimits.
struct LaneAnswer {
  double lower, upper;  ///< -inf, +inf where nothing is proved yet
  bool converged;       ///< apart, and as narrow as asked, beyond max_distance or near enough: no need to look further
};

/// The witness of a settled pair: what Witness is made from.
struct LaneWitness {
  Vec3d n;           ///< world axes, towards b: the direction that proves `lower`
  Vec3d separation;  ///< p_b - p_a of the cores, world axes
  double n_length, separation_length;
  std::uint32_t size;
  std::uint32_t a[3], b[3];  ///< the vertices that carry the points
  double share[3];
};

struct LaneBatch {
  const LanePair* pairs;
  std::size_t count;        ///< of pairs
  bool same_hulls;          ///< all pairs are of the first one's two hulls
  double abs_tol, rel_tol;  ///< wanted width, as in the query
  int max_iterations;
  LaneAnswer* answers;      ///< (pairs,)
  LaneWitness* witnesses;   ///< (pairs,) of the settled ones; null: not wanted
  Gjk<double>* unresolved;  ///< (pairs,) GJK's last state where the answer is not settled; not written by run_f32
};

/// Whether float32 can be tried on two pieces: small ones, of sizes that it holds (sizes_fit_f32()).
bool fits_f32(const Piece& a, const Piece& b);

/// One instruction set's version.
struct LaneKernel {
  std::string_view name;  ///< "avx512", "avx2", "baseline"
  int lanes;              ///< float64 pairs side by side; twice as many in float32
  void (*run)(const LaneBatch&);
  void (*run_f32)(const LaneBatch&);  ///< of pieces that fit: settles what float32 bounds can settle
};

/// The versions that this machine can run, the fastest first.
std::span<const LaneKernel> lane_kernels();
/// The one of that name; "auto": the fastest. Throws std::invalid_argument for an unknown name, std::runtime_error for
/// an instruction set that this machine lacks.
const LaneKernel& lane_kernel(std::string_view name);

}  // namespace clearance
