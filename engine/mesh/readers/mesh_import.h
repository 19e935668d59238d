// Import of a mesh file by the reader of its format (mesh_formats.h), written to a descriptor (mesh_format.h).
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace Assimp {
class Importer;
}

namespace clearance {

/// Writes the meshes of a file, or an error, to `result_fd`. Returns whether the result is complete.
/// \param kept gets assimp's importer with its scene, if assimp reads the format
/// \param path selects the format by its extension, and the folder of other files
/// \param content of the file; must outlive the importer
/// \param memory_bytes limit of the result's size
/// \param as_heights reads an NPY as a grid of heights, not as rows of points
bool import_mesh(std::unique_ptr<Assimp::Importer>* kept, const std::string& path, std::string_view content,
                 std::uint64_t memory_bytes, int result_fd, bool as_heights = false);

}  // namespace clearance
