// Two placed pieces in, a certified interval of their signed distance out.
#pragma once

#include <limits>
#include <memory>

#include "engine/narrow/answer.h"
#include "engine/narrow/certify.h"
#include "engine/narrow/lanes.h"
#include "engine/narrow/warm.h"
#include "engine/narrow/work_meter.h"
#include "engine/pose/placed.h"

namespace clearance {

struct NarrowAnswer {
  /// Contains the exact signed distance; if not `signed_distance`, `lower` of overlapping pieces may be -inf.
  Interval bounds{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Vec3d point_a{0, 0, 0};  ///< from the origin of a, world axes, on the grown piece
  Vec3d point_b{0, 0, 0};  ///< from the origin of b, world axes, on the grown piece
  Vec3d normal{0, 0, 0};   ///< unit, from a towards b: the direction that proves bounds.lower
  bool beyond = false;     ///< bounds.lower > max_distance; not refined further
  bool converged = false;  ///< as narrow as asked
  double rounding = 0;     ///< width that float64 bounds of this pair have from rounding alone, metres
};

/// What a pair goes on with that a slice has ended in.
struct PausedPair {
  virtual ~PausedPair() = default;
};

/// Bounds the signed distance of two pieces: float64 first, double-double where float64 cannot make it narrow enough.
/// \param warm read for a first simplex and overwritten with the last one; may be null.
/// \param done a float64 run of GJK on this pair with proved supports (lanes.h), to begin from its end; may be null.
/// \param meter counts the work; may be null. What it throws leaves nothing behind but another `warm`, and `paused`.
/// \param paused null: the pair is answered in one go. Else, where the meter's slice ends within EPA,
/// WorkMeter::PairUnfinished is thrown, and the next call for the same pair goes on there if it is given what this one
/// has left here. The bits of the answer are the same. Null inside: the pair begins.
NarrowAnswer narrow_phase(const Piece& a, const PoseMatrix& pose_a, const Piece& b, const PoseMatrix& pose_b,
                          const NarrowLimits& limits, WarmSimplex* warm = nullptr, const Gjk<double>* done = nullptr,
                          WorkMeter* meter = nullptr, std::unique_ptr<PausedPair>* paused = nullptr);

/// NarrowAnswer::rounding of two placed pieces.
double rounding_of(const Piece& a, const PoseMatrix& pose_a, const Piece& b, const PoseMatrix& pose_b);

/// The witness points and the normal of a pair that was settled in lanes: those of narrow_phase().
void take_lane_witness(const Piece& a, const Mat3d& R_wa, const Piece& b, const Mat3d& R_wb, const LaneWitness& lane,
                       Vec3d& point_a, Vec3d& point_b, Vec3d& normal);

/// The oracle behind the same interface: proved supports and double-double from the start, no cut-off, no seed.
NarrowAnswer narrow_phase_reference(const Piece& a, const PoseMatrix& pose_a, const Piece& b, const PoseMatrix& pose_b,
                                    const NarrowLimits& limits);

}  // namespace clearance
