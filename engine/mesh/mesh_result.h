// Validation of a mesh loader's result.
#pragma once

#include <optional>

#include "engine/mesh/mesh.h"
#include "engine/mesh/mesh_format.h"

namespace clearance {

/// Reads a loader's result (mesh_format.h); none if the loader ended before it was complete. Throws MeshError with the
/// loader's error, or for an invalid result.
/// \param fd of the result of a loader that has ended
/// \param limits receives the limits that were in force, unless there is no result
std::optional<Mesh> read_mesh_result(int fd, LoaderLimits* limits = nullptr);

}  // namespace clearance
