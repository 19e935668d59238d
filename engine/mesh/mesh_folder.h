// The folder of a mesh file, the only place where other files that it names are read.
#pragma once

#include <array>
#include <filesystem>
#include <string>

namespace clearance {

class MeshFolder {
 public:
  /// Allows the folder of `file` and, for a link, the folder of its target.
  explicit MeshFolder(const std::filesystem::path& file);

  /// Returns whether a path lies inside after links are resolved.
  bool holds(const std::filesystem::path& path) const;
  /// Returns the bytes of a regular file inside. Throws LoadError.
  /// \param name relative to the folder
  std::string read(const std::string& name) const;
  /// Returns whether no other file was requested, so that the mesh depends on its own file alone.
  bool alone() const { return alone_; }

 private:
  std::filesystem::path named_in_;
  std::array<std::filesystem::path, 2> folders_;
  mutable bool alone_ = true;
};

}  // namespace clearance
