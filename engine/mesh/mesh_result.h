// What the mesh loader has handed back, read by a process that trusts none of it.
#pragma once

#include <optional>

#include "engine/mesh/mesh.h"
#include "engine/mesh/mesh_format.h"

namespace clearance {

/// Reads a loader's result (mesh_format.h); none if there is none, since the loader ended before it was whole.
/// Throws MeshError with what the loader says is wrong with the file, or because the result makes no sense.
/// \param fd of a file that nobody writes any more: the loader has ended. \param limits what had held it; set where
/// there is a result or an error of its own.
std::optional<Mesh> read_mesh_result(int fd, LoaderLimits* limits = nullptr);

}  // namespace clearance
