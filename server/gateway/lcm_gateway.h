// LCM beyond this machine, outside of the core: liblcm reads and puts together what the network sends.
#pragma once

#include "server/gateway/link.h"

namespace clearance::gateway {

/// Passes on messages of the channels that kStart names, until the core has gone (Broken).
[[noreturn]] void serve_lcm(Link& link, const Message& start);

}  // namespace clearance::gateway
