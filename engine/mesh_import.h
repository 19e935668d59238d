// What the mesh loader does with a file: assimp reads it, and what it holds goes to a descriptor (mesh_format.h).
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace Assimp {
class Importer;
}

namespace clearance {

/// Reads a mesh file and writes its meshes, or what is wrong with it, to `result_fd`. Whether the result is whole.
/// \param kept gets the importer, with what it has read. \param memory_bytes that a result may have.
bool import_mesh(std::unique_ptr<Assimp::Importer>* kept, const std::string& path, std::uint64_t memory_bytes, int result_fd);

}  // namespace clearance
