// Input and output of the kernel of distances, as plain arrays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "engine/decision/kernel/decision_view.h"

namespace clearance {

/// How far the least distance of a state is bounded. With the least upper bound U so far, pairs with a lower bound above
/// max(0, min(scale[i] U + shift[i], most)) are laid aside. It only falls as U does.
struct DistanceLimits {
  double scale[2] = {1, 1}, shift[2] = {0, 0};
  double most = std::numeric_limits<double>::infinity();
  bool any_overlap = false;  ///< an overlapping pair ends the search; otherwise the first one is requested
  int packets = 768;         ///< as DistanceGroups::packets, for one group of all pairs
  /// Balls of a level, the roots first, are divided if they stand out less than this times the width of the bounds that
  /// is permitted. A level's balls stand out by a third of those of the level above, or less.
  float divided[3] = {std::numeric_limits<float>::infinity(), 10, 3.5f};
  float pairs_divided[3] = {std::numeric_limits<float>::infinity(), 10, 3.5f};  ///< of two moved bodies
};

/// A pair with the same bounds in every state.
struct StillCell {
  float lower, upper;  ///< metres
  std::uint64_t position;
};

/// A cell (DistanceGroups) whose pair has a joint table.
struct TabledCell {
  std::uint32_t cell, table;  ///< index in DecisionView::tabled
};

/// Groups of pairs, each of which has a least distance. A cell is obstacle * columns + body, or, from
/// obstacle_count * columns on, a moved pair, or, from the next multiple of 8 on, a pair that stays.
struct DistanceGroups {
  const std::uint32_t* begin;  ///< (count + 1,) in `cells`
  const std::uint32_t* cells;
  const int* packets;  ///< (count,) most packets of balls of each: beyond them, its pairs are left
  std::uint32_t count;
};

/// States whose least distances are bounded.
struct DistanceBatch {
  const DecisionView* view;  ///< for margins of 0
  const float* moved_inner;  ///< (moved_pairs,) and more, up to a multiple of 8: their roots' inner radii with shrink
  DistanceLimits limits;
  const Pose* poses;  ///< (states, stride)
  std::size_t stride, states;
  const std::uint8_t* usable;  ///< (states,) 0 if the bounds do not hold
  const double* positions;     ///< (states, position_stride) of joints; unused with `cells`
  std::size_t position_stride;
  const DistanceGroups* groups = nullptr;  ///< null for one group of all pairs
  std::span<const StillCell> still{};
  std::span<const TabledCell> tabled{};
  const double* const* frames = nullptr;    ///< of up to 8 states, as in DecisionBatch; null to use `poses`
  const TableCell* const* cells = nullptr;  ///< as in DecisionBatch; null to find them here
};

/// A pair that may be the nearest.
struct LeftPair {
  std::uint64_t position;  ///< in the plan
  float lower;             ///< metres
};

/// Result of one group in one state. Every pair of it is either left, or no nearer than `lower`.
struct DistanceBounds {
  double lower = 0, upper = 0;  ///< `upper` bounds the least distance; at most 0 if a pair is proved to overlap
  std::uint64_t lower_at = 0, upper_at = 0;  ///< positions of the pairs that give them
  bool is_listed = false;                    ///< otherwise, nothing is known
  std::uint32_t left_begin = 0, left_end = 0;
  std::uint32_t packets = 0;  ///< of balls that were compared
};

/// Work of the search: balls of a pair whose children come next.
struct DistanceItem {
  float lower;             ///< of the balls
  std::uint32_t obstacle;  ///< or kNone: a pair of moved bodies
  std::uint32_t at;        ///< body, or index of DecisionView::moved_pairs
  std::uint32_t a, b;      ///< packets of balls; b for moved pairs
};
inline constexpr std::uint32_t kMostDistanceItems = 512;  ///< of one level

/// Receives bounds and the pairs left: arrays that the caller owns.
struct DistanceRoom {
  DistanceBounds* bounds;  ///< (states, groups)
  LeftPair* left;
  std::uint32_t capacity;  ///< of `left`
  float* lows;             ///< (obstacles, columns), then (moved pairs,) up to a multiple of 8, then (still pairs,)
  DistanceItem* items;     ///< (3, kMostDistanceItems)
  float* highs = nullptr;  ///< as `lows`; for groups
};

/// One version of the kernel; all give the same results.
struct DistanceKernel {
  const char* name;
  void (*run)(const DistanceBatch&, const DistanceRoom&);
};
/// The versions that this machine can run, the fastest first.
std::span<const DistanceKernel> distance_kernels();

}  // namespace clearance
