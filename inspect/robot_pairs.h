// Which pairs of a robot's links need never be asked about, with the engine's distances: `clearance robot pairs`.
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

/// Every pair of links that have geometry. What an SRDF disables plays no part. Throws SceneError and RobotError.
std::vector<RobotPair> find_robot_pairs(const RobotOptions& robot, const FindingOptions& options);

/// An SRDF that disables the pairs that were proved never or always to touch, and adjacent ones; with `seen` also those
/// that only samples speak for. Its reasons say which.
std::string srdf_of(const std::string& robot, const std::vector<RobotPair>& pairs, const FindingOptions& options,
                    bool seen);

}  // namespace clearance
