// What a process holds, as the kernel tells it, to see whether it is still the same after trouble.
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
  std::vector<std::string> files;               ///< of the daemon's folders; segments in /dev/shm

  std::string text() const;
};

/// \param folders whose files are counted, with segments in /dev/shm (there should be none: a segment has no name).
Census census_of(int pid, const std::vector<std::string>& folders);

/// What `now` holds that `before` did not, in words; empty: nothing. Descriptors, segments, threads and files must be
/// the same; other mappings are the allocator's, which may keep a few more (kMappingsSpared).
std::string left_behind(const Census& before, const Census& now);
inline constexpr int kMappingsSpared = 24;

/// Names of the entries of a folder, sorted; of one that is not there, none.
std::vector<std::string> entries_of(const std::string& folder);

}  // namespace clearance::faults
