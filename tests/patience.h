// How long tests wait for what must come: a stop for what never will, and no measure of anything. Machines are busy.
#pragma once

#include <chrono>
#include <string>

#include "client/client.h"

namespace clearance {

inline constexpr std::chrono::seconds kPatience{300};

/// A client that waits so long, to connect and for every answer. Not over LCM, which may lose an answer.
inline Client patient(const std::string& url, ConnectOptions options = {}) {
  options.timeout = kPatience;
  options.hang = kPatience;
  Client client = connect(url, options);
  client.set_timeout(kPatience);
  return client;
}

}  // namespace clearance
