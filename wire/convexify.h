// What the body of a mesh is: a word that scenes, the daemon and every client share. Values are part of the wire
// format. Python mirrors them in client/python/clearance/_words.py (a test compares the two).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace clearance {

/// What the body of a mesh that need not be convex is.
enum class Convexify : std::uint8_t {
  kHull = 0,       ///< one piece: the hull of all its vertices
  kSubmeshes = 1,  ///< one piece for each submesh of the file
  kDecompose = 2,  ///< approximate convex decomposition
  kSurface = 3,    ///< its triangles are the body
  kSolid = 4,      ///< what its triangles enclose is the body
  kAuto = 5,       ///< the default: a convex mesh is its hull, another closed one a solid, an open one its hull
};

/// What users call them, by value.
inline constexpr std::array<std::string_view, 6> kConvexifyWords = {"hull",    "submeshes", "decompose",
                                                                    "surface", "solid",     "auto"};

/// The value of a word; nothing for any other text.
constexpr std::optional<Convexify> convexify_of(std::string_view word) {
  for (std::size_t i = 0; i < kConvexifyWords.size(); ++i)
    if (kConvexifyWords[i] == word) return static_cast<Convexify>(i);
  return {};
}
constexpr std::string_view word_of(Convexify convexify) {
  return kConvexifyWords[static_cast<std::size_t>(convexify)];
}

}  // namespace clearance
