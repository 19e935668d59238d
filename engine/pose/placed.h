// A body where it is: from poses as given to what the narrow phase wants. For host and device.
#pragma once

#include "engine/pose/pose.h"
#include "wire/types.h"

namespace clearance {

/// A body's pose as the narrow phase wants it.
struct PlacedPose {
  Mat3d R_wb;  ///< rotation_of(X_wb)
  Vec3d t_w;   ///< origin of the body in the world
  Pose X_wb;   ///< for the double-double rotation of hard pairs
};

/// A body in the world.
struct BodyPlacement {
  PlacedPose pose;                  ///< meaningful if `status` is kOk
  Status status = Status::kNoPose;  ///< kOk, kNoPose, kBadPose; kStalePose in a query that takes such for none
  bool renormalised = false;        ///< the body's own quaternion was off by more than 1e-3
};

/// Places a body. \param local its pose as given; null: none was. \param parent the body that it follows, placed; null:
/// none. \param rotation rotation_of(*local), if it is known already and there is no parent.
CLEARANCE_HD inline BodyPlacement place(const Pose* local, const BodyPlacement* parent,
                                        const Mat3d* rotation = nullptr) {
  BodyPlacement body;
  if (!local) return body;
  const PoseQuality quality = check(*local);
  body.renormalised = quality == PoseQuality::kRenormalised;
  body.status = quality == PoseQuality::kBad ? Status::kBadPose : parent ? parent->status : Status::kOk;
  if (body.status != Status::kOk) return body;
  const Pose X_wb = parent ? compose(parent->pose.X_wb, parent->pose.R_wb, *local) : *local;
  if (parent && check(X_wb) == PoseQuality::kBad) {  // a composition can overflow
    body.status = Status::kBadPose;
    return body;
  }
  body.pose = {rotation && !parent ? *rotation : rotation_of(X_wb), X_wb.translation, X_wb};
  return body;
}

}  // namespace clearance
