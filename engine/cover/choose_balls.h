// Choice of the balls of a level: few that stand out little from the body. Any choice is valid; only their number and
// width depend on it.
#pragma once

#include <span>
#include <vector>

#include "engine/cover/cover_shape.h"
#include "engine/hull/shapes.h"

namespace clearance {

struct ChosenBall {
  Vec3d centre;   ///< of float32
  double radius;  ///< enough for samples of the simplices, perhaps not for all of them
};

struct BallChoice {
  std::size_t most;                 ///< number of balls
  std::size_t candidates, samples;  ///< centres tried, and points of the body that balls have to hold
  double edge;                      ///< longest edge of most simplices, in metres
};

/// At most `choice.most` balls that hold samples of the simplices and stand out by about the least common length.
std::vector<ChosenBall> choose_balls(const CoverShape& shape, std::span<const CoverSimplex> simplices,
                                     const BallChoice& choice, PortableRandom& random);

}  // namespace clearance
