// What a client's url says.
#pragma once

#include <string>

namespace clearance {

enum class UrlKind { kShm, kZmq, kLcm };

struct Url {
  UrlKind kind = UrlKind::kShm;
  std::string target;      ///< kShm: the socket's path, with its options; kZmq: the endpoint; kLcm: the LCM url
  std::string prefix;      ///< kLcm: of the channels' names
  std::string server_key;  ///< tcp: file of the daemon's public key; empty: no keys
  std::string key;         ///< tcp: file of the client's own pair
};

/// "shm:///path", "ipc:///path", "tcp://host:port?server_key=FILE&key=FILE", "udpm://group:port?ttl=0&prefix=NAME_".
/// Throws std::invalid_argument saying which kinds there are.
Url parse_url(const std::string& url);

}  // namespace clearance
