// Limits that are lowered for a running process, and the errors that its clients then get.
#pragma once

#include <sys/resource.h>
#include <sys/stat.h>

#include <cstdint>
#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>

namespace clearance::faults {

/// The message of the exception that a call throws, or an empty string.
inline std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

/// Lowers a limit of a running process; the destructor restores it.
class Limit {
 public:
  Limit(int pid, __rlimit_resource what, std::uint64_t value) : pid_(pid), what_(what) {
    if (prlimit(pid_, what_, nullptr, &before_)) throw std::runtime_error("prlimit");
    const rlimit now{value, before_.rlim_max};
    if (prlimit(pid_, what_, &now, nullptr)) throw std::runtime_error("prlimit");
  }
  ~Limit() { prlimit(pid_, what_, &before_, nullptr); }
  Limit(const Limit&) = delete;

 private:
  int pid_;
  __rlimit_resource what_;
  rlimit before_{};
};

/// Descriptor limit that leaves a process this many free ones; its descriptors may have gaps.
inline std::uint64_t descriptors_for(int pid, int spare) {
  const auto is_open = [pid](std::uint64_t fd) {
    struct stat info{};
    return lstat(("/proc/" + std::to_string(pid) + "/fd/" + std::to_string(fd)).c_str(), &info) == 0;
  };
  std::uint64_t limit = 0;
  for (int free = 0;; ++limit)
    if (!is_open(limit) && ++free > spare) return limit;
}

/// Size of a process's address space in bytes.
inline std::uint64_t address_space_of(int pid) {
  std::ifstream statm("/proc/" + std::to_string(pid) + "/statm");
  std::uint64_t pages = 0;
  statm >> pages;
  return pages * 4096;
}

}  // namespace clearance::faults
