// Lower bounds on the distance of several parts of one body from a part of another, in SIMD columns.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "engine/base/vec.h"
#include "engine/bvh/surface.h"

namespace clearance {

/// Bounds of a part of a body, in the body's axes and metres: a box and, for nearly flat triangles, two planes normal .
/// x = low and high.
struct PartBounds {
  Vec3d centre{0, 0, 0}, half{0, 0, 0};
  Vec3d normal{0, 0, 0};  ///< no longer than 1 + 2^-14; 0 without planes
  double low = 0, high = 0;
  std::span<const Vec3d> corners{};  ///< whose hull it is; empty if unknown or too many
};

/// Values for several parts of one body.
inline constexpr std::size_t kPartLanes = 4;
using PartColumn = double __attribute__((vector_size(kPartLanes * sizeof(double))));

/// Nodes of a mesh, in its own precision.
struct NodeColumns {
  using Floats = float __attribute__((vector_size(kPartLanes * sizeof(float))));
  Vec3<Floats> low, high, normal;
  Floats behind, ahead;  ///< of their slabs
  Vec3d centre;          ///< of the mesh
  bool have_planes;      ///< false without slabs

  /// \param count at least 1; the last node fills the remaining columns
  void take(const Surface& surface, const std::uint32_t* nodes, std::size_t count);
};

/// Some triangles of one body, or points of a cloud.
struct ElementColumns {
  Vec3<PartColumn> corner[3];
  bool are_points;  ///< points have one corner
  double half;      ///< half edge of the boxes about points

  /// \param end at most begin + kPartLanes; the last element fills the remaining columns
  void take(const Surface& surface, std::uint32_t begin, std::uint32_t end);
};

/// Reach of each along n, from the body's origin.
void part_reaches(const NodeColumns& nodes, const Vec3d& n, PartColumn& reaches);
void part_reaches(const ElementColumns& elements, const Vec3d& n, PartColumn& reaches);

/// Lower bound on the distance of each from `other`: from both boxes in the axes of the parts' body, along the line of
/// their centres (towards a triangle: to its nearest point) and along the normals of the planes of both;
/// docs/trust/bounds_bodies.md, "Surfaces". Not below 0.
/// \param R,D convert the other body's coordinates to those of the parts' body
/// \param stop_above the search for tighter bounds stops once all gaps exceed this
void part_gaps(const NodeColumns& nodes, const PartBounds& other, const Mat3d& R, const Vec3d& D, double stop_above,
               PartColumn& gaps);
void part_gaps(const ElementColumns& elements, const PartBounds& other, const Mat3d& R, const Vec3d& D,
               double stop_above, PartColumn& gaps);

/// Lower bound on the distance of each triangle of a (lanes) from each of b: along `n` and the normals of all. Not
/// below 0.
/// \param R,D convert b's coordinates to a's
/// \param n directions from a towards b, in the axes of a, of length 1 up to rounding, or 0
void triangle_gaps(const ElementColumns& a, const ElementColumns& b, const Mat3d& R, const Vec3d& D,
                   const Vec3d (&n)[2], PartColumn (&gaps)[kPartLanes]);

}  // namespace clearance
