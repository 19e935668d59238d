// The folder of a mesh file: other files that it names are read only there.
#pragma once

#include <array>
#include <filesystem>
#include <string>

namespace clearance {

class MeshFolder {
 public:
  /// The folder that `file` is named in and, if it is a link, the one that it leads to.
  explicit MeshFolder(const std::filesystem::path& file);

  /// Whether a path leads to a place inside; links followed.
  bool holds(const std::filesystem::path& path) const;
  /// The bytes of a plain file inside. \param name relative to the folder. Throws LoadError.
  std::string read(const std::string& name) const;
  /// Whether nothing was asked for, be it there or not: then the mesh file's own bytes say all.
  bool alone() const { return alone_; }

 private:
  std::filesystem::path named_in_;
  std::array<std::filesystem::path, 2> folders_;
  mutable bool alone_ = true;
};

}  // namespace clearance
