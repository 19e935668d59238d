// Updates of poses and joints, and the states that result.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

#include "engine/pose/pose.h"
#include "wire/types.h"

namespace clearance {

/// Angular velocity, then velocity of the body's origin, world axes; of a body with a parent, relative to it. rad/s, m/s.
using BodyTwist = std::array<double, 6>;
/// NaN: an unknown velocity.
inline constexpr double kUnknownSpeed = std::numeric_limits<double>::quiet_NaN();
inline constexpr BodyTwist kUnknownTwist{kUnknownSpeed, kUnknownSpeed, kUnknownSpeed,
                                         kUnknownSpeed, kUnknownSpeed, kUnknownSpeed};

/// A pose update of one body, with its velocity at that pose.
struct BodyPose {
  std::uint32_t body = kNone;
  Pose pose;  ///< X_wb, or X_pb with a parent
  BodyTwist velocity = kUnknownTwist;
};

/// A position update of one joint.
struct JointPosition {
  std::uint32_t joint = kNone;
  double position = 0;              ///< radians or metres
  double velocity = kUnknownSpeed;  ///< rad/s or m/s
};

/// State of a joint in the newest snapshot.
struct JointState {
  double position = 0;
  Status status = Status::kNoPose;  ///< kOk, kNoPose (without a position) or kBadPose
  bool beyond_limits = false;
  std::int64_t stamp_ns = 0;    ///< publisher's clock
  std::int64_t receipt_ns = 0;  ///< our monotonic clock; 0 if never set since load
};

/// Result of a batch of updates of poses or joints, which applies as a whole, in one snapshot. Bad entries are stored,
/// so that queries report them; unknown and static bodies are only counted.
struct PoseUpdateResult {
  std::uint64_t revision = 0;  ///< of the snapshot that contains the update
  std::uint32_t applied = 0;
  std::uint32_t bad = 0;           ///< stored; the status is kBadPose until a valid one arrives
  std::uint32_t unknown = 0;       ///< body or joint id outside the scene
  std::uint32_t fixed = 0;         ///< static body
  std::uint64_t copied_bytes = 0;  ///< bytes of body states copied for the snapshot
};

/// State of a body in the newest snapshot.
struct BodyState {
  Pose X_wb;                        ///< valid if `status` is kOk
  Status status = Status::kNoPose;  ///< kOk, kNoPose or kBadPose
  std::uint32_t parent = kNone;
  std::int64_t stamp_ns = 0;    ///< publisher's clock
  std::int64_t receipt_ns = 0;  ///< our monotonic clock; 0 if never moved since load
};

}  // namespace clearance
