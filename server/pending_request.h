// A request that is answered later.
#pragma once

#include <memory>

#include "quotas.h"
#include "transport.h"

namespace clearance {

struct PendingRequest {
  std::unique_ptr<ReplySink> sink;
  wire::FrameHeader header;
  Quotas::Share share;
};

}  // namespace clearance
