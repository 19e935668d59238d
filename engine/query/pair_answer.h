// What bounds of pieces make of a pair of bodies: its answer.
#pragma once

#include "engine/query/evaluate.h"

namespace clearance {

/// The answer of two bodies from what was found of their pieces. \param answer holds the flags of the bodies; the rest
/// is written here. \param rooms for triangles
void finish(const Scene& scene, const PlacedBodies& bodies, const EvaluateOptions& options, const BodiesAnswer& found,
            Piece (&rooms)[2], PairAnswer& answer);

/// The same of single pieces that lanes have settled: apart, and as narrow as asked, near enough or beyond
/// max_distance. First status, bounds and distance ...
void decide_settled(const PlacedBodies& bodies, const EvaluateOptions& options, double lower, double upper,
                    PairAnswer& answer);
/// ... and, where points are wanted and are in the answer by now, what they say.
void finish_settled(const Piece& a, const Mat3d& R_wa, const Piece& b, const Mat3d& R_wb,
                    const EvaluateOptions& options, PairAnswer& answer);

}  // namespace clearance
