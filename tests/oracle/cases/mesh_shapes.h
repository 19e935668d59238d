// Meshes that are not convex, of size about 1: what the classes of meshes are made of, metres.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "tests/oracle/cases/cases.h"

namespace clearance::exact {

/// Triangles outward by the right-hand rule, closed unless it says otherwise.
struct Mesh {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles;
};
/// A place in a plane.
struct Point2 {
  double x, y;
};

/// A body of a mesh. \param is_solid what it encloses is part of it
SolidPtr solid(Mesh mesh, bool is_solid, double radius = 0);
/// A cloud of points, each a triangle of one corner, or of boxes (`voxel` > 0) of twelve triangles each.
SolidPtr cloud(std::vector<CloudPoint> points, float voxel, double radius = 0);

// ---- what stays closed stays closed
Mesh scaled(Mesh mesh, Vec3d s);  ///< s > 0
Mesh moved(Mesh mesh, Vec3d t);
Mesh flipped(Mesh mesh);
/// Another part of the same mesh.
void append(Mesh& mesh, const Mesh& part);
/// Puts a vertex into each of some triangles, a share `off` from its edge, and three triangles in its place.
void split(Random& random, Mesh& mesh, int count, double off);
/// Moves each vertex by up to a length.
void shake(Random& random, Mesh& mesh, double length);

// ---- what opens
/// Gives each triangle vertices of its own, moved by up to a length, and leaves some triangles out: cracks.
Mesh cracked(Random& random, const Mesh& mesh, double length);

Mesh box_mesh(Vec3d half);
/// A path of straight stretches that turn by right angles, of a width, from z = 0 to a height: L, U, serpentine.
Mesh bent_bar(std::span<const Point2> path, double width, double height);
/// A band between two rows of points, left and right of the way along them, from z = 0 to a height.
Mesh band(std::span<const Point2> left, std::span<const Point2> right, double height);
/// A profile (distance from the axis, z), its inside to the left of the way along it, turned around z.
Mesh revolved(std::span<const Point2> profile, int sides);

Mesh bent(Random& random);              ///< L, U or serpentine
Mesh shelf(Random& random);             ///< compartments of boards that overlap or are flush
Mesh ring(Random& random);              ///< a torus around z with a hole
Mesh mug(Random& random);               ///< with a handle that overlaps its wall
Mesh spiral(Random& random);            ///< turns that lie close to each other
Mesh comb(Random& random, double gap);  ///< teeth, as one part or as boxes on a bar
Mesh ball(Random& random);              ///< a uv sphere with dents
Mesh cells(Random& random,
           double step);  ///< cubes of a lattice: vertices are multiples of `step`; edges of four triangles
Mesh plate(Random& random, double thickness);  ///< bent by a right angle
Mesh any_mesh(Random& random);                 ///< one of these

}  // namespace clearance::exact
