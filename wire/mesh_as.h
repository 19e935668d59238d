// Kinds of bodies made from a mesh, shared by scenes, the daemon and every client. Values are part of the wire format.
// Python mirrors them in client/python/clearance/_words.py (a test compares the two).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace clearance {

/// Body made from a mesh that need not be convex.
enum class MeshAs : std::uint8_t {
  kHull = 0,     ///< one convex part: the hull of all vertices
  kParts = 1,    ///< one convex part for each submesh of the file
  kAuto = 2,     ///< the default: the hull of a convex or an open mesh, otherwise a solid
  kSurface = 3,  ///< the triangles alone
  kSolid = 4,    ///< the volume that the triangles enclose
};

/// Public names, by value.
inline constexpr std::array<std::string_view, 5> kMeshAsWords = {"hull", "parts", "auto", "surface", "solid"};

/// Value of a public name, or nullopt.
constexpr std::optional<MeshAs> mesh_as_of(std::string_view word) {
  for (std::size_t i = 0; i < kMeshAsWords.size(); ++i)
    if (kMeshAsWords[i] == word) return static_cast<MeshAs>(i);
  return {};
}
constexpr std::string_view word_of(MeshAs mesh_as) {
  return kMeshAsWords[static_cast<std::size_t>(mesh_as)];
}

}  // namespace clearance
