// Resources that a process holds according to the kernel, for comparisons before and after faults.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace clearance::faults {

struct Census {
  int descriptors = 0;                          ///< /proc/PID/fd
  int segments = 0;                             ///< mappings of shared-memory segments
  int mappings = 0;                             ///< all of /proc/PID/maps
  int threads = 0;                              ///< /proc/PID/task
  std::uint64_t private_kb = 0, shared_kb = 0;  ///< resident: RssAnon; RssShmem and RssFile
  std::vector<std::string> files;               ///< in the daemon's folders; segments in /dev/shm

  std::string text() const;
};

/// \param folders folders whose files are counted, with segments in /dev/shm (none are expected: a segment has no name)
Census census_of(int pid, const std::vector<std::string>& folders);

/// Describes the resources in `now` that `before` lacked, or returns an empty string. Fewer are no fault: a thread that
/// loaded a scene, or the proxy of a connection that has just ended, may still be counted in `before`. Mappings belong
/// to the allocator as well, which may keep a few more (kMappingsSpared).
std::string left_behind(const Census& before, const Census& now);
inline constexpr int kMappingsSpared = 24;

/// Sorted names of the entries of a folder; empty if it does not exist.
std::vector<std::string> entries_of(const std::string& folder);

}  // namespace clearance::faults
