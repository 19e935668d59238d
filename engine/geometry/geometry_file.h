// Geometries in files of their own, as Scene::save() writes them: exactly what the engine has.
#pragma once

#include <string>

#include "engine/geometry/geometry.h"

namespace clearance {

/// Writes a geometry, its source included. The name is made of the content, so that equal geometries are one file.
/// Returns it. Throws SceneError.
std::string write_geometry_file(const std::string& folder, const Geometry& geometry);

/// Reads one. Throws SceneError for a file that cannot be read, is none of these, or is damaged: its digest is in it.
Geometry read_geometry_file(const std::string& path);

}  // namespace clearance
