// Bodies that are the hulls of meshes that are not convex, and why: what is to be said of them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/scene.h"

namespace clearance {

/// A body whose pieces stand out of its mesh by more than this share of its size is warned about.
inline constexpr double kHullExcessShare = 0.02;

/// Of a body whose mesh is not what its pieces are.
struct HullWarning {
  std::uint32_t body;  ///< its id
  std::string text;    ///< with figures and, of an open mesh, the file and an edge
};
/// Those among the bodies from `first` on, by id. Bodies of one mesh are looked at once.
std::vector<HullWarning> hull_warnings(const Scene& scene, std::uint32_t first = 0);

/// The text for one body; empty where there is nothing to be said. Takes time about linear in its mesh's size.
std::string hull_warning(const Body& body);

}  // namespace clearance
