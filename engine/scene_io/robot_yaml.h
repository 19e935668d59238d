// The robots of a scene file.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "engine/scene/scene.h"
#include "engine/scene_io/yaml_document.h"

namespace clearance {

struct RobotPlan {
  YamlValue place;
  std::string name;
  RobotOptions options;  ///< but its parent, which may come later in the file
  std::optional<YamlValue> parent;
  bool is_live = false;
};

/// The file or folder that a value of the scene file names.
using ResolvePath = std::function<std::string(const YamlValue&)>;

/// What the body of a mesh is. Throws SceneError.
Convexify read_convexify(const YamlValue& value);

/// What is not known of a body's pose, or of a link's. Throws SceneError.
Uncertainty read_uncertainty(const YamlValue& value);

/// Whether a scene file is a URDF: XML, which no scene file begins like.
bool is_robot_file(const std::string& path);

/// The scene of a URDF alone: a robot of the URDF's name, without positions at load. Throws SceneError.
Scene scene_of_robot(const std::string& path, bool allow_outside);

/// One of the list `robots`. Throws SceneError.
RobotPlan read_robot(const YamlValue& value, const ResolvePath& resolve);

}  // namespace clearance
