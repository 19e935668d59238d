// A request that is answered later.
#pragma once

#include <memory>

#include "server/limits/quotas.h"
#include "server/requests/transport.h"

namespace clearance {

struct PendingRequest {
  std::unique_ptr<ReplySink> sink;
  wire::FrameHeader header;
  Quotas::Share share;
};

}  // namespace clearance
