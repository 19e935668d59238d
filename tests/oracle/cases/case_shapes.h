// Shapes for the case classes, metres.
#pragma once

#include <vector>

#include "tests/oracle/cases/cases.h"

namespace clearance::exact {

SolidPtr solid(std::vector<Vec3d> vertices, double radius = 0);
std::vector<Vec3d> scaled(std::vector<Vec3d> v, Vec3d s);
std::vector<Vec3d> scaled(std::vector<Vec3d> v, double s);

std::vector<Vec3d> box(Vec3d half);
/// A box, points in a box or on a sphere, or a uv sphere of 42 vertices: the ordinary body, of size about 1.
std::vector<Vec3d> ordinary(Random& random);
/// A prism or frustum with two facets of many vertices, which are coplanar exactly.
std::vector<Vec3d> prism(Random& random, int sides, double top);
/// The unit uv sphere of a resolution; made once.
SolidPtr dense_sphere(int resolution);
/// A box or a prism.
SolidPtr faced(Random& random);

SolidPtr needle(Random& random);
SolidPtr plate(Random& random);
/// A tetrahedron or a few points that almost lie on a segment or in a plane.
SolidPtr sliver(Random& random);
SolidPtr nearly_flat(Random& random);
SolidPtr flat(Random& random);  ///< exactly, in a coordinate plane
SolidPtr line(Random& random);  ///< exactly or almost collinear
/// Vertices that repeat, lie on edges and faces, or differ by a last bit.
SolidPtr repeated(Random& random);

}  // namespace clearance::exact
