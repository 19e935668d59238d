// A convex piece: the convex hull of all its vertices, grown by a radius.
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

/// What a hull says of itself without its vertices: metres, in the body's frame. Whoever holds a hull has it: a piece,
/// lanes, a device.
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
/// rest (hull.h). Bounds are stated for this set. Bodies made from the same shape share one Piece.
struct Piece : HullExtents {
  std::vector<Vec3d> vertices;        ///< at least one
  std::uint64_t loaded_vertices = 0;  ///< before duplicates and inner vertices were dropped
  std::uint64_t digest = 0;           ///< of the vertices as loaded and the radius; the same on every machine

  /// For supports: a structure-of-arrays copy of the vertices of a small piece, the table of a larger one. The arrays
  /// are padded with the first vertex to a multiple of the widest register.
  std::vector<double> x, y, z;
  std::vector<float> x_f32, y_f32, z_f32;       ///< the same relative to `centre`, rounded
  std::shared_ptr<const DirectionTable> table;  ///< null for small pieces

  /// What the piece stands for where that is not convex: then it is only the hull around it, which says how near it may
  /// be and not how near it is. Grown by the same radius. Null: the piece is the truth.
  std::shared_ptr<const Surface> surface;

  /// What the core is, if not the hull of `vertices`: these then are points of it. Null: that hull. Lanes and devices
  /// know hulls alone.
  std::shared_ptr<const Primitive> primitive;

  std::uint32_t count() const { return static_cast<std::uint32_t>(vertices.size()); }
};
using PiecePtr = std::shared_ptr<const Piece>;

/// Builds a piece and all that is derived from it. Vertices as they come: nothing is dropped here.
/// \param digest of the vertices as loaded; 0: of `vertices` and `radius`. \param table the one that an earlier call
/// has made of the same vertices, if it was kept. \param surface that the vertices are the hull of. Throws
/// std::invalid_argument for no vertex, a non-finite or too large coordinate, or a negative or non-finite radius.
PiecePtr make_piece(std::vector<Vec3d> vertices, double radius = 0.0, std::uint64_t loaded_vertices = 0,
                    std::uint64_t digest = 0, std::shared_ptr<const DirectionTable> table = nullptr,
                    std::shared_ptr<const Surface> surface = nullptr);

/// Makes a small piece in place of another, in the memory that it has: without digest, for the moment. \param vertices
/// as make_piece() has them, at most kTableFromVertices
void remake_piece(Piece& piece, std::span<const Vec3d> vertices, double radius);

/// A copy whose derived numbers are made anew from its vertices, which are scanned whatever their number: to find out
/// what is true of a piece where its table, or another of them, may be damaged. Takes as long as the vertices are many.
Piece without_table(const Piece& piece);

/// Memory that a piece holds, its copies and its tree included.
std::uint64_t resident_bytes(const Piece& piece);

}  // namespace clearance
