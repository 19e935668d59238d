// Geometry files of Scene::save(), which restore a geometry exactly.
#pragma once

#include <string>

#include "engine/geometry/geometry.h"

namespace clearance {

/// Writes a geometry with its source, and returns the file name. The name is derived from the content, so that equal
/// geometries share a file. Throws SceneError.
std::string write_geometry_file(const std::string& folder, const Geometry& geometry);

/// Reads a geometry. Throws SceneError for a file that cannot be read, has another format, or is damaged; the file
/// contains its digest.
Geometry read_geometry_file(const std::string& path);

}  // namespace clearance
