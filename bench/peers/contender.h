// A problem as the engine takes it.
#pragma once

#include "bench/peers/problem.h"
#include "engine/engine.h"

namespace clearance {

/// All bodies where they are in configuration k.
Scene scene_of(const peers::Problem& problem, std::uint64_t k);
/// Bodies that are not at the same place in all configurations.
std::vector<std::uint32_t> moved_bodies(const peers::Problem& problem);
Pose pose_of(const peers::Problem& problem, std::uint64_t k, std::uint32_t body);
std::vector<BodyPair> pairs_of(const peers::Problem& problem);

}  // namespace clearance
