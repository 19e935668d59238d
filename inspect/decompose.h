// Convex pieces for a mesh file: a library proposes them, in a process of its own, and the engine proves how far they
// miss the mesh.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>

namespace clearance {

struct DecomposeOptions {
  std::string mesh;                ///< a closed mesh
  std::string python = "python3";  ///< that has coacd
  double threshold = 0.05;         ///< how concave a piece may be, as CoACD has it: 0.01 to 1
  int most_pieces = -1;            ///< -1: as many as it takes
  double seconds = 3600;           ///< that CoACD may take
  bool keep = false;               ///< prove the pieces that are there, and propose none
  bool quiet = false;              ///< what CoACD says of its progress is not shown
};

/// What came of it. Metres.
struct DecomposedMesh {
  std::string file;  ///< of the pieces, beside the mesh
  std::uint64_t pieces = 0, vertices = 0, triangles = 0;
  double inner = 0;         ///< no point of the mesh is farther from the pieces
  double outer = 0;         ///< no point of a piece is farther from what the mesh encloses
  double median_outer = 0;  ///< of half of the pieces
  double size = 0;          ///< diagonal of the mesh's box
  double propose_s = 0, prove_s = 0;
};

/// Writes FILE.pieces.obj, replacing what was there only by something whole, proves it and keeps the proof in the
/// cache. \param stop set from anywhere, a signal's handler too, ends it. Throws std::runtime_error with a sentence for
/// a mesh that is not closed, no coacd, one that fails, takes too long or was stopped, and pieces that are none.
DecomposedMesh decompose(const DecomposeOptions& options, const std::atomic<bool>& stop);

}  // namespace clearance
