// Collada (DAE), read by assimp after a check of its XML, which rejects files that assimp reads slowly or wrongly and
// bounds the rounding of float32.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include "engine/mesh/mesh_folder.h"
#include "engine/mesh/mesh_part.h"

namespace Assimp {
class Importer;
}

namespace clearance {

struct DaeFacts {
  /// Bound on the error of any position after assimp has read it and applied the transforms of its nodes, in metres and
  /// the maximum norm.
  double rounding;
  bool has_fans;  ///< faces of more than three corners are fans around their first one (<trifans>), not polygons
};

/// Checks the file's XML before assimp reads it. Throws LoadError for nodes that multiply, and for elements that assimp
/// reads wrongly.
DaeFacts check_dae(std::string_view content);

/// A part for each mesh of each node that shows one, front to back. Throws LoadError and std::bad_alloc.
/// \param kept gets the importer, with its scene
/// \param most_vertices of all parts together, if nodes repeat meshes
void read_dae(std::unique_ptr<Assimp::Importer>* kept, const std::filesystem::path& path, std::string_view content,
              const MeshFolder& folder, std::uint64_t most_vertices, const PartSink& sink);

}  // namespace clearance
