// Geometries of a scene file that come from files of points: clouds, octomaps and height fields.
#pragma once

#include <functional>
#include <string>

#include "engine/geometry/geometry.h"
#include "engine/scene_io/yaml_document.h"

namespace clearance {

/// Makes a geometry after the scene file is read. Throws std::exception.
using MakeGeometry = std::function<Geometry()>;
/// Returns the path of the file that a value names. Fails for a file outside the permitted folder.
using ResolvePath = std::function<std::string(const YamlValue&)>;

/// Whether `points` is a cloud: a file name or an empty list. Any other list means the hull of its points.
bool is_cloud_value(const YamlValue& points);
/// \param body the map around the value, with the keys `voxel` and `requires_pose`
MakeGeometry read_cloud(const YamlValue& body, const YamlValue& points, double radius, const ResolvePath& resolve);
/// \param body with the key `unknown`: how space without a voxel counts
MakeGeometry read_octomap(const YamlValue& body, const YamlValue& file, double radius, const ResolvePath& resolve);
/// \param body with the key `cell`: metres between samples
MakeGeometry read_height_field(const YamlValue& body, const YamlValue& file, double radius, const ResolvePath& resolve);

}  // namespace clearance
