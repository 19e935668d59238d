// The triangles of a body that is not convex, and a tree of boxes over them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"

namespace clearance {

/// Immutable; metres, in the body's frame.
///
/// A *solid* is what its triangles enclose: the points of a winding number other than 0, and the triangles themselves.
/// A *surface* is its triangles alone.
class Surface {
 public:
  /// A box around the triangles of its leaves. Corners are relative to centre(), rounded outward.
  struct Node {
    std::array<float, 3> low, high;
    std::uint32_t right;  ///< the node of the second half, the first one follows this; 0: a leaf
    std::uint32_t few;    ///< of a leaf: its first triangle times kLeafTriangles, and how many follow that
    bool is_leaf() const { return right == 0; }
    std::uint32_t begin() const { return few / kLeafTriangles; }
    std::uint32_t end() const { return begin() + few % kLeafTriangles + 1; }
  };
  static constexpr std::uint32_t kLeafTriangles = 4;
  static constexpr std::size_t kMostTriangles = std::size_t{1} << 30;

  /// \param vertices finite, at magnitudes up to kMaxCoordinate; those that no triangle names count for nothing.
  /// Throws std::invalid_argument where there is no triangle or too many, one names a vertex that is not there, or
  /// `is_solid` and the triangles do not close: see open_edge().
  Surface(std::vector<Vec3d> vertices, std::vector<Triangle> triangles, bool is_solid);

  bool is_solid() const { return is_solid_; }
  std::span<const Vec3d> vertices() const { return vertices_; }
  /// In the order of the leaves.
  std::span<const Triangle> triangles() const { return triangles_; }
  /// The place in the list that the surface was made of, of each triangle.
  std::span<const std::uint32_t> places() const { return places_; }
  std::array<Vec3d, 3> corners(std::uint32_t triangle) const {
    const Triangle& t = triangles_[triangle];
    return {vertices_[t[0]], vertices_[t[1]], vertices_[t[2]]};
  }
  /// A vertex of each part that hangs together by its vertices.
  std::span<const std::uint32_t> parts() const { return parts_; }

  /// The root is the first; a child comes after its parent.
  std::span<const Node> nodes() const { return nodes_; }
  const Vec3d& centre() const { return centre_; }

  std::uint64_t resident_bytes() const;
  /// The same on every machine for the same vertices, triangles and kind.
  std::uint64_t digest() const { return digest_; }

 private:
  void find_parts();
  void build_tree();

  std::vector<Vec3d> vertices_;
  std::vector<Triangle> triangles_;
  std::vector<std::uint32_t> places_, parts_;
  std::vector<Node> nodes_;
  Vec3d centre_{0, 0, 0};
  std::uint64_t digest_ = 0;
  bool is_solid_;
};
using SurfacePtr = std::shared_ptr<const Surface>;

/// Why triangles enclose nothing: an edge along which they do not run as often one way as the other, with its corners;
/// empty where there is none. Vertices of equal positions are one.
std::string open_edge(std::span<const Vec3d> vertices, std::span<const Triangle> triangles);

/// How often the triangles of a solid wind around a point of the body's frame that is farther than 1e-59 m from each of
/// them: exact.
int winding_number(const Surface& surface, const Vec3d& p);

}  // namespace clearance
