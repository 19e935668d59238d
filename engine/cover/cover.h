// Covers: trees of balls that bound a body's distances from both sides at little cost (docs/trust/bounds_covers.md).
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "engine/hull/convex_part.h"

namespace clearance {

/// A node of a cover, in metres and the body's frame. Let d be the distance of the centre from an obstacle: the node's
/// share of the body is at least d - outer away, and the body is at most max(0, d - inner) away.
struct CoverBall {
  std::array<float, 3> centre;  ///< exact
  float outer;                  ///< radius of a ball about the centre that holds the share
  /// If above 0, the ball of this radius about the centre lies in the body. Otherwise, a point of the body is no farther
  /// than -inner from the centre.
  float inner;
};

/// Balls side by side: some of the children of one ball.
struct BallPacket {
  static constexpr int kBalls = 8;
  static constexpr float kNoRadius = -1e30f;  ///< of unused balls, which neither reach nor hold anything

  alignas(32) float x[kBalls], y[kBalls], z[kBalls];
  float outer[kBalls], inner[kBalls];
  std::uint32_t children[kBalls];  ///< packet of the children, which are at most kBalls; kNone without
  std::uint32_t count;             ///< balls in use, the first ones
};

/// A tree of balls. The shares of a ball's children make up its own share, so that every complete cut of the tree
/// covers the body, its interior included.
struct Cover {
  static constexpr int kLevels = 4;  ///< the root is level 0

  CoverBall root;
  /// Level by level. The first `level_begin[2]` packets, at least one, are the children of the root.
  std::vector<BallPacket> packets;
  std::array<std::uint32_t, kLevels + 1> level_begin{};  ///< packets of level k >= 1: level_begin[k] to [k + 1]
  double reach = 0;   ///< bound on the distance of the body's points and of all centres from its origin, metres
  double spread = 0;  ///< bound on their distance from the root's centre, set by find_spread()

  void find_spread();

  std::span<const BallPacket> level(int k) const {
    return std::span(packets).subspan(level_begin[k], level_begin[k + 1] - level_begin[k]);
  }
  std::uint64_t resident_bytes() const { return sizeof *this + packets.capacity() * sizeof(BallPacket); }
};

/// Mean and greatest width outer - max(inner, 0) of a level's balls, in metres: the width of the bounds that it gives.
struct StandOut {
  double mean = 0, greatest = 0;
  std::uint64_t balls = 0;
};
StandOut stand_out(const Cover& cover, int level);

/// A cut that covers the body: the balls of a level, from 0 to kLevels - 1, and those above it that are not divided.
std::vector<CoverBall> cut_at(const Cover& cover, int level);

/// The cover of the union of parts in one frame, or nothing if a part is a half-space, too large or beyond 1e9 m, and for
/// no or more than 300 parts. Deterministic: the same on every machine. Takes about 0.2 s on one core, for meshes
/// one to three.
/// \param stopped makes it end early, without a cover, once it is true; may be null
/// \param effort share of the usual work, from 0 to 1; less makes the balls wider
std::optional<Cover> make_cover(std::span<const ConvexPartPtr> parts, const std::atomic<bool>* stopped = nullptr,
                                double effort = 1);

}  // namespace clearance
