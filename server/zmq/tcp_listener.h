// TCP endpoints: checks, and the listening socket.
#pragma once

#include <string>

#include "wire/shm_os.h"

namespace clearance {

struct TcpListener {
  shm::UniqueFd socket;
  std::string url;  ///< with the port number that was chosen
};

/// Listens at "tcp://ADDRESS:PORT", where ADDRESS is an address, a name, an interface, or * for all, and PORT may be *
/// for a free one. Without keys only the loopback is allowed. Throws std::runtime_error with endpoint and cause.
TcpListener listen_tcp(const std::string& endpoint, bool with_keys);

}  // namespace clearance
