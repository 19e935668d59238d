// The elements of a non-convex body (triangles, points, boxes of one size), and a tree of boxes over them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"
#include "engine/bvh/cloud_point.h"

namespace clearance {

/// The corners of a convex element: one for a point, three for a triangle, eight for a box. Metres, body frame.
struct ElementCorners {
  std::array<Vec3d, 8> corner;
  std::size_t count;
  std::span<const Vec3d> span() const { return {corner.data(), count}; }
};

/// Immutable; metres, in the body's frame.
///
/// A *solid* is the volume that its triangles enclose: the points with a winding number other than 0, and the triangles
/// themselves. A *surface* is its triangles alone. A *cloud* is its points or, with an edge, the boxes (voxels) of that
/// edge about them, along the body's axes.
class Surface {
 public:
  enum class Kind : std::uint8_t { kSurface, kSolid, kCloud };

  /// A box around the elements of its leaves. Corners are relative to centre(), rounded outward.
  struct Node {
    std::array<float, 3> low, high;
    std::uint32_t right;  ///< the node of the second half; the first one follows this node. 0 in a leaf
    std::uint32_t few;    ///< in a leaf: its first element times kLeafElements, plus the number of elements after it
    bool is_leaf() const { return right == 0; }
    std::uint32_t begin() const { return few / kLeafElements; }
    std::uint32_t end() const { return begin() + few % kLeafElements + 1; }
  };
  /// Two planes around the triangles of a node. For a nearly flat patch they are much closer to each other than the
  /// sides of its box, which is aligned with the body.
  struct Slab {
    static constexpr double kUnit = 0x1p-14;
    float low, high;                    ///< of normal() . (x - centre()), rounded outward
    std::array<std::int16_t, 3> units;  ///< of kUnit
    /// Exact; of length 1 up to its rounding, or 0 if there is none.
    Vec3d normal() const { return kUnit * Vec3d{double(units[0]), double(units[1]), double(units[2])}; }
  };
  static constexpr std::uint32_t kLeafElements = 4;
  static constexpr std::size_t kMostElements = std::size_t{1} << 30;

  /// A solid or a surface. Throws std::invalid_argument without triangles or with too many, for a vertex index out of
  /// range, and if `is_solid` and the triangles are not closed: see open_edge().
  /// \param vertices finite, at magnitudes up to kMaxCoordinate; unused vertices have no effect
  Surface(std::vector<Vec3d> vertices, std::vector<Triangle> triangles, bool is_solid);
  /// A cloud. Reads each coordinate once, so that a concurrent write to the caller's memory cannot bypass the checks.
  /// Throws std::invalid_argument.
  /// \param points at least one, finite, at magnitudes up to kMostCloudCoordinate
  /// \param edge of the boxes about them, or 0 for points
  Surface(std::span<const CloudPoint> points, float edge);
  static constexpr float kMostCloudCoordinate = 1e9f;

  Kind kind() const { return kind_; }
  bool is_solid() const { return kind_ == Kind::kSolid; }
  bool is_cloud() const { return kind_ == Kind::kCloud; }
  /// Number of triangles or points.
  std::uint32_t size() const { return static_cast<std::uint32_t>(is_cloud() ? points_.size() : triangles_.size()); }
  /// Of a cloud, in the order of the leaves.
  std::span<const CloudPoint> points() const { return points_; }
  float edge() const { return edge_; }
  /// Position of a point of a cloud, exact.
  Vec3d point(std::uint32_t i) const { return {points_[i][0], points_[i][1], points_[i][2]}; }
  /// Of a cloud with an edge: bound on the rounding of corners, in metres; 0 if all are exact.
  double rounding() const { return rounding_; }
  /// Of a cloud: its lowest and highest corner, boxes included, as rounded.
  const std::array<Vec3d, 2>& extremes() const { return extremes_; }
  ElementCorners element(std::uint32_t i) const;
  std::span<const Vec3d> vertices() const { return vertices_; }
  /// In the order of the leaves.
  std::span<const Triangle> triangles() const { return triangles_; }
  /// Index of each triangle in the list given to the constructor.
  std::span<const std::uint32_t> places() const { return places_; }
  std::array<Vec3d, 3> corners(std::uint32_t triangle) const {
    const Triangle& t = triangles_[triangle];
    return {vertices_[t[0]], vertices_[t[1]], vertices_[t[2]]};
  }
  /// A vertex of each connected component of the triangles.
  std::span<const std::uint32_t> parts() const { return parts_; }

  /// The root is the first; a child comes after its parent.
  std::span<const Node> nodes() const { return nodes_; }
  /// By node; empty for a cloud.
  std::span<const Slab> slabs() const { return slabs_; }
  const Vec3d& centre() const { return centre_; }

  std::uint64_t resident_bytes() const;
  /// The same on every machine for the same vertices, triangles and kind, or for the same cloud.
  std::uint64_t digest() const { return digest_; }

 private:
  void find_parts();
  void build_tree();
  void find_slabs();

  std::vector<Vec3d> vertices_;
  std::vector<Triangle> triangles_;
  std::vector<std::uint32_t> places_, parts_;
  std::vector<CloudPoint> points_;
  float edge_ = 0;
  double rounding_ = 0;
  std::array<Vec3d, 2> extremes_{};
  std::vector<Node> nodes_;
  Vec3d centre_{0, 0, 0};
  std::uint64_t digest_ = 0;
  Kind kind_;
  std::vector<Slab> slabs_;
};
using SurfacePtr = std::shared_ptr<const Surface>;

/// Describes an edge that leaves triangles open, with its corners: they do not run along it equally often each way.
/// Empty if there is none. Vertices at equal positions are one.
std::string open_edge(std::span<const Vec3d> vertices, std::span<const Triangle> triangles);

/// Winding number of a solid's triangles around a point of the body's frame that is farther than 1e-59 m from each of
/// them. Exact.
int winding_number(const Surface& surface, const Vec3d& p);

/// Whether a box (metres, body frame) meets the box of any leaf. If not, it contains no part of any element.
bool meets_leaf(const Surface& surface, const Vec3d& low, const Vec3d& high);

}  // namespace clearance
