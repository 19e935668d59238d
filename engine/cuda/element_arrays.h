// A surface's elements as they lie in a device's memory, made on the host.
#pragma once

#include <span>
#include <vector>

#include "engine/device/layout.h"
#include "engine/surface/surface.h"

namespace clearance::cuda {

static_assert(sizeof(ElementNode) == sizeof(Surface::Node) && Surface::kLeafElements == 4);
static_assert(sizeof(ElementSlab) == sizeof(Surface::Slab) && Surface::Slab::kUnit == 0x1p-14);

/// The arrays of an ElementSet.
struct ElementArrays {
  std::span<const Surface::Node> nodes;
  std::span<const Surface::Slab> slabs;  ///< of a mesh
  std::span<const CloudPoint> points;    ///< of a cloud
  std::vector<double> corners;           ///< of a mesh
  ElementSet set{};                      ///< but for what says where the arrays are, and of which body they are

  /// \param surface must outlive this
  explicit ElementArrays(const Surface& surface)
      : nodes(surface.nodes()), slabs(surface.slabs()), points(surface.points()) {
    set.centre = surface.centre();
    set.half = 0.5 * double{surface.edge()};
    set.reach = set.half + surface.rounding();
    set.is_solid = surface.is_solid();
    if (surface.is_cloud()) return;
    corners.reserve(std::size_t{surface.size()} * 9);
    for (std::uint32_t i = 0; i < surface.size(); ++i)
      for (int axis = 0; axis < 3; ++axis)
        for (const Vec3d& corner : surface.corners(i)) corners.push_back(corner[axis]);
  }
};

}  // namespace clearance::cuda
