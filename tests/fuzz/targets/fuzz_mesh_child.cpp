// Arbitrary mesh files through the loader's process, as for a scene: this process survives and gets a mesh or an error.
// The loader may crash; the target mesh_import tests it.
#include <cmath>

#include "engine/mesh/mesh.h"
#include "tests/fuzz/mesh_extension.h"
#include "tests/fuzz/scratch_file.h"

CLEARANCE_FUZZ_TARGET(mesh_child) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static const ScratchFolder folder;
  Input in(bytes);
  const std::string extension = next_mesh_extension(in);
  const std::string path = folder.write("mesh." + extension, in.rest());
  MeshLimits limits;
  limits.time = std::chrono::milliseconds(5000);
  limits.memory_bytes = std::uint64_t{1} << 30;
  try {
    const Mesh mesh = load_mesh(path, limits);
    for (const Submesh& part : mesh.submeshes)
      for (const Vec3d& v : part.vertices)
        require(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z), "vertices are finite");
    return !mesh.submeshes.empty();
  } catch (const MeshError& error) {
    require(error.what()[0] != '\0', "an error says why");
    return false;
  }
}
