#include "engine/scene_io/robot_yaml.h"

#include <filesystem>
#include <fstream>

namespace clearance {

namespace {

void read_home(const YamlValue& value, engine::RobotOptions& options) {
  if (value.is_text()) {
    options.home_state = value.text("the name of a group state");
    return;
  }
  options.home.emplace();
  for (const auto& [joint, position] : value.map("positions by joint, or the name of a group state of the SRDF"))
    (*options.home)[joint] = position.number("radians or metres");
}

void read_padding(const YamlValue& value, engine::RobotOptions& options) {
  if (!value.is_map()) {
    options.padding = value.not_negative();
    return;
  }
  for (const auto& [link, metres] : value.map("")) options.link_padding[link] = metres.not_negative();
}

void read_geometry(const YamlValue& value, engine::RobotOptions& options, const ResolvePath& resolve) {
  if (value.is_map()) {
    options.geometry_files.emplace();
    for (const auto& [link, file] : value.map("")) (*options.geometry_files)[link] = resolve(file);
    return;
  }
  const std::string which = value.text("collision or visual");
  if (which != "collision" && which != "visual") value.fail_expected("collision or visual");
  options.visual = which == "visual";
}

void read_robot_mesh_as(const YamlValue& value, engine::RobotOptions& options) {
  if (!value.is_map()) {
    options.mesh_as = read_mesh_as(value);
    return;
  }
  for (const auto& [link, how] : value.map("")) options.link_mesh_as[link] = read_mesh_as(how);
}

}  // namespace

MeshAs read_mesh_as(const YamlValue& value) {
  constexpr const char* kExpected = "auto, hull, parts, surface or solid";
  const std::optional<MeshAs> mesh_as = mesh_as_of(value.text(kExpected));
  if (!mesh_as) value.fail_expected(kExpected);
  return *mesh_as;
}

Uncertainty read_uncertainty(const YamlValue& value) {
  value.map("a map, such as {position: 0.002, angle: 0.01}");
  value.check_keys({"position", "angle"});
  Uncertainty uncertainty;
  if (const auto position = value.find("position")) uncertainty.position = position->not_negative();
  if (const auto angle = value.find("angle")) uncertainty.angle = angle->not_negative();
  return uncertainty;
}

bool is_robot_file(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return false;
  std::ifstream file(path, std::ios::binary);
  char begin[3] = {};
  file.read(begin, 3);
  file.clear();
  file.seekg(std::string_view(begin, 3) == "\xEF\xBB\xBF" ? 3 : 0);
  char first = 0;
  return (file >> first) && first == '<';
}

engine::Scene scene_of_robot(const std::string& path, bool allow_outside) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  const engine::RobotOptions options{
      .urdf = path, .allow_outside = allow_outside, .folder = folder.empty() ? "." : folder};
  try {
    engine::Scene scene;
    scene.add_robot(read_urdf(path).name, options);
    return scene;
  } catch (const std::runtime_error& e) {  // RobotError or SceneError, which may lack the place
    const std::string what = e.what();
    throw engine::SceneError(what.starts_with(path) ? what : path + ": " + what);
  }
}

RobotPlan read_robot(const YamlValue& value, const ResolvePath& resolve) {
  value.map("a robot, such as {name: panda, urdf: panda.urdf}");
  value.check_keys({"name", "urdf", "srdf", "packages", "base", "parent", "static", "requires_pose", "geometry", "home",
                    "padding", "uncertainty", "mesh_as"});
  const auto name = value.find("name"), urdf = value.find("urdf");
  if (!name) value.fail("expected the key \"name\"");
  if (!urdf) value.fail("expected the key \"urdf\"");
  RobotPlan plan{value, name->text("a name"), {}, {}};
  engine::RobotOptions& options = plan.options;
  options.urdf = resolve(*urdf);
  if (const auto srdf = value.find("srdf")) options.srdf = resolve(*srdf);
  if (const auto packages = value.find("packages"))
    for (const auto& [package, folder] : packages->map("a map of packages to their folders"))
      options.packages[package] = resolve(folder);
  if (const auto base = value.find("base")) options.base = base->pose();
  if (const auto parent = value.find("parent")) {
    parent->text("the name of a body");
    plan.parent = *parent;
  }
  if (const auto is_static = value.find("static")) options.is_static = is_static->boolean();
  if (const auto requires_pose = value.find("requires_pose")) plan.requires_pose = requires_pose->boolean();
  if (const auto geometry = value.find("geometry")) read_geometry(*geometry, options, resolve);
  if (const auto mesh_as = value.find("mesh_as")) {
    if (options.geometry_files) mesh_as->fail("the geometry files of a saved scene cannot be converted");
    read_robot_mesh_as(*mesh_as, options);
  }
  if (const auto home = value.find("home")) read_home(*home, options);
  if (const auto padding = value.find("padding")) read_padding(*padding, options);
  if (const auto uncertainty = value.find("uncertainty"))
    for (const auto& [link, doubt] : uncertainty->map("a map of links to their uncertainty"))
      options.link_uncertainty[link] = read_uncertainty(doubt);
  return plan;
}

}  // namespace clearance
