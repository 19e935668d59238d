// Warnings about a scene in the log.
#pragma once

#include <span>

#include "engine/scene/mesh_warning.h"

namespace clearance {

/// Logs bodies whose convex parts stand far out of their meshes, once for each mesh. They must be found before, which
/// takes long.
void log_mesh_warnings(const engine::Scene& scene, std::span<const MeshWarning> warnings);
/// Logs probable mistakes in the scene file, and omissions from its robots' files.
void log_file_warnings(const engine::Scene& scene);

}  // namespace clearance
