// Shorter paths from a path.
#pragma once

#include <clearance/edge_prover.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace clearance {

/// Shortens a path: leaves out waypoints, then tries straight motions between random points of it. Every motion of the
/// result is proved free.
/// \param path (N, J), of motions that are proved free
/// \param tries number of random shortcuts
/// \param[in,out] edges counts the motions that are tried
void shorten(std::vector<double>& path, std::size_t joints, EdgeProver& prover, std::uint32_t tries, std::uint64_t seed,
             std::uint64_t& edges);

}  // namespace clearance
