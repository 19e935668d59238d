#include "engine/mesh/readers/mesh_dae.h"

#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <cmath>
#include <utility>

#include "engine/mesh/readers/assimp_file.h"

namespace clearance {

void read_dae(std::unique_ptr<Assimp::Importer>* kept, const std::filesystem::path& path, std::string_view content,
              const MeshFolder& folder, std::uint64_t most_vertices, const PartSink& sink) {
  const DaeFacts facts = check_dae(content);
  const double rounding = std::sqrt(3.0) * (1 + 1e-9) * facts.rounding;  // a length, of a bound on each coordinate
  const AssimpFile file(kept, path, content, folder, {.extension = "dae", .has_fans = facts.has_fans});
  file.read({}, most_vertices, [&](MeshPart part) {
    part.rounding += rounding;
    sink(std::move(part));
  });
}

}  // namespace clearance
