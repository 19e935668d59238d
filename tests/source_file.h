// Where tests find their data.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace clearance {

/// Path of a file or folder of the source tree: of the one that was built, or, for binaries that were carried
/// elsewhere, of CLEARANCE_SOURCE_DIR in the environment, else of the tree that they lie in (build/bin).
inline std::string source_file(const std::string& name) {
  if (const char* tree = std::getenv("CLEARANCE_SOURCE_DIR")) return std::string(tree) + "/" + name;
  const std::filesystem::path built = CLEARANCE_SOURCE_DIR;
  if (std::filesystem::exists(built)) return built / name;
  return std::filesystem::read_symlink("/proc/self/exe").parent_path().parent_path().parent_path() / name;
}

}  // namespace clearance
