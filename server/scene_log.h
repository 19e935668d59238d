// What the log says of a scene's bodies.
#pragma once

#include "engine/scene/scene.h"

namespace clearance {

/// Warns of bodies whose pieces stand far out of their meshes (hull_warning()): once for each mesh.
void log_hull_warnings(const Scene& scene);

}  // namespace clearance
