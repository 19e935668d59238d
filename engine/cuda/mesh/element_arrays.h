// A surface's elements in the layout of device memory, built on the host.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "engine/bvh/surface.h"
#include "engine/device/reduced_layout.h"

namespace clearance::cuda {

static_assert(sizeof(ElementNode) == sizeof(Surface::Node) && Surface::kLeafElements == 4);
static_assert(sizeof(ElementSlab) == sizeof(Surface::Slab) && Surface::Slab::kUnit == 0x1p-14);

/// The arrays of an ElementSet.
struct ElementArrays {
  std::span<const Surface::Node> nodes;
  std::span<const Surface::Slab> slabs;  ///< of a mesh
  std::span<const CloudPoint> points;    ///< of a cloud
  std::vector<double> corners;           ///< of a mesh
  std::vector<std::uint32_t> parts;      ///< of a mesh
  ElementSet set{};                      ///< complete except for the array pointers and the body

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
    // One triangle per connected part: the first one at the vertex that the surface names.
    std::vector<std::uint8_t> stands(surface.vertices().size(), 0);
    for (const std::uint32_t vertex : surface.parts()) stands[vertex] = 1;
    for (std::uint32_t i = 0; i < surface.size(); ++i)
      for (const std::uint32_t vertex : surface.triangles()[i])
        if (std::exchange(stands[vertex], std::uint8_t{0})) parts.push_back(i);
    set.part_count = static_cast<std::uint32_t>(parts.size());
  }
};

}  // namespace clearance::cuda
