#include "engine/mesh/readers/mesh_assimp.h"

#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <cmath>
#include <utility>

#include "engine/mesh/mesh_text.h"
#include "engine/mesh/readers/assimp_file.h"

namespace clearance {

namespace {

// A coordinate is parsed or converted, and multiplied and added a few times, in float32.
constexpr double kPositionRounding = 16 * 0x1p-24;
// A node's matrix is a product of a few rotations, scales and translations in float32.
constexpr double kNodeRounding = 64 * 0x1p-24;

// The declared unit times the axes of the file. assimp leaves FBX in its unit, which its metadata names.
MeshTransform root_of(const AssimpFormat& format, double metres, const aiScene& scene) {
  float centimetres = 1;
  double off = 0x1p-52;
  if (format.extension == "fbx" && scene.mMetaData && scene.mMetaData->Get("UnitScaleFactor", centimetres)) {
    metres = 0.01 * static_cast<double>(centimetres);
    off = 0x1p-23;
  } else if (format.extension == "fbx") {
    metres = 0.01;
  }
  if (!(metres > 0 && std::isfinite(metres)))
    throw LoadError("its unit of length is " + std::to_string(metres) + " metres; expected a positive number");
  MeshTransform out;
  if (metres != 1)
    for (int i = 0; i < 3; ++i) {
      out.m[i][i] = metres;
      out.error[i][i] = off * metres;
    }
  if (!format.is_turned) return out;
  return out.after({{{1, 0, 0, 0}, {0, 0, -1, 0}, {0, 1, 0, 0}}, {}});
}

}  // namespace

void read_assimp(const AssimpFormat& format, std::unique_ptr<Assimp::Importer>* kept, const std::filesystem::path& path,
                 std::string_view content, const MeshFolder& folder, std::uint64_t most_vertices,
                 const PartSink& sink) {
  const AssimpFacts facts = check_assimp(format, content);
  const AssimpFile file(kept, path, content, folder,
                        {.extension = std::string(format.extension),
                         .node_rounding = kNodeRounding,
                         .position_rounding = kPositionRounding,
                         .inverts_nodes = format.inverts_nodes});
  const MeshTransform root = root_of(format, facts.metres, file.scene());
  const double condition = format.inverts_nodes ? file.worst_condition() : 1;
  const double subtracted = kNodeRounding * facts.largest * condition * condition * facts.metres;
  file.read(root, most_vertices, [&](MeshPart part) {
    part.rounding += subtracted;
    sink(std::move(part));
  });
}

}  // namespace clearance
