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
  bool lower_in_double_double = false, upper_in_double_double = false;
  /// Either the witness points, of up to four vertices, or (with faces) a closed surface of CSO triangles.
  std::vector<ProofVertex> vertices;
  std::vector<ProofFace> faces;
  /// Of a round core what `vertices` name: points of it up to rounding, its own axes. Else none.
  std::vector<Vec3<DoubleDouble>> points_a, points_b;
};

/// narrow_phase() from nothing, in one go: the same bits, and what proves them.
NarrowAnswer narrow_phase_proved(const Piece& a, const PlacedPose& pose_a, const Piece& b, const PlacedPose& pose_b,
                                 const NarrowLimits& limits, NarrowProof& proof);

/// The lower bound that a direction proves, in double-double. \param n_w world axes, from a towards b
double lower_along(const Piece& a, const PlacedPose& pose_a, const Piece& b, const PlacedPose& pose_b, const Vec3d& n_w,
                   NarrowProof& proof);

}  // namespace clearance
