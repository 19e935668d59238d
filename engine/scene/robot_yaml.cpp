#include "engine/scene/robot_yaml.h"

namespace clearance {

namespace {

void read_home(const YamlValue& value, RobotOptions& options) {
  if (value.is_text()) {
    options.home_state = value.text("the name of a group state");
    return;
  }
  options.home.emplace();
  for (const auto& [joint, position] : value.map("positions by joint, or the name of a group state of the SRDF"))
    (*options.home)[joint] = position.number("radians or metres");
}

void read_padding(const YamlValue& value, RobotOptions& options) {
  if (!value.is_map()) {
    options.padding = value.not_negative();
    return;
  }
  for (const auto& [link, metres] : value.map("")) options.link_padding[link] = metres.not_negative();
}

}  // namespace

RobotPlan read_robot(const YamlValue& value, const std::function<std::string(const YamlValue&)>& resolve) {
  value.map("a robot, such as {name: panda, urdf: panda.urdf}");
  value.check_keys({"name", "urdf", "srdf", "packages", "base", "parent", "static", "geometry", "home", "padding"});
  const auto name = value.find("name"), urdf = value.find("urdf");
  if (!name) value.fail("expected the key \"name\"");
  if (!urdf) value.fail("expected the key \"urdf\"");
  RobotPlan plan{value, name->text("a name"), {}};
  RobotOptions& options = plan.options;
  options.urdf = resolve(*urdf);
  if (const auto srdf = value.find("srdf")) options.srdf = resolve(*srdf);
  if (const auto packages = value.find("packages"))
    for (const auto& [package, folder] : packages->map("a map of packages to their folders"))
      options.packages[package] = resolve(folder);
  if (const auto base = value.find("base")) options.base = base->pose();
  if (const auto parent = value.find("parent")) options.parent = parent->text("the name of a body");
  if (const auto is_static = value.find("static")) options.is_static = is_static->boolean();
  if (const auto geometry = value.find("geometry")) {
    const std::string which = geometry->text("collision or visual");
    if (which != "collision" && which != "visual") geometry->fail_expected("collision or visual");
    options.visual = which == "visual";
  }
  if (const auto home = value.find("home")) read_home(*home, options);
  if (const auto padding = value.find("padding")) read_padding(*padding, options);
  return plan;
}

}  // namespace clearance
