// Choice of the balls of a level: few that stand out little from the body. Any choice is valid; only their width depends
// on it.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/cover/cover_shape.h"
#include "engine/hull/shapes.h"

namespace clearance {

struct ChosenBall {
  Vec3d centre;   ///< of float32
  double radius;  ///< enough for the simplices from which it was chosen, within rounding
};

/// Chooses balls that together hold simplices and stand out little.
/// \param simplices small ones; each goes to one ball
/// \param most number of balls; fewer are chosen for few simplices
/// \param rounds more make the balls narrower
std::vector<ChosenBall> choose_balls(const CoverShape& shape, std::span<const CoverSimplex> simplices, std::size_t most,
                                     int rounds, PortableRandom& random);

}  // namespace clearance
