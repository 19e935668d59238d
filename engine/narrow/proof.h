// What proves a pair's interval, so that somebody else can check it: kept where the bounds are made, and only for
// whoever asks for it. docs/certificates.md says how it is checked.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/narrow/narrow_phase.h"

namespace clearance {

/// Two vertices by their places in their pieces, or in the proof's points: one of the CSO.
struct ProofVertex {
  std::uint32_t a, b;
  DoubleDouble share;  ///< of the witness points, >= 0; they add up to 1 up to rounding. Of a surface: 0
};
/// A triangle of a surface, and a direction that it lies beyond the origin along: axes of a, any length.
struct ProofFace {
  std::uint32_t vertex[3];
  Vec3<DoubleDouble> normal;
};

/// What proves the two bounds of NarrowAnswer, each in the arithmetic that made it.
struct NarrowProof {
  Vec3<DoubleDouble> direction{0, 0, 0};  ///< axes of a, from a towards b, any length; zero: nothing proves `lower`
  bool is_against_b = false;  ///< the direction is the z axis of b turned round, exactly, and only rounded here
  bool lower_in_double_double = false, upper_in_double_double = false;
  /// Either the witness points, of up to four vertices, or (with faces) a closed surface of CSO triangles.
  std::vector<ProofVertex> vertices;
  std::vector<ProofFace> faces;
  /// Of a core in closed form what `vertices` name: points of it up to rounding, its own axes. Else none.
  std::vector<Vec3<DoubleDouble>> points_a, points_b;
};

/// narrow_phase() from nothing, in one go, and what proves it: the same bits, but of half-spaces, of which only bounds
/// are there, those of plane_proved().
NarrowAnswer narrow_phase_proved(const Piece& a, const PoseMatrix& pose_a, const Piece& b, const PoseMatrix& pose_b,
                                 const NarrowLimits& limits, NarrowProof& proof);

/// What proves the bounds of a half-space and another piece, in either arithmetic: its plane's normal, and how high the
/// other's lowest point is. Of two half-spaces nothing is proved.
Interval plane_proved(const Piece& a, const PoseMatrix& pose_a, const Piece& b, const PoseMatrix& pose_b,
                      NarrowProof& proof);

/// The lower bound that a direction proves, in double-double. \param n_w world axes, from a towards b; a half-space's
/// own normal takes its place
double lower_along(const Piece& a, const PoseMatrix& pose_a, const Piece& b, const PoseMatrix& pose_b, const Vec3d& n_w,
                   NarrowProof& proof);

}  // namespace clearance
