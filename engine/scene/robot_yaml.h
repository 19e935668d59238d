// The robots of a scene file.
#pragma once

#include <functional>
#include <string>

#include "engine/scene/scene_robot.h"
#include "engine/scene/yaml_document.h"

namespace clearance {

struct RobotPlan {
  YamlValue place;
  std::string name;
  RobotOptions options;
};

/// One of the list `robots`. Throws SceneError. \param resolve the file or folder that a value of the scene file names
RobotPlan read_robot(const YamlValue& value, const std::function<std::string(const YamlValue&)>& resolve);

}  // namespace clearance
