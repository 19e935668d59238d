// Planes of a hull with volume, and hulls of few vertices in place of large ones.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/cover/fan.h"

namespace clearance {

/// Factor that exceeds the rounding of a length and of a few operations on it.
inline constexpr double kCoverUp = 1 + 0x1p-48;
/// More than every rounding of a sum of three products, relative to the sum of their magnitudes.
inline constexpr double kCoverRounding = 0x1p-49;
/// Exceeds the error of a length by underflow of its squares, in metres.
inline constexpr double kCoverTiny = 1e-150;

/// Points x with normal . x <= height for all planes are in the hull; |normal| <= 1.
class HullPlanes {
 public:
  HullPlanes() = default;
  /// Of the tetrahedra of a fan. Empty if a face has no plane above the fan's centre.
  explicit HullPlanes(const Fan& fan);

  bool empty() const { return height_.empty(); }
  std::size_t count() const { return height_.size(); }
  /// Radius of a ball about `c` in the hull, or a value not above 0.
  double depth(const Vec3d& c) const;
  /// How far `p` is above a plane, as computed, in metres.
  double above(std::size_t plane, const Vec3d& p) const { return dot(normal(plane), p) - height_[plane]; }
  Vec3d normal(std::size_t plane) const { return {x_[plane], y_[plane], z_[plane]}; }
  /// Upper bound on the distance of `p` from the hull, for points near it.
  /// \param plane the one that `p` is above most
  double distance(const Vec3d& p, std::size_t plane) const;
  /// The plane that `p` is above most.
  std::size_t highest(const Vec3d& p) const;

 private:
  std::vector<double> x_, y_, z_, height_;
  Vec3d centre_{0, 0, 0};  ///< in the hull
};

/// A hull with few vertices, from which no point of a larger hull is farther than `excess`. It lies in the larger one.
struct FewVertices {
  Fan fan;
  HullPlanes planes;
  double excess = 0;  ///< metres
};

/// Nothing if the faces of the hull of few vertices are not proved (fan.h).
/// \param most vertices
std::optional<FewVertices> few_vertices(std::span<const Vec3d> vertices, std::size_t most);

}  // namespace clearance
