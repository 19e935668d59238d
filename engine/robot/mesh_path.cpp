// Resolves the mesh names of a URDF: paths, file:// and package://, with packages from the environment of ROS.
#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "engine/robot/robot.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kPackage = "package://", kFile = "file://";
// Limits of a search below ROS_PACKAGE_PATH, which may lead to a home folder.
constexpr int kMaxSearchDepth = 16;
constexpr std::size_t kMaxFolders = 50'000;

// Decodes a URI's path: "%20" is a space. Invalid escapes are kept.
std::string decoded(std::string_view path) {
  std::string out;
  for (std::size_t i = 0; i < path.size(); ++i) {
    unsigned char byte = 0;
    const char* digits = path.data() + i + 1;
    if (path[i] == '%' && i + 2 < path.size() && std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2 &&
        byte != 0) {
      out += static_cast<char>(byte);
      i += 2;
    } else {
      out += path[i];
    }
  }
  return out;
}

struct PackagePath {
  std::string package;
  std::string_view rest;
};

// Splits the text after package://, which some files write with a third slash.
PackagePath package_path(std::string_view named) {
  named.remove_prefix(kPackage.size());
  named.remove_prefix(std::min(named.find_first_not_of('/'), named.size()));
  const std::string_view package = named.substr(0, named.find('/'));
  return {std::string(package), named.substr(package.size())};
}

std::vector<std::string> folders_of(const char* variable) {
  std::vector<std::string> folders;
  const char* value = std::getenv(variable);
  for (std::string_view rest = value ? value : ""; !rest.empty();) {
    const std::string_view folder = rest.substr(0, rest.find(':'));
    if (!folder.empty()) folders.emplace_back(folder);
    rest.remove_prefix(std::min(folder.size() + 1, rest.size()));
  }
  return folders;
}

// The name in a package.xml, or else the folder's name.
std::string package_name(const fs::path& folder) {
  try {
    const std::string text = read_text((folder / "package.xml").string());
    const std::size_t open = text.find("<name>"), close = text.find("</name>");
    if (open != std::string::npos && close != std::string::npos && open + 6 < close) {
      const std::string name = text.substr(open + 6, close - open - 6);
      const std::size_t begin = name.find_first_not_of(" \t\r\n"), end = name.find_last_not_of(" \t\r\n");
      if (begin != std::string::npos) return name.substr(begin, end - begin + 1);
    }
  } catch (const RobotError&) {
  }
  return folder.filename().string();
}

// Packages below the folders of ROS_PACKAGE_PATH, by the rules of rospack: no package lies in another.
class PackageSearch {
 public:
  PackageSearch(std::set<std::string>* wanted, std::map<std::string, std::string>* found)
      : wanted_(*wanted), found_(*found) {}

  void visit(const fs::path& folder, int depth) {
    std::error_code error;
    const auto has = [&](const char* file) { return fs::exists(folder / file, error); };
    if (wanted_.empty() || ++folders_ > kMaxFolders || depth > kMaxSearchDepth || has("CATKIN_IGNORE")) return;
    if (has("package.xml") || has("manifest.xml")) {
      const std::string name = package_name(folder);
      if (wanted_.erase(name)) found_.emplace(name, folder.string());
      return;
    }
    std::vector<fs::path> inner;
    for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
      if (std::error_code other; at->is_directory(other) && !at->path().filename().string().starts_with('.'))
        inner.push_back(at->path());
    std::sort(inner.begin(), inner.end());
    for (const fs::path& path : inner) visit(path, depth + 1);
  }

 private:
  std::set<std::string>& wanted_;
  std::map<std::string, std::string>& found_;
  std::size_t folders_ = 0;
};

}  // namespace

void find_packages(const RobotModel& robot, bool visual, std::map<std::string, std::string>* packages) {
  std::set<std::string> wanted;
  for (const RobotLink& link : robot.links)
    for (const RobotShape& shape : visual ? link.visual : link.collision)
      if (shape.mesh.starts_with(kPackage)) wanted.insert(package_path(shape.mesh).package);
  std::erase_if(wanted, [&](const std::string& package) {
    return package.empty() || package.starts_with('.') || packages->contains(package);
  });
  std::error_code error;
  for (const std::string& prefix : folders_of("AMENT_PREFIX_PATH"))
    std::erase_if(wanted, [&](const std::string& package) {
      const fs::path folder = fs::path(prefix) / "share" / package;
      return fs::is_directory(folder, error) && packages->emplace(package, folder.string()).second;
    });
  PackageSearch search(&wanted, packages);
  for (const std::string& folder : folders_of("ROS_PACKAGE_PATH")) search.visit(fs::path(folder), 0);
}

std::string mesh_path(const RobotShape& shape, const std::string& folder,
                      const std::map<std::string, std::string>& packages) {
  const auto fail = [&](const std::string& why) {
    throw RobotError(shape.place + ": mesh " + excerpt(shape.mesh) + ": " + why);
  };
  const std::string_view named = shape.mesh;
  const bool is_uri = named.starts_with(kPackage) || named.starts_with(kFile);
  fs::path home = folder;
  std::string_view path = named;
  if (named.starts_with(kPackage)) {
    const auto [package, rest] = package_path(named);
    const auto at = packages.find(package);
    if (at == packages.end() && rest.empty()) fail("it names no package; expected package://NAME/...");
    if (at == packages.end())
      fail("the package " + excerpt(package) +
           " has no folder here, and neither AMENT_PREFIX_PATH nor ROS_PACKAGE_PATH leads to one; name it under "
           "packages");
    home = at->second;
    path = rest.substr(std::min(rest.find_first_not_of('/'), rest.size()));
  } else if (named.starts_with(kFile)) {
    home.clear();
    path.remove_prefix(kFile.size());
    if (path.starts_with("localhost/")) path.remove_prefix(9);
  } else if (named.find("://") != std::string_view::npos) {
    fail("expected a path, package:// or file://");
  }
  std::error_code error;
  const fs::path plain = home / path, there = is_uri ? home / decoded(path) : plain;
  if (fs::is_regular_file(there, error)) return there.string();
  if (!fs::is_regular_file(plain, error)) fail("there is no file " + there.string());
  return plain.string();
}

}  // namespace clearance
