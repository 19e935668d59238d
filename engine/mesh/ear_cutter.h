// Triangles of a polygon in a plane, by cutting ears.
//
// Each corner that is cut off must turn counterclockwise. Then the triangles cover each point as often as the polygon
// winds around it, since their boundaries add up to the polygon's: that is the proof, however the ears were chosen.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "engine/base/triangle.h"
#include "engine/base/vec.h"

namespace clearance {

struct FlatPoint {
  double u, v;
  bool operator==(const FlatPoint&) const = default;
};
/// Coordinates up to here are allowed, and those below its inverse count as 0.
inline constexpr double kMaxFlatCoordinate = 1e60;

/// Returns the exact sign of the area of a, b, c: 1 if they turn counterclockwise.
int turn(const FlatPoint& a, const FlatPoint& b, const FlatPoint& c);

/// Returns whether no triangle of the fan around the first corner turns clockwise.
bool fan_is_right(std::span<const FlatPoint> polygon);

/// Cuts a polygon that may touch itself, as where a bridge leads to a hole, into triangles of its corners' indices.
/// Returns the height of the highest triangle that turns clockwise, or 0 if none does; nothing if the polygon crosses
/// itself by more than the tolerance or is too intricate. The work is at most about 500 steps a corner.
/// \param face the same corners in space
/// \param tolerance greatest height of a triangle that turns clockwise, in metres
std::optional<double> cut_ears(std::span<const FlatPoint> polygon, std::span<const Vec3d> face, double tolerance,
                               std::vector<Triangle>* triangles);

}  // namespace clearance
