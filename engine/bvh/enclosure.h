// Tests whether a closed mesh encloses all that its faces go around. Winding numbers that cancel leave a part of it
// hollow.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"

namespace clearance {

class Surface;

/// winding_number() (surface.h), which adds the number of visited nodes of the tree to `visits`.
int winding_number(const Surface& surface, const Vec3d& p, std::uint64_t* visits);

/// Whether winding numbers of a closed mesh may cancel: its connected components have both orientations, hold almost no
/// volume, or have edges of more than two triangles. Takes time about linear in the mesh's size.
bool windings_may_cancel(std::span<const Vec3d> vertices, std::span<const Triangle> triangles);

/// Describes a place where a solid is hollow although its faces go around it: faces that run both ways, as in a
/// double-sided mesh, or a component with volume behind some faces and in front of others, such as one that is inside
/// out and crosses another. Empty if there is no such place.
///
/// A shell within another that is turned inward is a cavity, and a component that is inside out as a whole is a valid
/// one: neither is reported. Winding numbers are exact, at points of the faces: several thousand where they may cancel,
/// at least one of each component; 256 elsewhere; fewer where that would take many seconds. Two faces nearer to each
/// other than 2^-16 of the mesh's size count as one.
std::string hollow_place(const Surface& solid);

/// Reason why triangles, at least one, are no solid: open_edge() or hollow_place(). Empty if they are one.
std::string why_not_solid(std::span<const Vec3d> vertices, std::span<const Triangle> triangles);

}  // namespace clearance
