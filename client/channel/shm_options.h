// Options in the url of a shared-memory daemon.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>

namespace clearance {

struct ShmOptions {
  std::string path;
  std::chrono::nanoseconds spin = std::chrono::microseconds(20);
  std::optional<uid_t> user = {};  ///< user of the daemon, by default this user
};

/// Parses "path?spin_us=20&user=clearance". Throws std::invalid_argument for an unknown option.
ShmOptions parse_shm_options(const std::string& target);

}  // namespace clearance
