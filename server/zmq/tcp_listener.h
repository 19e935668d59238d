// TCP endpoints: what may be opened, and the socket that listens there.
#pragma once

#include <string>

#include "wire/shm_os.h"

namespace clearance {

struct TcpListener {
  shm::UniqueFd socket;
  std::string url;  ///< with the port that was free
};

/// Listens at "tcp://ADDRESS:PORT": an address, a name, an interface, or * for all; a port, or * for a free one.
/// Without keys on the loopback alone. Throws std::runtime_error naming the endpoint and the cause.
TcpListener listen_tcp(const std::string& endpoint, bool with_keys);

}  // namespace clearance
