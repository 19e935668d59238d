// clearance-mesh-loader: reads one mesh file and returns its vertices and triangles (mesh_format.h).
//
// A separate process, because assimp crashes, hangs or exhausts memory on some damaged files, and a hostile file may
// exploit it. Started by mesh.cpp only:
//   clearance-mesh-loader FILE MEMORY_BYTES CPU_SECONDS AS_HEIGHTS
#include <assimp/Importer.hpp>
#include <memory>

#include "engine/mesh/loader/loader_process.h"
#include "engine/mesh/readers/mesh_import.h"

int main(int argc, char** argv) {
  return clearance::loader_main(argc, argv,
                                [](const std::string& path, std::string_view content, std::uint64_t memory_bytes,
                                   int result_fd, bool as_heights) {
                                  auto* kept = new std::unique_ptr<Assimp::Importer>;  // outlives the result
                                  return clearance::import_mesh(kept, path, content, memory_bytes, result_fd,
                                                                as_heights);
                                });
}
