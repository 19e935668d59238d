// Joint limits along Bezier curves.
#pragma once

#include <clearance/check.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>

namespace clearance {

/// Most control points of a curve, as in query_options.h.
inline constexpr std::size_t kMostControlPointsOfCurve = 8;

namespace detail {

/// \param points of a curve, overwritten
inline std::optional<double> position_beyond(std::span<double> points, const JointLimits& limits, int halvings) {
  const auto is_beyond = [&](double x) { return x < limits.lower || x > limits.upper; };
  const auto found = std::ranges::find_if(points, is_beyond);
  if (found == points.end()) return std::nullopt;
  if (is_beyond(points.front())) return points.front();
  if (is_beyond(points.back())) return points.back();
  if (halvings == 0) return *found;
  // Casteljau's halves; `points` becomes the first.
  std::array<double, kMostControlPointsOfCurve> second{};
  const std::size_t degree = points.size() - 1;
  std::array<double, kMostControlPointsOfCurve> level{};
  std::ranges::copy(points, level.begin());
  for (std::size_t n = 0; n <= degree; ++n) {
    points[n] = level[0];
    second[degree - n] = level[degree - n];
    for (std::size_t i = 0; i + n < degree; ++i) level[i] += 0.5 * (level[i + 1] - level[i]);
  }
  if (const auto before = position_beyond(points, limits, halvings - 1)) return before;
  return position_beyond(std::span(second).first(degree + 1), limits, halvings - 1);
}

}  // namespace detail

/// Returns a position of a joint along a curve, or at a waypoint, that is not shown to be within limits, if there is
/// one. A curve is within limits if its control points are, at some level of subdivision; exact apart from rounding.
/// \param rows begins with the joint's number in the first row
/// \param each numbers of a row
/// \param points control points of the curve, at most 8; 1 for a waypoint
inline std::optional<double> position_beyond(std::span<const double> rows, std::size_t each, std::size_t points,
                                             const JointLimits& limits) {
  constexpr int kMostHalvings = 14;
  std::array<double, kMostControlPointsOfCurve> own{};
  for (std::size_t i = 0; i < points; ++i) own[i] = rows[i * each];
  return detail::position_beyond(std::span(own).first(points), limits, kMostHalvings);
}

}  // namespace clearance
