// glTF 2.0, as JSON or GLB: positions are float32 in the file and stay as they are; transforms of nodes are float64.
#pragma once

#include <cstdint>
#include <string_view>

#include "engine/mesh/mesh_folder.h"
#include "engine/mesh/mesh_part.h"

namespace clearance {

/// A part for each primitive of each node that shows a mesh, front to back.
/// Throws LoadError.
/// \param glb whether it is the binary container
/// \param most_vertices of all parts together, if nodes repeat meshes
void read_gltf(std::string_view content, bool glb, const MeshFolder& folder, std::uint64_t most_vertices,
               const PartSink& sink);

}  // namespace clearance
