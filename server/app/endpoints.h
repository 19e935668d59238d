// Where the daemon is met, and by whom: what its options say of that.
#pragma once

#include "server/access/access.h"
#include "server/app/options.h"
#include "server/core/loop.h"
#include "server/requests/transport.h"

namespace clearance {

/// Who may come in, as the options say. Throws std::invalid_argument, and std::runtime_error for key files.
Access access_of(const DaemonOptions& options);
/// Throws std::invalid_argument for options that contradict each other or name what the scene does not have.
LcmPoses lcm_poses_of(const DaemonOptions& options, const Scene& scene);
/// Opens all of them, or the default one, and adds them to the loop. Throws std::runtime_error with cause and place.
void open_endpoints(Loop& loop, DaemonOptions& options, const Access& access, const LcmPoses& lcm_poses);

}  // namespace clearance
