// Roots of the covers of a query's bodies: their distances from obstacles and from each other.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/decision/kernel/ball_frames.h"
#include "engine/decision/kernel/cloud_gaps.h"
#include "engine/decision/kernel/decision_view.h"

namespace clearance {
namespace CLEARANCE_ISA {

/// The roots of a query's covers in one state, columns side by side. PlacedBalls places them.
class PlacedRoots {
 public:
  HWY_INLINE void root_gaps(const Obstacle& obstacle, std::uint32_t begin, const GapLimits& limits,
                            PointGaps& gaps) const {
    using Row = const float(&)[kBalls];
    obstacle_gaps(obstacle, reinterpret_cast<Row>(root_.x[begin]), reinterpret_cast<Row>(root_.y[begin]),
                  reinterpret_cast<Row>(root_.z[begin]), limits, gaps);
  }
  HWY_INLINE Eight root_ways(std::uint32_t begin) const { return Eight::load(root_.way + begin); }
  /// Distances of the roots of eight columns from a point.
  HWY_INLINE Eight distances_to_roots(std::uint32_t begin, const std::array<float, 3>& point) const {
    const EightPoints c{Eight::load(root_.x + begin), Eight::load(root_.y + begin), Eight::load(root_.z + begin)};
    return distances(c, point[0], point[1], point[2]);
  }
  /// Lower bounds on their distances from an obstacle of planes, by the ball that holds it.
  HWY_INLINE Eight distances_to_ball(std::uint32_t begin, const Obstacle& obstacle) const {
    return distances_to_roots(begin, obstacle.at) - Eight(obstacle.outer_radius) - Eight(obstacle.radius);
  }
  /// Roots of kColumns columns that may be within their margins of an obstacle.
  template <bool kMoves>
  HWY_INLINE Bits roots_near(std::uint32_t obstacle, std::uint32_t begin) const {
    Sixteen reach = Sixteen::load(v_.box_reach + std::size_t{obstacle} * v_.columns + begin);
    if constexpr (kMoves) reach = reach + Sixteen::load(root_.way + begin);
    return ~greater(squares_to_box(obstacle, begin), reach * magnitude(reach)) & 0xffff;
  }
  /// Lower bounds on the distances of kColumns bodies from an obstacle, by its box and their roots.
  HWY_INLINE Sixteen distances_by_box(std::uint32_t obstacle, std::uint32_t begin) const {
    return root(squares_to_box(obstacle, begin)) -
           Sixteen::load(v_.box_reach + std::size_t{obstacle} * v_.columns + begin);
  }
  /// gaps_in_lanes() of kColumns roots.
  HWY_INLINE Sixteen gaps_of_roots(const Obstacle& obstacle, std::uint32_t begin) const {
    return gaps_in_lanes(obstacle, Sixteen::load(root_.x + begin), Sixteen::load(root_.y + begin),
                         Sixteen::load(root_.z + begin));
  }
  /// Whether all roots of eight columns are beyond their bounds from a ball.
  HWY_INLINE bool are_roots_beyond(std::uint32_t begin, const std::array<float, 3>& centre, const Eight& bound) const {
    return greater(distances_to_roots(begin, centre), bound) == 0xff;
  }
  /// Whether the roots of all bodies are beyond their margins from the obstacles below a node.
  template <bool kMoves>
  HWY_INLINE bool are_roots_beyond(std::uint32_t node) const {
    for (std::uint32_t begin = 0; begin < v_.columns; begin += kBalls) {
      Eight bound = Eight::load(v_.node_bound + std::size_t{node} * v_.columns + begin);
      if constexpr (kMoves) bound = bound + root_ways(begin);
      if (!are_roots_beyond(begin, v_.nodes[node].at, bound)) return false;
    }
    return true;
  }
  /// Distances of the roots of eight pairs of bodies.
  HWY_INLINE Eight distances_of_roots(const std::int32_t* a, const std::int32_t* b) const {
    const auto difference = [&](const float* of) { return Eight::gather(of, a) - Eight::gather(of, b); };
    return length({difference(root_.x), difference(root_.y), difference(root_.z)});
  }
  /// Pairs of a row whose roots may be within their margins.
  template <bool kMoves>
  HWY_INLINE Bits roots_near(const MovedRow& row) const {
    const auto apart = [&](const float* root) { return Sixteen::load(root + row.begin) - Sixteen(root[row.a]); };
    const Sixteen x = apart(root_.x), y = apart(root_.y), z = apart(root_.z);
    Sixteen reach = Sixteen::load(row.reach);
    if constexpr (kMoves) reach = reach + (Sixteen::load(root_.way + row.begin) + Sixteen(root_.way[row.a]));
    return ~greater(x * x + y * y + z * z, reach * magnitude(reach)) & 0xffff;
  }
  HWY_INLINE float distance_of_roots(std::uint32_t a, std::uint32_t b) const {
    const float dx = root_.x[a] - root_.x[b], dy = root_.y[a] - root_.y[b], dz = root_.z[a] - root_.z[b];
    return __builtin_sqrtf(dx * dx + dy * dy + dz * dz);
  }

 protected:
  struct Roots {
    alignas(32) float x[kMostDecidedBodies], y[kMostDecidedBodies], z[kMostDecidedBodies];
    float way[kMostDecidedBodies];  // of spans
  };

  explicit PlacedRoots(const DecisionView& view) : v_(view) {}

  const DecisionView& v_;
  Roots root_;

 private:
  /// Squared distances of kColumns roots' centres from an obstacle's box.
  HWY_INLINE Sixteen squares_to_box(std::uint32_t obstacle, std::uint32_t begin) const {
    const ObstacleBox& box = v_.boxes[obstacle];
    const auto beyond = [&](const float* root, std::size_t k) {
      return larger(magnitude(Sixteen::load(root + begin) - Sixteen(box.at[k])) - Sixteen(box.half[k]), Sixteen(0.0f));
    };
    const Sixteen x = beyond(root_.x, 0), y = beyond(root_.y, 1), z = beyond(root_.z, 2);
    return x * x + y * y + z * z;
  }
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
