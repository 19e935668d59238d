// The keys of a daemon's TCP endpoints: its own, and those of its clients with what each may do.
//
// In a folder: server.key (wire/key_file.h) and `authorized`, a line for each client:
//   KEY RIGHTS [NAME]          as in    rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7 query,poses planner
// Lines that begin with "# " are comments (a key may begin with '#', and no space follows it there).
#pragma once

#include <sys/stat.h>

#include <cstddef>
#include <string>
#include <unordered_map>

#include "server/access/access.h"
#include "wire/key_file.h"

namespace clearance {

class AuthorizedKeys {
 public:
  struct Entry {
    Rights rights = 0;
    std::string name;  ///< for the log
  };

  /// Throws std::runtime_error naming file, line and cause; also if others may read the secret key or change the list.
  explicit AuthorizedKeys(const std::string& folder);

  const KeyPair& own() const { return own_; }
  /// Entry of a key, or null.
  const Entry* find(const std::string& public_key) const;
  /// Rights of a key, as of the last read.
  Rights rights_of(const std::string& public_key) const;
  std::size_t size() const { return entries_.size(); }
  /// Whether any key has the class control.
  bool has_control() const;

  /// Reads the list again if the file has changed, and returns whether it did. Throws as the constructor, once for each
  /// change, and keeps the old list.
  bool refresh();

 private:
  using Entries = std::unordered_map<std::string, Entry>;
  Entries read() const;

  std::string list_;
  KeyPair own_;
  Entries entries_;
  struct stat seen_{};
};

}  // namespace clearance
