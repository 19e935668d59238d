// What was long in the making, kept for the next time in one folder that is this user's alone.
//
// An entry is a few bytes of header and a payload. Its name is a SHA-256 digest of everything that the payload depends
// on, the version of what made it included, so an entry is never out of date: what has changed has another name. It is
// believed only if it belongs to this user, nobody else may write it, and length and digest are those of its header.
// Otherwise it is removed, and whoever asked makes it anew: nothing in the cache, and no cache, is ever an error.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/fd.h"
#include "engine/cache/sha256.h"

namespace clearance {

/// What an entry is made from, put together part by part.
class CacheKey {
 public:
  /// \param kind of entry, lower-case letters and '-'. \param version of what makes entries of this kind.
  CacheKey(std::string_view kind, std::string_view version);
  /// Each part goes in with its length: "ab", "c" and "a", "bc" are two keys.
  CacheKey& add(std::string_view part);
  CacheKey& add(const Sha256Digest& part);
  CacheKey& add(std::uint64_t part);
  CacheKey& add(double part);  ///< by its bits
  /// "KIND-DIGEST", the name of the entry's file. Once, after the last part.
  std::string name();

 private:
  std::string kind_;
  Sha256 digest_;
};

/// One entry, as `clearance cache list` shows it.
struct CacheEntry {
  std::string name, kind;
  std::uint64_t bytes = 0;
  std::chrono::system_clock::time_point used;  ///< last read or written
};

/// May be used by several threads, and by many processes at a time on one folder.
class Cache {
 public:
  static constexpr std::uint64_t kMostBytes = std::uint64_t{2} << 30;

  /// The cache that the environment asks for. CLEARANCE_CACHE: `off`, or the folder's absolute path; else `clearance`
  /// in $XDG_CACHE_HOME or ~/.cache. CLEARANCE_CACHE_MIB: how much it may hold, 2048 by default.
  static Cache of_environment();

  /// A folder, made if it is not there (private_folder.h says which are refused), that may hold so many bytes.
  explicit Cache(const std::string& folder, std::uint64_t most_bytes = kMostBytes);

  /// Whether anything is kept. \return why not, in `why_off()`: empty if it was asked for.
  bool is_on() const { return bool(folder_); }
  const std::string& why_off() const { return why_off_; }
  const std::string& path() const { return path_; }
  std::uint64_t most_bytes() const { return most_bytes_; }

  /// The payload of an entry; none if there is no such entry, or none that can be believed.
  std::optional<std::vector<std::byte>> read(const std::string& name) const;
  /// Keeps a payload, unless it is too large or cannot be written. Entries that were not used for longest go to make
  /// room.
  void write(const std::string& name, std::span<const std::byte> payload) const;

  /// All entries, last used first.
  std::vector<CacheEntry> list() const;
  /// Removes all entries; how many there were.
  std::size_t clear() const;

 private:
  struct Off {};
  Cache(Off, std::string why) : why_off_(std::move(why)) {}
  void make_room() const;

  std::string path_, why_off_;
  Fd folder_;
  std::uint64_t most_bytes_ = 0;
  mutable std::mutex mutex_;
  mutable std::uint64_t room_ = 0;  ///< bytes that may be written before the folder is looked through again
};

}  // namespace clearance
