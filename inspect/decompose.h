// Convex parts of a mesh file: a library in a separate process proposes them, and the engine proves bounds on their
// error.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

namespace clearance {

struct DecomposeOptions {
  std::string mesh;                ///< a closed mesh
  std::string python = "python3";  ///< interpreter with the package coacd
  double threshold = 0.05;         ///< CoACD's limit on a part's concavity, 0.01 to 1
  int most_pieces = -1;            ///< -1 for no limit
  double seconds = 3600;           ///< time limit of CoACD
  bool keep = false;               ///< prove the existing parts only
  bool quiet = false;              ///< hide CoACD's progress
};

/// Result of a decomposition, in metres.
struct DecomposedMesh {
  std::string file;  ///< of the parts, in the mesh's folder
  std::uint64_t parts = 0, vertices = 0, triangles = 0;
  double inner = 0;         ///< bound on the mesh's distance from the parts
  double outer = 0;         ///< bound on the parts' distance from the solid
  double median_outer = 0;  ///< median of the parts' own bounds
  double size = 0;          ///< diagonal of the mesh's box
  double propose_s = 0, prove_s = 0;
};

/// Writes `FILE.pieces.obj` atomically, proves its bounds and caches the proof. Throws std::runtime_error for a mesh that
/// is not closed, if coacd is missing, fails, times out or is stopped, and for invalid parts.
/// \param stop ends it; may be set from a signal handler
DecomposedMesh decompose(const DecomposeOptions& options, const std::atomic<bool>& stop);

}  // namespace clearance
