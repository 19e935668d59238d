// Who may do what: the rights of those who connect, beside the daemon's own user, who may do everything.
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

/// What a client may do, as bits. The loop asks for them before it looks at a request (Loop::handle()).
enum Right : std::uint8_t {
  kMayQuery = 1 << 0,  ///< ask: distances, the scene, where bodies are, counters
  kMayPose = 1 << 1,   ///< say where bodies are, attach them, add bodies and remove those again
  kMayAdmin = 1 << 2,  ///< have the scene loaded anew
  kControl = 1 << 3,   ///< has the class of that name
};
using Rights = std::uint8_t;
/// Of the daemon's own user, who has the class control only where that is said (Access::control_users).
inline constexpr Rights kAllRights = kMayQuery | kMayPose | kMayAdmin;
/// Of those who come without any proof of who they are: the loopback, LCM.
inline constexpr Rights kStrangersRights = kMayQuery | kMayPose;

constexpr ServiceClass class_of(Rights rights) {
  return rights & kControl ? ServiceClass::kControl : ServiceClass::kPlanning;
}

/// "query,poses": words separated by commas. Throws std::invalid_argument naming the word and those that there are.
Rights parse_rights(const std::string& text);
/// As parse_rights() reads it; of none "nothing".
std::string rights_text(Rights rights);

class AuthorizedKeys;

/// Memory of a process that stands between the network and the core (outside/process.h), if nothing else is said.
inline constexpr std::uint64_t kGatewayBytes = std::uint64_t{2} << 30;

/// Who may come in at the endpoints of a daemon.
struct Access {
  std::optional<gid_t> group;            ///< whose members may connect to Unix sockets; none: this user alone
  Rights group_rights = kMayQuery;       ///< theirs
  std::vector<uid_t> control_users;      ///< who have the class control at Unix sockets, if they may connect
  std::shared_ptr<AuthorizedKeys> keys;  ///< of TCP; null: the loopback alone, without keys
  std::uint32_t max_clients = 256;       ///< of one endpoint
  std::uint64_t gateway_bytes = kGatewayBytes;

  /// Whether anybody may have the class control: only then is something kept for it.
  bool has_control() const;
};

/// The group of a name or number. Throws std::invalid_argument.
gid_t group_named(const std::string& name);
/// The user, likewise.
uid_t user_named(const std::string& name);

/// What a user may do at Unix sockets; none: not connect.
std::optional<Rights> rights_of_user(uid_t user, bool is_in_group, const Access& access);

/// The process at the other end of a Unix socket, by SO_PEERCRED; none with errno.
std::optional<ucred> process_behind(int socket);

/// What the process at the other end of a Unix socket may do, by SO_PEERCRED and SO_PEERGROUPS. None, with `why`: it
/// may not connect.
std::optional<Rights> rights_of_peer(int socket, const Access& access, std::string& why);

/// Makes a socket file this user's alone, or the group's too. Throws std::runtime_error naming `url` and the cause.
void set_socket_mode(const std::string& path, const std::string& url, const Access& access);

}  // namespace clearance
