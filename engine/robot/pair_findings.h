// Pairs of a robot's links that need no queries, since they always or never touch. Proved for all positions within the
// joints' limits where motion bounds suffice; otherwise reported as an observation of samples.
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
  kAdjacent,    ///< joined by at most one moving joint
  kNever,       ///< proved apart at all positions
  kAlways,      ///< proved to overlap at all positions
  kNeverSeen,   ///< they overlap in no sample
  kAlwaysSeen,  ///< they overlap in all samples
  kSometimes,   ///< they overlap in some samples only
};

/// Bounds on the signed distance of two bodies, metres.
struct SignedBounds {
  double lower, upper;
};

/// Two links with balls that contain their points.
struct LinkPair {
  std::uint32_t a = kNone, b = kNone;  ///< links
  LinkBall points_a, points_b;
};

/// Evaluates one pair at many configurations.
/// \param positions (n, columns)
/// \param bounds (n,) results; negative by the depth for overlapping bodies
using PairDistances = std::function<void(std::span<const double> positions, std::span<SignedBounds> bounds)>;

struct FindingOptions {
  std::uint32_t samples = 1000;      ///< random configurations for each pair
  std::uint32_t most_steps = 20000;  ///< maximum evaluations of a proof
  std::uint64_t seed = 1;
  double margin = 0;  ///< metres: pairs within it count as touching
};

struct Found {
  PairFinding finding = PairFinding::kSometimes;
  std::uint32_t steps = 0;  ///< evaluations of the proof
};

/// Classifies a pair over all positions within the limits; a joint without limits turns once around. Throws RobotError
/// for a sliding joint without limits.
Found find_pair(const RobotModel& robot, const Kinematics& kinematics, const LinkPair& pair,
                const PairDistances& distances, const FindingOptions& options);

}  // namespace clearance
