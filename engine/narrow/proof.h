// Proof of a pair's interval for an independent check. It is kept where the bounds are made, and only on request.
// docs/trust/certificates.md describes the check.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/narrow/narrow_phase.h"

namespace clearance {

/// A vertex of the CSO: two vertices by their indices in their parts, or in the proof's points.
struct ProofVertex {
  std::uint32_t a, b;
  DoubleDouble share;  ///< of the witness points, >= 0, with sum 1 up to rounding; 0 for a surface
};
/// A triangle of a surface, and a direction along which it lies beyond the origin: axes of a, any length.
struct ProofFace {
  std::uint32_t vertex[3];
  Vec3<DoubleDouble> normal;
};

/// Proof of both bounds of NarrowAnswer, each in the arithmetic that made it.
struct NarrowProof {
  Vec3<DoubleDouble> direction{0, 0, 0};  ///< axes of a, from a towards b, any length; zero if `lower` has no proof
  bool is_against_b = false;              ///< the direction is exactly the reversed z axis of b, rounded only here
  bool lower_in_double_double = false, upper_in_double_double = false;
  /// Either the witness points, of up to four vertices, or (with faces) a closed surface of CSO triangles.
  std::vector<ProofVertex> vertices;
  std::vector<ProofFace> faces;
  /// Points of a core in closed form, up to rounding and in its own axes, that `vertices` index. Empty for other cores.
  std::vector<Vec3<DoubleDouble>> points_a, points_b;
};

/// narrow_phase() with its proof, from a cold start and without slices. The bits are the same. Half-spaces give the
/// bounds of plane_proved() alone.
NarrowAnswer narrow_phase_proved(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b,
                                 const PoseMatrix& pose_b, const NarrowLimits& limits, NarrowProof& proof);

/// Proves the bounds of a half-space and another part, in either arithmetic, from the plane's normal and the height of
/// the other's lowest point. Proves nothing for two half-spaces.
Interval plane_proved(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                      NarrowProof& proof);

/// Lower bound that a direction proves, in double-double.
/// \param n_w world axes, from a towards b; for a half-space, its own normal is used instead
double lower_along(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
                   const Vec3d& n_w, NarrowProof& proof);

}  // namespace clearance
