// Poses that are too old for a query.
#pragma once

#include <memory>

#include "engine/selection/plan.h"

namespace clearance {

/// Returns the plan's snapshot with the status kStalePose for bodies whose poses are older than the query permits at
/// Plan::begun_ns, and for bodies that follow them. Returns the same snapshot if there are none.
std::shared_ptr<const PoseSnapshot> with_stale_poses(const engine::Scene& scene, const Plan& plan);

}  // namespace clearance
