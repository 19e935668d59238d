// By what bodies are answered: a word of queries that the daemon and every client share. Values are part of the wire
// format. Python mirrors them in client/python/clearance/_words.py (a test compares the two).
#pragma once

#include <cstdint>

namespace clearance {

/// By what a query's bodies are answered.
enum class Model : std::uint8_t {
  kTruth = 0,   ///< what they are
  kPieces = 1,  ///< convex pieces that stand for a mesh, where there are any: wider by how far these may miss it
};

}  // namespace clearance
