// Conversion of a problem to the engine's types.
#pragma once

#include "bench/peers/problem.h"
#include "engine/engine.h"

namespace clearance {

/// Scene with all bodies at configuration k.
engine::Scene scene_of(const peers::Problem& problem, std::uint64_t k);
/// Bodies whose poses differ between configurations.
std::vector<std::uint32_t> moved_bodies(const peers::Problem& problem);
Pose pose_of(const peers::Problem& problem, std::uint64_t k, std::uint32_t body);
std::vector<BodyPair> pairs_of(const peers::Problem& problem);

}  // namespace clearance
