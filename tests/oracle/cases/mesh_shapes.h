// Non-convex meshes of size about 1 for the mesh classes, metres.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "tests/oracle/cases/cases.h"

namespace clearance::exact {

/// Triangles outward by the right-hand rule; closed unless noted otherwise.
struct Mesh {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;
};
/// A point in a plane.
struct Point2 {
  double x, y;
};

/// A body of a mesh.
/// \param is_solid the enclosed volume is part of it
SolidPtr solid(Mesh mesh, bool is_solid, double radius = 0);
/// A cloud of points, each a triangle of one corner, or of boxes (`voxel` > 0) of twelve triangles each.
SolidPtr cloud(std::vector<CloudPoint> points, float voxel, double radius = 0);

// ---- operations that keep closed meshes closed
Mesh scaled(Mesh mesh, Vec3d s);  ///< s > 0
Mesh moved(Mesh mesh, Vec3d t);
Mesh flipped(Mesh mesh);
/// Adds another component to the mesh.
void append(Mesh& mesh, const Mesh& part);
/// Puts a vertex into some triangles, a share `off` from its edge, and three triangles in its place.
void split(Random& random, Mesh& mesh, int count, double off);
/// Moves each vertex by up to a length.
void shake(Random& random, Mesh& mesh, double length);

// ---- operations that open meshes
/// Gives each triangle its own vertices, moved by up to a length, and removes some triangles: cracks.
Mesh cracked(Random& random, const Mesh& mesh, double length);

Mesh box_mesh(Vec3d half);
/// A path of straight stretches with right-angle turns, of a width, from z = 0 to a height: L, U, serpentine.
Mesh bent_bar(std::span<const Point2> path, double width, double height);
/// A band between two rows of points, left and right in the direction of travel, from z = 0 to a height.
Mesh band(std::span<const Point2> left, std::span<const Point2> right, double height);
/// A profile (distance from the axis, z) with its inside to the left, rotated around z.
Mesh revolved(std::span<const Point2> profile, int sides);

Mesh bent(Random& random);              ///< L, U or serpentine
Mesh shelf(Random& random);             ///< compartments of boards that overlap or are flush
Mesh ring(Random& random);              ///< a torus around z with a hole
Mesh mug(Random& random);               ///< with a handle that overlaps its wall
Mesh spiral(Random& random);            ///< turns that lie close to each other
Mesh comb(Random& random, double gap);  ///< teeth, as one component or as boxes on a bar
Mesh ball(Random& random);              ///< a uv sphere with dents
Mesh cells(Random& random,
           double step);  ///< cubes of a lattice: vertices are multiples of `step`; edges of four triangles
Mesh plate(Random& random, double thickness);  ///< bent by a right angle
Mesh any_mesh(Random& random);                 ///< one of these

}  // namespace clearance::exact
