#include "server/access/authorized_keys.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace clearance {
namespace {

bool same_file(const struct stat& a, const struct stat& b) {
  return a.st_ino == b.st_ino && a.st_dev == b.st_dev && a.st_size == b.st_size &&
         a.st_mtim.tv_sec == b.st_mtim.tv_sec && a.st_mtim.tv_nsec == b.st_mtim.tv_nsec;
}

/// Write access to these files decides about access to the daemon.
struct stat status_of_guarded(const std::string& path) {
  struct stat info{};
  if (stat(path.c_str(), &info) != 0) throw std::runtime_error(path + ": " + std::strerror(errno));
  if (info.st_uid != geteuid() && info.st_uid != 0)
    throw std::runtime_error(path + ": belongs to user " + std::to_string(info.st_uid) +
                             ", neither the daemon's user nor root");
  if (info.st_mode & 022) throw std::runtime_error(path + ": others may write to it; chmod go-w it");
  return info;
}

}  // namespace

AuthorizedKeys::AuthorizedKeys(const std::string& folder) : list_(folder + "/authorized") {
  status_of_guarded(folder);
  own_ = read_key_pair(folder + "/server.key");
  seen_ = status_of_guarded(list_);
  entries_ = read();
}

const AuthorizedKeys::Entry* AuthorizedKeys::find(const std::string& public_key) const {
  const auto found = entries_.find(public_key);
  return found == entries_.end() ? nullptr : &found->second;
}

bool AuthorizedKeys::has_control() const {
  return std::any_of(entries_.begin(), entries_.end(),
                     [](const auto& entry) { return entry.second.rights & kControl; });
}

Rights AuthorizedKeys::rights_of(const std::string& public_key) const {
  const Entry* entry = find(public_key);
  return entry ? entry->rights : 0;
}

bool AuthorizedKeys::refresh() {
  struct stat now{};
  if (stat(list_.c_str(), &now) != 0) now = {};
  if (same_file(now, seen_)) return false;
  seen_ = now;  // before reading, so that an error is reported once
  status_of_guarded(list_);
  entries_ = read();
  return true;
}

AuthorizedKeys::Entries AuthorizedKeys::read() const {
  std::ifstream in(list_);
  if (!in) throw std::runtime_error(list_ + ": " + std::strerror(errno));
  Entries entries;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    std::istringstream words(line);
    std::string key, rights, name;
    if (!(words >> key) || key == "#") continue;
    const std::string place = list_ + ":" + std::to_string(number) + ": ";
    if (!is_key(key)) throw std::runtime_error(place + "expected a public key of 40 characters (Z85) first");
    if (!(words >> rights)) throw std::runtime_error(place + "the rights of this key are missing, as in query,poses");
    std::getline(words >> std::ws, name);
    try {
      if (!entries.emplace(key, Entry{parse_rights(rights), name}).second)
        throw std::invalid_argument("this key is listed twice");
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(place + error.what());
    }
  }
  return entries;
}

}  // namespace clearance
