// Proves how far proposed convex parts may deviate from a surface or solid. Any proposal is valid.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/bvh/surface.h"
#include "engine/hull/decomposition.h"

namespace clearance {

/// Effort of a proof. It is counted, not timed, so that the result is the same on every machine.
struct ProofEffort {
  /// Bounds are refined until they exceed a distance that was found by at most this share of themselves,
  double share = 0.1;
  /// or this share of the body's size (elements nearer than the inner bound need an exact test),
  double inner_of_size = 0x1p-17, outer_of_size = 0x1p-11;
  /// or until this number of distances: for the inner bound, and for each part's outer one. About 1 us each.
  std::uint64_t inner_distances = 2'000'000, outer_distances = 200'000;
};

/// A bound and the distance it was compared with, metres.
struct ProvedLength {
  double bound = 0;  ///< rounded up
  double met = 0;    ///< about the distance of the farthest point tested: the bound cannot be less
};

/// Bound on the distance of the triangles from the union of the parts' cores.
/// \param exact_value the mesh
/// \param parts at least one
ProvedLength prove_inner(const Surface& exact_value, std::span<const ConvexPartPtr> parts,
                         const ProofEffort& effort = {});

/// Bound on the distance of the part's core from the surface, or from the volume of a solid.
ProvedLength prove_outer(const Surface& exact_value, const ConvexPart& part, const ProofEffort& effort = {});

/// A proved decomposition, and the distances found.
struct ProvedDecomposition {
  Decomposition decomposition;
  double inner_met = 0, outer_met = 0;
};

/// Proves proposed convex parts as a decomposition; wrong parts just get large bounds. Throws std::invalid_argument,
/// with the part's index, if there is no part, or one without vertices or with a coordinate that is not finite or too
/// large.
/// \param proposed the vertices of each
ProvedDecomposition prove_decomposition(const Surface& exact_value, std::span<const std::vector<Vec3d>> proposed,
                                        const ProofEffort& effort = {});

}  // namespace clearance
