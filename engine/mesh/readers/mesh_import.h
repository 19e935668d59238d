// What the mesh loader does with a file: the reader of its format reads it, and what it holds goes to a descriptor
// (mesh_format.h). mesh_formats.h lists which formats go through assimp.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace Assimp {
class Importer;
}

namespace clearance {

/// Reads a mesh file and writes its meshes, or what is wrong with it, to `result_fd`. Whether the result is whole.
/// \param kept gets assimp's importer, with what it has read, if it is asked. \param path says the format and in which
/// folder other files may lie. \param content what is read for the file; must outlive the importer.
/// \param memory_bytes that a result may have. \param as_heights an NPY is a grid of heights, not rows of points.
bool import_mesh(std::unique_ptr<Assimp::Importer>* kept, const std::string& path, std::string_view content,
                 std::uint64_t memory_bytes, int result_fd, bool as_heights = false);

}  // namespace clearance
