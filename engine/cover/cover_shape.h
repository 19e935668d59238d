// A union of convex parts as a cover needs it: simplices that hold it, and balls that it holds.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/hull/convex_part.h"

namespace clearance {

struct Fan;  // engine/decomposition/fan.h

/// Factor that exceeds the rounding of a length and of a few operations on it.
inline constexpr double kCoverUp = 1 + 0x1p-48;
/// Exceeds what the underflow of squares takes from a length, in metres.
inline constexpr double kCoverTiny = 1e-150;

/// The hull of four points, repeated for a triangle, a segment or a point.
struct CoverSimplex {
  std::array<Vec3d, 4> corner;
  double growth;  ///< metres: the body's part around it is within this of the simplex
};

/// Metres, in the body's frame. All functions are valid for every input; rounding is charged.
class CoverShape {
 public:
  /// Returns nothing if a part is a half-space or has a surface, and without parts.
  static std::optional<CoverShape> of(std::span<const ConvexPartPtr> parts);

  /// Simplices that cover the body, interior included, each with its growth.
  const std::vector<CoverSimplex>& simplices() const { return simplices_; }
  /// Bound on the distance of the body's points from the origin.
  double reach() const { return reach_; }
  /// If above 0, the radius of a ball about `c` that lies in the body. Otherwise, a point of the body is no farther than
  /// the negated value from `c`.
  double inside(const Vec3d& c) const;

 private:
  /// A part: its core, grown by a radius.
  struct Part {
    std::shared_ptr<const Primitive> core;  ///< null for a hull
    std::vector<Vec3d> vertices;            ///< of a hull
    /// Planes of a hull with volume: points with normal . x <= height for all of them are in it. |normal| <= 1.
    std::vector<double> normal_x, normal_y, normal_z, height;
    double radius = 0;

    bool take_planes(const Fan& fan);
    double inside(const Vec3d& c) const;
  };

  void add(const ConvexPart& part);
  void add_flat(const ConvexPart& part);

  std::vector<CoverSimplex> simplices_;
  std::vector<Part> parts_;
  double reach_ = 0;
};

}  // namespace clearance
