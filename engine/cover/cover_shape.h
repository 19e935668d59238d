// A union of convex parts, meshes and clouds as a cover needs it: simplices that hold it, and balls that it holds.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/bvh/surface.h"
#include "engine/cover/hull_planes.h"
#include "engine/hull/convex_part.h"

namespace clearance {

/// The hull of four points, repeated for a triangle, a segment or a point.
struct CoverSimplex {
  std::array<Vec3d, 4> corner;
  double growth;  ///< metres: the body's part around it is within this of the simplex
};

/// Metres, in the body's frame. All functions are valid for every input; rounding is charged.
class CoverShape {
 public:
  /// Returns nothing if a part is a half-space, too large or beyond 1e9 m, and for no or more than 300 parts.
  static std::optional<CoverShape> of(std::span<const ConvexPartPtr> parts);

  /// Simplices that cover the body, interior included, each with its growth.
  const std::vector<CoverSimplex>& simplices() const { return simplices_; }
  /// Bound on the distance of the body's points from the origin.
  double reach() const { return reach_; }
  /// If above 0, the radius of a ball about `c` that lies in the body. Otherwise, a point of the body is no farther than
  /// the negated value from `c`.
  double inside(const Vec3d& c) const {
    std::uint32_t near = 0;
    return inside(c, -std::numeric_limits<double>::infinity(), near);
  }
  /// \param enough a result that is no greater may be any number that is no greater
  /// \param near of depth_in_mesh() and depth_in_cloud()
  double inside(const Vec3d& c, double enough, std::uint32_t& near) const;
  /// Whether inside() can be above 0.
  bool has_inside() const { return has_inside_; }

 private:
  /// A part: its core, grown by a radius.
  struct Part {
    std::shared_ptr<const Primitive> core;   ///< null for others
    std::shared_ptr<const Surface> surface;  ///< null but for a mesh or cloud
    std::vector<Vec3d> vertices;             ///< of a hull: all, or enough
    HullPlanes planes;                       ///< of a hull with volume
    double radius = 0;

    double inside(const Vec3d& c, double enough, std::uint32_t& near) const;
  };

  void add(const ConvexPart& part, std::size_t most_vertices);
  void add_mesh(const ConvexPart& part, std::size_t most_cells);
  void add_cloud(const ConvexPart& part);
  /// Adds a part's simplices: the fan, grown.
  void add(const Fan& fan, double growth);

  std::vector<CoverSimplex> simplices_;
  std::vector<Part> parts_;
  double reach_ = 0;
  bool has_inside_ = false;
};

}  // namespace clearance
