// Covers: trees of balls that bound a body's distances from both sides at little cost (docs/bounds.md, "Covers").
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/base/vec.h"
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

/// Balls by level. The shares of a ball's children make up its own share, so that every complete cut of the tree covers
/// the body, its interior included.
struct Cover {
  static constexpr int kLevels = 4;

  std::vector<CoverBall> balls;                          ///< level by level; the first is the root
  std::array<std::uint32_t, kLevels + 1> level_begin{};  ///< level k has balls level_begin[k] to level_begin[k + 1]
  std::vector<std::uint32_t> first_child;                ///< one more than balls: ball i has children first_child[i] to
                                                         ///< first_child[i + 1]; none on the last level

  std::span<const CoverBall> level(int k) const {
    return std::span(balls).subspan(level_begin[k], level_begin[k + 1] - level_begin[k]);
  }
  std::uint64_t resident_bytes() const;
};

/// Mean and greatest width outer - max(inner, 0) of a level's balls, in metres: the width of the bounds that it gives.
struct StandOut {
  double mean = 0, greatest = 0;
};
StandOut stand_out(const Cover& cover, int level);

/// The cover of the union of convex parts in one frame, or nothing if a part is a half-space or there is none.
/// Deterministic. Takes 0.1 to 1 s on one core.
std::optional<Cover> make_cover(std::span<const ConvexPartPtr> parts);

}  // namespace clearance
