// Pairs of a robot's links that no query needs, by the engine's distances: `clearance robot pairs`.
#pragma once

#include <string>
#include <vector>

#include "engine/robot/pair_findings.h"
#include "engine/scene/scene_robot.h"

namespace clearance {

struct RobotPair {
  std::string a, b;  ///< links with geometry, in the file's order
  Found found;
};

/// Classifies every pair of links with geometry, regardless of an SRDF. Throws SceneError and RobotError.
std::vector<RobotPair> find_robot_pairs(const engine::RobotOptions& robot, const FindingOptions& options);

/// Returns an SRDF that disables adjacent pairs and those that were proved never or always to touch; with `seen` also
/// pairs that were only sampled. Its reasons distinguish them. With a margin, pairs always within it stay enabled, since
/// they need not touch.
std::string srdf_of(const std::string& robot, const std::vector<RobotPair>& pairs, const FindingOptions& options,
                    bool seen);

}  // namespace clearance
