// What the log says of a scene.
#pragma once

#include <span>

#include "engine/scene/mesh_warning.h"

namespace clearance {

/// Of bodies whose pieces stand far out of their meshes, once for each mesh. To find them takes time: it is not done
/// here.
void log_mesh_warnings(const Scene& scene, std::span<const MeshWarning> warnings);
/// Of what is probably a mistake in the scene file, and of what was left out of its robots' files or is suspicious
/// there.
void log_file_warnings(const Scene& scene);

}  // namespace clearance
