// Poses of bodies as they come, and what is known of each.
#pragma once

#include <cstdint>

#include "engine/pose/pose.h"
#include "wire/types.h"

namespace clearance {

/// A pose update of one body.
struct BodyPose {
  std::uint32_t body = kNone;
  Pose pose;  ///< X_wb; of a body with a parent: X_pb
};

/// A position update of one joint.
struct JointPosition {
  std::uint32_t joint = kNone;
  double position = 0;  ///< radians or metres
};

/// What is known of a joint, as the newest snapshot has it.
struct JointState {
  double position = 0;
  Status status = Status::kNoPose;  ///< kOk, kNoPose (it has no position) or kBadPose
  bool beyond_limits = false;
  std::int64_t stamp_ns = 0;    ///< publisher's clock
  std::int64_t receipt_ns = 0;  ///< our monotonic clock; 0: never set since load
};

/// What became of a batch of updates of poses or joints. A batch applies as a whole, in one snapshot; bad entries are
/// stored as bad, so that queries say so, and unknown or static bodies are left out and counted.
struct PoseUpdateResult {
  std::uint64_t revision = 0;  ///< of the snapshot that holds the update
  std::uint32_t applied = 0;
  std::uint32_t bad = 0;           ///< stored, and answered kBadPose until a good one comes
  std::uint32_t unknown = 0;       ///< body or joint id outside the scene
  std::uint32_t fixed = 0;         ///< static body
  std::uint64_t copied_bytes = 0;  ///< of what is known of bodies, for the snapshot
};

/// Where a body is, as the newest snapshot has it.
struct BodyState {
  Pose X_wb;                        ///< meaningful if `status` is kOk
  Status status = Status::kNoPose;  ///< kOk, kNoPose or kBadPose
  std::uint32_t parent = kNone;
  std::int64_t stamp_ns = 0;    ///< publisher's clock
  std::int64_t receipt_ns = 0;  ///< our monotonic clock; 0: never moved since load
};

}  // namespace clearance
