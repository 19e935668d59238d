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
enum class Convexify : std::uint8_t {
  kHull = 0,       ///< one convex part: the hull of all vertices
  kSubmeshes = 1,  ///< one convex part for each submesh of the file
  kDecompose = 2,  ///< a solid with convex parts as accelerator
  kSurface = 3,    ///< the triangles alone
  kSolid = 4,      ///< the volume that the triangles enclose
  kAuto = 5,       ///< the default: the hull of a convex or an open mesh, otherwise a solid
};

/// Public names, by value.
inline constexpr std::array<std::string_view, 6> kConvexifyWords = {"hull",    "submeshes", "decompose",
                                                                    "surface", "solid",     "auto"};

/// Value of a public name, or nullopt.
constexpr std::optional<Convexify> convexify_of(std::string_view word) {
  for (std::size_t i = 0; i < kConvexifyWords.size(); ++i)
    if (kConvexifyWords[i] == word) return static_cast<Convexify>(i);
  return {};
}
constexpr std::string_view word_of(Convexify convexify) {
  return kConvexifyWords[static_cast<std::size_t>(convexify)];
}

}  // namespace clearance
