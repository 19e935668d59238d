// Parsed urls of daemons.
#pragma once

#include <string>

namespace clearance {

enum class UrlKind { kShm, kZmq, kLcm };

struct Url {
  UrlKind kind = UrlKind::kShm;
  std::string target;      ///< the socket's path with options (kShm), the endpoint (kZmq) or the LCM url (kLcm)
  std::string prefix;      ///< prefix of the channels' names, for kLcm
  std::string server_key;  ///< file of the daemon's public key, for tcp; empty without keys
  std::string key;         ///< file of the client's own pair, for tcp
};

/// Parses "shm:///path", "ipc:///path", "tcp://host:port?server_key=FILE&key=FILE" or
/// "udpm://group:port?ttl=0&prefix=NAME_". Throws std::invalid_argument with the list of kinds.
Url parse_url(const std::string& url);

}  // namespace clearance
