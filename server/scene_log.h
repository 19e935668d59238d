// What the log says of a scene.
#pragma once

#include "engine/scene/scene.h"

namespace clearance {

/// Warns of bodies whose pieces stand far out of their meshes (hull_warning()), once for each mesh, and of what was
/// left out of the SRDFs of robots.
void log_scene_warnings(const Scene& scene);

}  // namespace clearance
