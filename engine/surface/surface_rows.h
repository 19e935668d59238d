// A surface as lists for whoever is to check it: vertices, each once, and elements that name them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/surface/surface.h"

namespace clearance {

struct SurfaceRows {
  /// Metres, body frame. Of triangles no two are equal, and each but the first of those that hang together shares a
  /// triangle with an earlier one. Those of other elements stand by themselves.
  std::vector<Vec3d> vertices;
  /// Places of corners, those of one element after those of another, in the order of Surface::element().
  std::vector<std::uint32_t> corners;
  std::size_t corners_each = 0;
  std::size_t loaded = 0;  ///< vertices, before they were made to be there once

  std::span<const std::uint32_t> element(std::size_t i) const {
    return std::span(corners).subspan(i * corners_each, corners_each);
  }
};

SurfaceRows surface_rows(const Surface& surface);

}  // namespace clearance
