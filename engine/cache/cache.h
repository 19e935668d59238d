// Cache of expensive results in a folder that only this user can write.
//
// An entry is a short header and a payload. Its name is a SHA-256 digest of everything that the payload depends on,
// including the version of the code that makes it, so that entries never become stale. An entry is valid only if it
// belongs to this user, no other user can write it, and length and digest match its header. Invalid entries are
// removed, and their payloads are computed again. Neither an invalid entry nor a missing cache is an error.
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

/// Key of an entry, built part by part from the inputs of its payload.
class CacheKey {
 public:
  /// \param kind kind of entry, lower-case letters and '-'
  /// \param version version of the code that makes entries of this kind
  CacheKey(std::string_view kind, std::string_view version);
  /// Adds a part with its length, so that "ab", "c" and "a", "bc" are different keys.
  CacheKey& add(std::string_view part);
  CacheKey& add(const Sha256Digest& part);
  CacheKey& add(std::uint64_t part);
  CacheKey& add(double part);  ///< by its bits
  /// Returns "KIND-DIGEST", the name of the entry's file. Call once, after the last part.
  std::string name();

 private:
  std::string kind_;
  Sha256 digest_;
};

/// One entry, as shown by `clearance cache list`.
struct CacheEntry {
  std::string name, kind;
  std::uint64_t bytes = 0;
  std::chrono::system_clock::time_point used;  ///< last read or written
};

/// Thread-safe. Many processes can share one folder.
class Cache {
 public:
  static constexpr std::uint64_t kMostBytes = std::uint64_t{2} << 30;

  /// Opens the cache that the environment configures. CLEARANCE_CACHE is `off` or the folder's absolute path, by
  /// default `clearance` in $XDG_CACHE_HOME or ~/.cache. CLEARANCE_CACHE_MIB is its maximum size, by default 2048.
  static Cache of_environment();
  /// A cache that is off.
  static Cache none() { return Cache(Off{}, ""); }

  /// Opens a folder of limited size, and creates it if necessary (private_folder.h lists rejected ones).
  explicit Cache(const std::string& folder, std::uint64_t most_bytes = kMostBytes);

  /// Whether the cache is on. why_off() returns the reason if not, or empty if it was switched off.
  bool is_on() const { return bool(folder_); }
  const std::string& why_off() const { return why_off_; }
  const std::string& path() const { return path_; }
  std::uint64_t most_bytes() const { return most_bytes_; }

  /// Returns the payload of an entry, or nothing without a valid entry.
  std::optional<std::vector<std::byte>> read(const std::string& name) const;
  /// Stores a payload, unless it is too large or cannot be written. Evicts the least recently used entries.
  void write(const std::string& name, std::span<const std::byte> payload) const;

  /// Returns all entries, most recently used first.
  std::vector<CacheEntry> list() const;
  /// Removes all entries, and returns their number.
  std::size_t clear() const;

 private:
  struct Off {};
  Cache(Off, std::string why) : why_off_(std::move(why)) {}
  void evict() const;

  std::string path_, why_off_;
  Fd folder_;
  std::uint64_t most_bytes_ = 0;
  mutable std::mutex mutex_;
  mutable std::uint64_t free_bytes_ = 0;  ///< bytes that can be written before the next scan of the folder
};

}  // namespace clearance
