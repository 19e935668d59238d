// Nearest point of a mesh to another point, and the side of the surface of that point.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/hull/shapes.h"

namespace clearance {

/// A tree of boxes over the triangles of a mesh.
///
/// A connected component whose edges each join two triangles, once each way, and that encloses a positive volume is
/// solid: a point within it has a negative distance. Any other component is a bare surface.
class TriangleTree {
 public:
  /// Both lists must outlive the tree.
  /// \param vertices at magnitudes around 1
  /// \param triangles of three different vertices each, not empty
  TriangleTree(std::span<const Vec3d> vertices, std::span<const Triangle> triangles);

  /// Distance of a point to the nearest triangle, as computed; negative inside a solid component.
  /// \param visits maximum number of visited nodes, reduced by those used; if it does not suffice, the result is a
  /// larger, non-negative distance
  double signed_distance(const Vec3d& p, int* visits) const;
  /// Whether every component is solid.
  bool solid() const { return solid_; }
  /// Volume that the solid components enclose; overlaps count twice.
  double volume() const { return volume_; }

 private:
  struct Node {
    Vec3d low, high;
    std::uint32_t begin, end;  // triangles by place in order_
    std::uint32_t right;       // node of the upper half, the lower one follows; 0 in a leaf
  };
  struct Nearest {
    double squared;
    std::uint32_t triangle = 0;
    Vec3d point{0, 0, 0};
    int feature = 0;  // 0 inside; 1, 2, 3 on the edge from corner 0, 1, 2; 4, 5, 6 at that corner
  };

  void find_parts();
  void make_normals();
  std::uint32_t build(std::uint32_t begin, std::uint32_t end);
  void update_nearest(std::uint32_t triangle, const Vec3d& p, Nearest* best) const;
  Vec3d side(const Nearest& nearest) const;
  static double squared_gap(const Node& node, const Vec3d& p);

  std::span<const Vec3d> vertices_;
  std::span<const Triangle> triangles_;
  std::vector<std::array<std::uint32_t, 3>> across_;  // the triangle over each edge, or kNowhere
  std::vector<char> in_solid_;                        // by triangle
  std::vector<Vec3d> face_normals_, vertex_normals_;  // of length 1; of no particular length
  std::vector<Vec3d> centres_;                        // of triangles, while the tree is built
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
  bool solid_ = true;
  double volume_ = 0;
};

}  // namespace clearance
