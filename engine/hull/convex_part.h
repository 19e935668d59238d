// A convex part: the convex hull of its vertices, grown by a radius.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/vec.h"

namespace clearance {

struct DirectionTable;  // engine/hull/direction_table.h
struct Primitive;       // engine/hull/primitive.h
class Surface;          // engine/bvh/surface.h

/// Extents of a hull, in metres and the body's frame. Common to parts, lanes and devices.
struct HullExtents {
  Vec3d centre{0, 0, 0};  ///< of the bounding box of the vertices
  Vec3d half{0, 0, 0};    ///< half extents of that box, rounded up; without radius
  double rho = 0;         ///< max |v| from the body's origin, rounded up
  double spread = 0;      ///< max |v - centre|, rounded up
  double radius = 0;      ///< by which it is grown, >= 0

  CLEARANCE_HD const HullExtents& extents() const { return *this; }
};

/// Immutable geometry in the body's frame, metres.
///
/// `vertices` holds every vertex that was loaded except exact duplicates and those proved to lie inside the hull of the
/// rest (hull.h). Bounds refer to this set. Bodies made from the same shape share one `ConvexPart`.
struct ConvexPart : HullExtents {
  std::vector<Vec3d> vertices;        ///< at least one
  std::uint64_t loaded_vertices = 0;  ///< before duplicates and inner vertices were dropped
  std::uint64_t digest = 0;           ///< of the vertices as loaded and the radius; the same on every machine

  /// For supports: the vertices of a small part as a structure of arrays, or the table of a larger one. The arrays are
  /// padded with the first vertex to a multiple of the widest register.
  std::vector<double> x, y, z;
  std::vector<float> x_f32, y_f32, z_f32;       ///< the same relative to `centre`, rounded
  std::shared_ptr<const DirectionTable> table;  ///< null for small parts

  /// The non-convex mesh enclosed by this hull and grown by the same radius, or null. If set, the hull gives lower
  /// bounds only.
  std::shared_ptr<const Surface> surface;

  /// The core in closed form, or null for the hull of `vertices`. If set, these are points of it. Lanes and devices
  /// support hulls only.
  std::shared_ptr<const Primitive> primitive;

  std::uint32_t count() const { return static_cast<std::uint32_t>(vertices.size()); }
};
using ConvexPartPtr = std::shared_ptr<const ConvexPart>;

/// Builds a part with all derived data from its vertices, of which none is dropped. Throws std::invalid_argument
/// without vertices, for a non-finite or too large coordinate, and for a negative or non-finite radius.
/// \param digest of the vertices as loaded; if 0, computed from `vertices` and `radius`
/// \param table the one that an earlier call has made of the same vertices, if it was kept
/// \param surface the mesh whose hull the vertices are
ConvexPartPtr make_convex_part(std::vector<Vec3d> vertices, double radius = 0.0, std::uint64_t loaded_vertices = 0,
                               std::uint64_t digest = 0, std::shared_ptr<const DirectionTable> table = nullptr,
                               std::shared_ptr<const Surface> surface = nullptr);

/// Replaces a temporary small part in place, reusing its memory. It has no digest.
/// \param vertices as for make_convex_part(), at most kTableFromVertices
void remake_part(ConvexPart& part, std::span<const Vec3d> vertices, double radius);

/// A copy with all derived data computed again from its vertices, and without a table. It allows a check of a part
/// whose table or other data may be damaged. Takes time linear in the number of vertices.
ConvexPart without_table(const ConvexPart& part);

/// Memory of a part, its copies and its tree included.
std::uint64_t resident_bytes(const ConvexPart& part);

}  // namespace clearance
