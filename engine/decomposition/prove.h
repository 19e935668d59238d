// How far convex pieces that somebody proposes may miss a surface or solid: proved, whatever was proposed.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/bvh/surface.h"
#include "engine/hull/decomposition.h"

namespace clearance {

/// How long to look. It is counted, not timed, so that the outcome is the same on every machine.
struct ProofEffort {
  /// Bounds are narrowed until they are no more than this share of themselves above a distance that was met,
  double share = 0.1;
  /// or this share of the body's size (what is near by less than the inner bound has to be asked of triangles),
  double inner_of_size = 0x1p-17, outer_of_size = 0x1p-11;
  /// or until so many distances were asked for: for the inner bound, and for each piece's outer one. About 1 us each.
  std::uint64_t inner_questions = 2'000'000, outer_questions = 200'000;
};

/// A bound and what it is held against, metres.
struct ProvedLength {
  double bound = 0;  ///< rounded up
  double met = 0;    ///< about as far as the farthest point is that was looked at: the bound cannot be less
};

/// No point of the triangles is farther from the union of the pieces' cores. \param pieces at least one
ProvedLength prove_inner(const Surface& truth, std::span<const PiecePtr> pieces, const ProofEffort& effort = {});

/// No point of the piece's core is farther from the surface, or from what a solid encloses.
ProvedLength prove_outer(const Surface& truth, const Piece& piece, const ProofEffort& effort = {});

/// What was proved of a proposal, and beside what was met.
struct ProvedDecomposition {
  Decomposition decomposition;
  double inner_met = 0, outer_met = 0;
};

/// Makes a decomposition of proposed pieces. \param proposed the vertices of each. Throws std::invalid_argument where
/// there is no piece, or one without vertices or with a coordinate that is not finite or too large: it names the piece.
/// Pieces that are wrong otherwise have large bounds.
ProvedDecomposition prove_decomposition(const Surface& truth, std::span<const std::vector<Vec3d>> proposed,
                                        const ProofEffort& effort = {});

}  // namespace clearance
