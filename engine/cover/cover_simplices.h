// Simplices that hold a share of a body, and their division.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/cover/choose_balls.h"
#include "engine/cover/cover_shape.h"

namespace clearance {

/// Radius of a ball about `c` that holds the body's part around a simplex, in metres.
double radius_for(const CoverSimplex& s, const Vec3d& c);

/// Divides simplices; the result covers the same points. The longest edges are halved first, until no edge is longer
/// than `edge` or there are `most` simplices.
std::vector<CoverSimplex> divided(std::span<const CoverSimplex> simplices, double edge, std::size_t most);

/// Distributes simplices over balls: a share for each, by which its ball may have to grow. Simplices that no ball holds
/// are halved, above all those that lack most, until none lacks more than `slack` or there are `most`.
std::vector<std::vector<CoverSimplex>> distribute(std::span<const CoverSimplex> simplices,
                                                  std::span<const ChosenBall> balls, double slack, std::size_t most);

}  // namespace clearance
