// Whether a closed mesh encloses all that its faces go around: winding numbers that cancel leave a part of it hollow.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"

namespace clearance {

class Surface;

/// winding_number() (surface.h), which adds the nodes of the tree that it visits.
int winding_number(const Surface& surface, const Vec3d& p, std::uint64_t* visits);

/// Whether parts of a closed mesh are such that their winding numbers may cancel: they turn both ways, hold almost no
/// volume, or have edges of more than two triangles. Takes time about linear in the mesh's size.
bool windings_may_cancel(std::span<const Vec3d> vertices, std::span<const Triangle> triangles);

/// Why a solid is hollow where its faces go around: a place where faces run both ways, as those of a double-sided mesh,
/// or a part that has volume behind its faces here and in front of them there, as one that is inside out and crosses
/// another. Empty if there is no such place.
///
/// A shell within another that is turned inward is a cavity, and a part that is inside out as a whole is a part:
/// neither is reported. Winding numbers are exact, at points of the faces: several thousand where they may cancel, at
/// least one of each part; 256 elsewhere; fewer where that would take many seconds. Two faces nearer to each other
/// than 2^-16 of the mesh's size count as one.
std::string hollow_place(const Surface& solid);

/// Why triangles, of which there is at least one, are no solid: open_edge() or hollow_place(). Empty if they are one.
std::string why_not_solid(std::span<const Vec3d> vertices, std::span<const Triangle> triangles);

}  // namespace clearance
