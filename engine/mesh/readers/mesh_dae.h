// Collada (DAE), read by assimp, after a look at the file of our own: what would keep assimp busy for long or be read
// wrongly is refused, and what float32 does to the rest is bounded.
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
  /// Metres, in the maximum norm: how far any position may be from what the file means once assimp has read it and
  /// multiplied the transforms of its nodes.
  double rounding;
  bool has_fans;  ///< faces of more than three corners are fans around their first one (<trifans>), not polygons
};

/// Checks the file's XML before assimp reads it. Throws LoadError for nodes that multiply, and for what assimp reads
/// wrongly.
DaeFacts check_dae(std::string_view content);

/// A part for each mesh of each node that shows one, front to back. Throws LoadError and std::bad_alloc.
/// \param kept gets the importer, with what it has read. \param most_vertices that nodes which repeat meshes may make
/// of them.
void read_dae(std::unique_ptr<Assimp::Importer>* kept, const std::filesystem::path& path, std::string_view content,
              const MeshFolder& folder, std::uint64_t most_vertices, const PartSink& sink);

}  // namespace clearance
