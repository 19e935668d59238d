// Placement of bodies in the world, from given poses to the form that the narrow phase uses. For host and device.
#pragma once

#include "engine/pose/pose.h"
#include "wire/types.h"

namespace clearance {

/// A body's pose in the form that the narrow phase uses.
struct PoseMatrix {
  Mat3d R_wb;  ///< rotation_of(X_wb)
  Vec3d t_w;   ///< origin of the body in the world
  Pose X_wb;   ///< for the double-double rotation of hard pairs
};

/// A body in the world.
struct BodyPlacement {
  PoseMatrix pose;                  ///< meaningful if `status` is kOk
  Status status = Status::kNoPose;  ///< kOk, kNoPose, kBadPose; kStalePose in a query with max_pose_age_ns
  bool renormalised = false;        ///< the body's own quaternion was off by more than 1e-3
  bool beyond_limits = false;       ///< a joint that places it or a parent of it is beyond its limits
};

CLEARANCE_HD inline bool is_identity(const Pose& X) {
  return X.translation.x == 0 && X.translation.y == 0 && X.translation.z == 0 && X.qw == 1 && X.qx == 0 && X.qy == 0 &&
         X.qz == 0;
}

/// Whether the poses of a placed body's children are composed with its own, and so rounded.
CLEARANCE_HD inline bool is_composed(const BodyPlacement& parent) {
  return !is_identity(parent.pose.X_wb);
}

/// Places a body, without its rotation R_wb, which is rotation_of(X_wb).
/// \param local its given pose, or null
/// \param parent its placed parent, or null
/// \param parent_rotation called as parent_rotation() for the parent's R_wb, if needed
template <class Rotation>
CLEARANCE_HD inline BodyPlacement place_unrotated(const Pose* local, const BodyPlacement* parent,
                                                  const Rotation& parent_rotation) {
  BodyPlacement body;
  if (!local) return body;
  const PoseQuality quality = check(*local);
  body.renormalised = quality == PoseQuality::kRenormalised;
  body.status = quality == PoseQuality::kBad ? Status::kBadPose : parent ? parent->status : Status::kOk;
  if (body.status != Status::kOk) return body;
  const bool composed = parent && is_composed(*parent);  // otherwise there is no rounding
  const Pose X_wb = composed ? compose_with(parent->pose.X_wb, parent_rotation, *local) : *local;
  if (composed && check(X_wb) == PoseQuality::kBad) {  // a composition can overflow
    body.status = Status::kBadPose;
    return body;
  }
  body.beyond_limits = parent && parent->beyond_limits;
  body.pose.t_w = X_wb.translation;
  body.pose.X_wb = X_wb;
  return body;
}
/// Places a body.
/// \param rotation rotation_of(*local) if available, or null
CLEARANCE_HD inline BodyPlacement place(const Pose* local, const BodyPlacement* parent,
                                        const Mat3d* rotation = nullptr) {
  BodyPlacement body = place_unrotated(local, parent, [&]() -> const Mat3d& { return parent->pose.R_wb; });
  if (body.status != Status::kOk) return body;
  const bool composed = parent && is_composed(*parent);
  body.pose.R_wb = rotation && !composed ? *rotation : rotation_of(body.pose.X_wb);
  return body;
}

}  // namespace clearance
