// Robots of a scene file.
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
  engine::RobotOptions options;  ///< except the parent, which may come later in the file
  std::optional<YamlValue> parent;
  bool requires_pose = false;
};

/// Returns the path of a file or folder that a value names.
using ResolvePath = std::function<std::string(const YamlValue&)>;

/// Reads the geometry of a mesh. Throws SceneError.
MeshAs read_mesh_as(const YamlValue& value);

/// Reads the uncertainty of a body's or link's pose. Throws SceneError.
Uncertainty read_uncertainty(const YamlValue& value);

/// Whether a scene file is a URDF: it begins as XML.
bool is_robot_file(const std::string& path);

/// Makes a scene of a URDF: a robot with the URDF's name, without positions at load. Throws SceneError.
engine::Scene scene_of_robot(const std::string& path, bool allow_outside);

/// Reads an entry of the list `robots`. Throws SceneError.
RobotPlan read_robot(const YamlValue& value, const ResolvePath& resolve);

}  // namespace clearance
