// Default sockets of the daemon.
#pragma once

#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace clearance {

/// Folder of this user's sockets: $XDG_RUNTIME_DIR, /run/user/UID, or /tmp/clearance-UID, which may not exist.
inline std::string default_socket_folder() {
  const auto is_folder = [](const std::string& path) {
    struct stat info;
    return !path.empty() && stat(path.c_str(), &info) == 0 && S_ISDIR(info.st_mode);
  };
  const char* runtime = std::getenv("XDG_RUNTIME_DIR");
  if (runtime && is_folder(runtime)) return runtime;
  const std::string uid = std::to_string(getuid());
  if (is_folder("/run/user/" + uid)) return "/run/user/" + uid;
  return "/tmp/clearance-" + uid;
}

/// Socket of the shared-memory transport.
inline std::string default_socket_path() {
  return default_socket_folder() + "/clearance.sock";
}

}  // namespace clearance
