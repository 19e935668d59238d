// Which links of a robot need never be asked about: they always touch, or never can. Proved over all positions within
// the joints' limits where motion bounds reach, else said to be what it is: not seen.
#pragma once

#include <cstdint>
#include <functional>
#include <random>
#include <span>
#include <vector>

#include "engine/robot/motion_path.h"
#include "engine/robot/robot.h"

namespace clearance {

enum class PairFinding : std::uint8_t {
  kAdjacent,    ///< one joint lies between them, with whatever fixed ones
  kNever,       ///< proved apart at all positions
  kAlways,      ///< proved to overlap at all positions
  kNeverSeen,   ///< in no sample did they overlap
  kAlwaysSeen,  ///< in all samples they did
  kSometimes,   ///< they overlap in some samples and not in others
};

/// Bounds on the signed distance of two bodies, metres.
struct SignedBounds {
  double lower, upper;
};

/// Two links with what holds their points.
struct LinkPair {
  std::uint32_t a = kNone, b = kNone;  ///< links
  LinkBall points_a, points_b;
};

/// Asks for one pair at many configurations. \param positions (n, columns). \param bounds (n,), those of overlapping
/// bodies negative by how deep they are
using PairDistances = std::function<void(std::span<const double> positions, std::span<SignedBounds> bounds)>;

struct FindingOptions {
  std::uint32_t samples = 1000;      ///< random configurations for each pair
  std::uint32_t most_steps = 20000;  ///< configurations that a proof may look at
  std::uint64_t seed = 1;
};

struct Found {
  PairFinding finding = PairFinding::kSometimes;
  std::uint32_t steps = 0;  ///< configurations that the proof looked at
};

/// What is true of a pair at all positions within the limits; a joint without limits turns once around. Sliding joints
/// must have limits. Throws RobotError where one has none.
Found find_pair(const RobotModel& robot, const Kinematics& kinematics, const LinkPair& pair,
                const PairDistances& distances, const FindingOptions& options);

}  // namespace clearance
