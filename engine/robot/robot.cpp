#include "engine/robot/robot.h"

#include <algorithm>
#include <filesystem>

namespace clearance {

namespace fs = std::filesystem;

namespace {

template <class T>
std::uint32_t index_of(const std::vector<T>& all, std::string_view name) {
  const auto at = std::find_if(all.begin(), all.end(), [&](const T& one) { return one.name == name; });
  return at == all.end() ? kNone : static_cast<std::uint32_t>(at - all.begin());
}

}  // namespace

std::uint32_t RobotModel::find_link(std::string_view link) const {
  return index_of(links, link);
}

std::uint32_t RobotModel::find_joint(std::string_view joint) const {
  return index_of(joints, joint);
}

std::uint32_t RobotModel::find_column(std::string_view column) const {
  return index_of(columns, column);
}

const RobotGroup* RobotModel::find_group(std::string_view group) const {
  const std::uint32_t at = index_of(groups, group);
  return at == kNone ? nullptr : &groups[at];
}

std::vector<std::uint32_t> RobotModel::chain_to(std::uint32_t link) const {
  std::vector<std::uint32_t> chain;
  for (std::uint32_t j = links[link].joint; j != kNone; j = links[joints[j].parent].joint) chain.push_back(j);
  std::reverse(chain.begin(), chain.end());
  return chain;
}

std::string mesh_path(const RobotShape& shape, const std::string& folder,
                      const std::map<std::string, std::string>& packages) {
  const auto fail = [&](const std::string& why) {
    throw RobotError(shape.place + ": mesh " + excerpt(shape.mesh) + ": " + why);
  };
  constexpr std::string_view kPackage = "package://", kFile = "file://";
  const std::string_view named = shape.mesh;
  fs::path path;
  if (named.starts_with(kPackage)) {
    const std::string_view rest = named.substr(kPackage.size());
    const std::string package(rest.substr(0, rest.find('/')));
    const auto at = packages.find(package);
    if (at == packages.end()) fail("the package " + excerpt(package) + " has no folder here; name it under packages");
    path = fs::path(at->second) / fs::path(rest.substr(package.size())).relative_path();
  } else if (named.starts_with(kFile)) {
    path = named.substr(kFile.size());
  } else if (const std::size_t scheme = named.find("://"); scheme != std::string_view::npos) {
    fail("expected a path, package:// or file://");
  } else {
    path = fs::path(folder) / named;
  }
  std::error_code error;
  if (!fs::is_regular_file(path, error)) fail("there is no file " + path.string());
  return path.string();
}

}  // namespace clearance
