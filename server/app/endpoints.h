// The daemon's endpoints and the access to them, from its options.
#pragma once

#include "server/access/access.h"
#include "server/app/options.h"
#include "server/core/loop.h"
#include "server/requests/transport.h"

namespace clearance {

/// Access rights from the options. Throws std::invalid_argument, and std::runtime_error for key files.
Access access_of(const DaemonOptions& options);
/// Throws std::invalid_argument for contradictory options and for names that are not in the scene.
LcmPoses lcm_poses_of(const DaemonOptions& options, const engine::Scene& scene);
/// Opens all endpoints, or the default one, and adds them to the loop. Throws std::runtime_error with cause and place.
void open_endpoints(Loop& loop, DaemonOptions& options, const Access& access, const LcmPoses& lcm_poses);

}  // namespace clearance
