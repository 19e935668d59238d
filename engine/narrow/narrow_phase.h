// Computes a certified interval of the signed distance of two placed convex parts.
#pragma once

#include <limits>
#include <memory>

#include "engine/narrow/answer.h"
#include "engine/narrow/certify.h"
#include "engine/narrow/lanes.h"
#include "engine/narrow/work_meter.h"
#include "engine/pose/placed.h"

namespace clearance {

struct NarrowAnswer {
  /// Contains the exact signed distance. Without `signed_distance`, `lower` of overlapping parts may be -inf.
  Interval bounds{-std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity()};
  Vec3d point_a{0, 0, 0};  ///< from the origin of a, world axes, on the grown part
  Vec3d point_b{0, 0, 0};  ///< from the origin of b, world axes, on the grown part
  Vec3d normal{0, 0, 0};   ///< unit, from a towards b: the direction that proves bounds.lower
  bool beyond = false;     ///< bounds.lower > max_distance; not refined further
  bool converged = false;  ///< within the tolerance
  double rounding = 0;     ///< width that rounding alone gives float64 bounds of this pair, metres
};

/// State for resuming a pair that was interrupted at the end of a time slice.
struct PausedPair {
  virtual ~PausedPair() = default;
};

/// Bounds the signed distance of two parts: in float64 first, and in double-double if float64 is not narrow enough.
/// \param done a float64 run of GJK on this pair with proved supports (lanes.h), to begin from its end; may be null
/// \param meter counts the work; may be null. After one of its exceptions only `paused` has changed
/// \param paused null to answer the pair without interruption. Otherwise, if the meter's slice ends within EPA,
/// WorkMeter::PairUnfinished is thrown, and the next call for the same pair resumes from the state left here. The bits
/// of the answer are the same. A null pointer inside begins the pair
NarrowAnswer narrow_phase(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                          const NarrowLimits& limits, const Gjk<double>* done = nullptr, WorkMeter* meter = nullptr,
                          std::unique_ptr<PausedPair>* paused = nullptr);

/// NarrowAnswer::rounding of two placed parts.
double rounding_of(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b);

/// Witness points and normal of a pair that converged in lanes, as narrow_phase() computes them.
void take_lane_witness(const ConvexPart& a, const Mat3d& R_wa, const ConvexPart& b, const Mat3d& R_wb,
                       const CoreWitness& lane, Vec3d& point_a, Vec3d& point_b, Vec3d& normal);

/// The oracle with the same interface: proved supports and double-double from the start, no cut-off, no seed.
NarrowAnswer narrow_phase_reference(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                    const PoseMatrix& pose_b, const NarrowLimits& limits);

}  // namespace clearance
