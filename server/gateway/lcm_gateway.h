// LCM beyond this machine, outside of the daemon: liblcm reads and assembles messages from the network.
#pragma once

#include "server/gateway/link.h"

namespace clearance::gateway {

/// Forwards messages of the channels in kStart until the daemon has gone (Broken).
[[noreturn]] void serve_lcm(Link& link, const Message& start);

}  // namespace clearance::gateway
