// Lower bounds on how far parts of one body are from a part of another, some parts side by side.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/vec.h"
#include "engine/bvh/surface.h"

namespace clearance {

/// What a part of a body lies within, in the body's axes, metres: a box and, of triangles that are nearly flat, two
/// planes normal . x = low and high.
struct PartBounds {
  Vec3d centre{0, 0, 0}, half{0, 0, 0};
  Vec3d normal{0, 0, 0};  ///< no longer than 1 + 2^-14, or 0: there are none
  double low = 0, high = 0;
  std::span<const Vec3d> corners{};  ///< whose hull it is; none: they are not known, or are too many
};

/// Numbers of some parts of one body, side by side.
inline constexpr std::size_t kParts = 4;
using PartColumn = double __attribute__((vector_size(kParts * sizeof(double))));

/// Nodes of a surface, as it has them.
struct NodeColumns {
  using Floats = float __attribute__((vector_size(kParts * sizeof(float))));
  Vec3<Floats> low, high, normal;
  Floats behind, ahead;  ///< of their slabs
  Vec3d centre;          ///< of the surface
  bool have_planes;      ///< or else no slab

  /// \param count at least 1; the last one stands in the others' places
  void take(const Surface& surface, const std::uint32_t* nodes, std::size_t count);
};

/// Some triangles of one body, or points of a cloud.
struct ElementColumns {
  Vec3<PartColumn> corner[3];
  bool are_points;  ///< which have one corner
  double half;      ///< of the boxes about points

  /// \param end no more than kParts behind `begin`; the last one stands in the others' places
  void take(const Surface& surface, std::uint32_t begin, std::uint32_t end);
};

/// How far each reaches along n, from the body's origin.
void part_reaches(const NodeColumns& nodes, const Vec3d& n, PartColumn& reaches);
void part_reaches(const ElementColumns& elements, const Vec3d& n, PartColumn& reaches);

/// How far each is from `other` at least, or less: by both boxes in the axes of the parts' body, along the line of
/// their middles (towards a triangle: to its nearest point) and across the planes of both; docs/bounds.md, "Surfaces".
/// Not below 0.
/// \param R, D take the other body's coordinates to those of the parts' body \param enough where all are farther than
/// this nothing more is found out
void part_gaps(const NodeColumns& nodes, const PartBounds& other, const Mat3d& R, const Vec3d& D, double enough,
               PartColumn& gaps);
void part_gaps(const ElementColumns& elements, const PartBounds& other, const Mat3d& R, const Vec3d& D, double enough,
               PartColumn& gaps);

/// How far each triangle of a (lanes) is from each of b at least, or less: along `n` and the normals of all. Not below
/// 0.
/// \param R, D take b's coordinates to a's \param n directions from a towards b, in the axes of a, of length 1 up to
/// rounding, or 0
void triangle_gaps(const ElementColumns& a, const ElementColumns& b, const Mat3d& R, const Vec3d& D,
                   const Vec3d (&n)[2], PartColumn (&gaps)[kParts]);

}  // namespace clearance
