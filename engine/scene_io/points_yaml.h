// The geometries of a scene file that are read from files of points: clouds, octomaps and height fields.
#pragma once

#include <functional>
#include <string>

#include "engine/scene/geometry.h"
#include "engine/scene_io/yaml_document.h"

namespace clearance {

/// How a geometry is made, once everything is read; throws std::exception.
using MakeGeometry = std::function<Geometry()>;
/// The path of the file that a value names. Fails for one that may not be read.
using ResolvePath = std::function<std::string(const YamlValue&)>;

/// Whether `points` is a cloud: a file's, or an empty list. Any other list is the hull of its points.
bool is_cloud_value(const YamlValue& points);
/// Says of a body what its points will be, where it has none yet. \param value the body's map
void read_no_points(const YamlValue& value, Body& body);
/// \param body the map that the value stands in, whose `voxel` is read
MakeGeometry read_cloud(const YamlValue& body, const YamlValue& points, double radius, const ResolvePath& resolve);
/// \param body whose `unknown` is read: what space counts as of which the map says nothing
MakeGeometry read_octomap(const YamlValue& body, const YamlValue& file, double radius, const ResolvePath& resolve);
/// \param body whose `cell` is read: metres between samples
MakeGeometry read_height_field(const YamlValue& body, const YamlValue& file, double radius, const ResolvePath& resolve);

}  // namespace clearance
