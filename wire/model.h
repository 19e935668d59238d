// Geometry used to answer a query, shared by the daemon and every client. Values are part of the wire format. Python
// mirrors them in client/python/clearance/_words.py (a test compares the two).
#pragma once

#include <cstdint>

namespace clearance {

/// Geometry used to answer a query.
enum class Model : std::uint8_t {
  kTruth = 0,   ///< the exact geometry
  kPieces = 1,  ///< a mesh's convex parts, if it has any; bounds widen by their deviation from the mesh
};

}  // namespace clearance
