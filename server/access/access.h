// Rights of clients. The daemon's own user has all of them.
#pragma once

#include <sys/socket.h>
#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/service_class.h"

namespace clearance {

/// Rights of a client, as bits. The request table (server/core/request_router.cpp) has the right of each request.
enum Right : std::uint8_t {
  kMayQuery = 1 << 0,  ///< distances, the scene, body states, counters
  kMayPose = 1 << 1,   ///< set poses, attach bodies, add bodies and remove those again
  kMayAdmin = 1 << 2,  ///< reload the scene
  kControl = 1 << 3,   ///< has the class of that name
};
using Rights = std::uint8_t;
/// Rights of the daemon's own user, who has the class control only if listed in Access::control_users.
inline constexpr Rights kAllRights = kMayQuery | kMayPose | kMayAdmin;
/// Rights of unauthenticated peers: the loopback, LCM.
inline constexpr Rights kStrangersRights = kMayQuery | kMayPose;

constexpr ServiceClass class_of(Rights rights) {
  return rights & kControl ? ServiceClass::kControl : ServiceClass::kPlanning;
}

/// Parses rights separated by commas, such as "query,poses". Throws std::invalid_argument with the valid ones.
Rights parse_rights(const std::string& text);
/// Inverse of parse_rights(); "nothing" for no rights.
std::string rights_text(Rights rights);

class AuthorizedKeys;

/// Default memory of a process between the network and the daemon (server/gateway/process.h).
inline constexpr std::uint64_t kGatewayBytes = std::uint64_t{2} << 30;

/// Clients that may connect to the daemon's endpoints.
struct Access {
  std::optional<gid_t> group;            ///< its members may connect to Unix sockets; if unset only this user
  Rights group_rights = kMayQuery;       ///< of the group's members
  std::vector<uid_t> control_users;      ///< users with the class control at Unix sockets
  std::shared_ptr<AuthorizedKeys> keys;  ///< of TCP clients; if null only the loopback, without keys
  std::uint32_t max_clients = 256;       ///< of one endpoint
  std::uint64_t gateway_bytes = kGatewayBytes;

  /// Whether any client may have the class control. Resources are kept for it only then.
  bool has_control() const;
};

/// Group by name or number. Throws std::invalid_argument.
gid_t group_named(const std::string& name);
/// User by name or number. Throws std::invalid_argument.
uid_t user_named(const std::string& name);

/// Rights of a user at Unix sockets, or nothing if that user may not connect.
std::optional<Rights> rights_of_user(uid_t user, bool is_in_group, const Access& access);

/// Process at the other end of a Unix socket, by SO_PEERCRED. Sets errno if it returns nothing.
std::optional<ucred> peer_process(int socket);

/// Rights of the process at the other end of a Unix socket, by SO_PEERCRED and SO_PEERGROUPS. If it may not connect,
/// returns nothing and sets `why`.
std::optional<Rights> rights_of_peer(int socket, const Access& access, std::string& why);

/// Limits a socket file to this user, or to this user and the group. Throws std::runtime_error with `url` and the
/// cause.
void set_socket_mode(const std::string& path, const std::string& url, const Access& access);

}  // namespace clearance
