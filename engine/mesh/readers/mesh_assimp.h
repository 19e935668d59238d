// Formats that assimp alone reads: unit of length, axes and rounding (mesh_formats.h lists them).
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include "engine/mesh/mesh_folder.h"
#include "engine/mesh/mesh_formats.h"
#include "engine/mesh/mesh_part.h"

namespace Assimp {
class Importer;
}

namespace clearance {

/// Facts of a file that assimp does not report.
struct AssimpFacts {
  double metres = 1;   ///< length of the file's unit, if it declares one outside assimp's metadata
  double largest = 0;  ///< largest coordinate in the file, if assimp may make it smaller by subtraction
};

/// Checks a file before assimp reads it. Throws LoadError for content that assimp would drop or approximate, and for
/// units that are unknown.
AssimpFacts check_assimp(const AssimpFormat& format, std::string_view content);

/// A part for each mesh of each node that shows one, in metres, in the file's axes. Throws LoadError and
/// std::bad_alloc.
/// \param kept gets the importer, with its scene
/// \param most_vertices of all parts together, if nodes repeat meshes
void read_assimp(const AssimpFormat& format, std::unique_ptr<Assimp::Importer>* kept, const std::filesystem::path& path,
                 std::string_view content, const MeshFolder& folder, std::uint64_t most_vertices, const PartSink& sink);

}  // namespace clearance
