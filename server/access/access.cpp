#include "server/access/access.h"

#include <grp.h>
#include <pwd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "server/access/authorized_keys.h"

namespace clearance {
namespace {

struct Word {
  Right right;
  const char* word;
};
constexpr Word kWords[] = {{kMayQuery, "query"}, {kMayPose, "poses"}, {kMayAdmin, "admin"}, {kControl, "control"}};

bool is_member(int socket, gid_t primary, gid_t group) {
  if (primary == group) return true;
  std::vector<gid_t> groups(64);
  socklen_t bytes = static_cast<socklen_t>(groups.size() * sizeof(gid_t));
  if (getsockopt(socket, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &bytes) != 0) {
    if (errno != ERANGE) return false;
    groups.resize(bytes / sizeof(gid_t));  // the number that it has
    if (getsockopt(socket, SOL_SOCKET, SO_PEERGROUPS, groups.data(), &bytes) != 0) return false;
  }
  groups.resize(bytes / sizeof(gid_t));
  return std::find(groups.begin(), groups.end(), group) != groups.end();
}

/// `name` as a number. Throws std::invalid_argument.
/// @param what "group" or "user"
std::uint32_t number_or_throw(const std::string& name, const char* what) {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (!name.empty() && error == std::errc() && end == name.data() + name.size()) return number;
  throw std::invalid_argument(std::string("there is no ") + what + " \"" + name + "\"");
}

}  // namespace

Rights parse_rights(const std::string& text) {
  Rights rights = 0;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    const std::string word = text.substr(at, end - at);
    const auto known =
        std::find_if(std::begin(kWords), std::end(kWords), [&](const Word& w) { return w.word == word; });
    if (known == std::end(kWords))
      throw std::invalid_argument("\"" + word +
                                  "\" is not a right: expected query, poses, admin or control, separated by commas");
    rights |= known->right;
    at = end + 1;
  }
  return rights;
}

std::string rights_text(Rights rights) {
  std::string text;
  for (const Word& w : kWords)
    if (rights & w.right) {
      if (!text.empty()) text += ',';
      text += w.word;
    }
  return text.empty() ? "nothing" : text;
}

gid_t group_named(const std::string& name) {
  std::vector<char> buffer(64 * 1024);
  struct group entry{};
  struct group* found = nullptr;
  if (getgrnam_r(name.c_str(), &entry, buffer.data(), buffer.size(), &found) == 0 && found) return found->gr_gid;
  return number_or_throw(name, "group");
}

uid_t user_named(const std::string& name) {
  std::vector<char> buffer(64 * 1024);
  struct passwd entry{};
  struct passwd* found = nullptr;
  if (getpwnam_r(name.c_str(), &entry, buffer.data(), buffer.size(), &found) == 0 && found) return found->pw_uid;
  return number_or_throw(name, "user");
}

bool Access::has_control() const {
  return !control_users.empty() || (group && group_rights & kControl) || (keys && keys->has_control());
}

std::optional<Rights> rights_of_user(uid_t user, bool is_in_group, const Access& access) {
  const auto& users = access.control_users;
  const bool is_named = std::find(users.begin(), users.end(), user) != users.end();
  const Rights control = is_named ? Rights{kControl} : Rights{0};
  if (user == geteuid()) return kAllRights | control;
  if (is_in_group) return access.group_rights | control;
  return std::nullopt;
}

std::optional<ucred> peer_process(int socket) {
  ucred peer{};
  socklen_t length = sizeof peer;
  if (getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &length) != 0) return std::nullopt;
  return peer;
}

std::optional<Rights> rights_of_peer(int socket, const Access& access, std::string& why) {
  const std::optional<ucred> peer = peer_process(socket);
  if (!peer) {
    why = std::string("SO_PEERCRED: ") + std::strerror(errno);
    return std::nullopt;
  }
  const bool is_in_group = access.group && is_member(socket, peer->gid, *access.group);
  if (const auto rights = rights_of_user(peer->uid, is_in_group, access)) return rights;
  why = "user " + std::to_string(peer->uid) + " may not connect: this daemon runs as user " + std::to_string(geteuid());
  if (access.group) why += ", and this user is not in its group " + std::to_string(*access.group);
  return std::nullopt;
}

void set_socket_mode(const std::string& path, const std::string& url, const Access& access) {
  const auto fail = [&url](const std::string& what) {
    throw std::runtime_error(url + ": cannot " + what + ": " + std::strerror(errno));
  };
  if (access.group && chown(path.c_str(), static_cast<uid_t>(-1), *access.group) != 0)
    fail("give the socket to group " + std::to_string(*access.group));
  if (chmod(path.c_str(), access.group ? 0660 : 0600) != 0) fail("set the mode of the socket");
}

}  // namespace clearance
