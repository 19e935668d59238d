// Mesh files of any bytes through the project's own readers and its checks before assimp, in this process.
#include <cmath>
#include <filesystem>

#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"
#include "engine/mesh/readers/mesh_assimp.h"
#include "engine/mesh/readers/mesh_dae.h"
#include "engine/mesh/readers/mesh_gltf.h"
#include "tests/fuzz/mesh_extension.h"
#include "tests/fuzz/scratch_file.h"

CLEARANCE_FUZZ_TARGET(mesh_readers) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static const ScratchFolder folder;
  Input in(bytes);
  const std::string extension = next_mesh_extension(in);
  const Bytes rest = in.rest();
  const std::string_view content(reinterpret_cast<const char*>(rest.data()), rest.size());
  int parts = 0;
  const PartSink sink = [&parts](const MeshPart& part) {
    ++parts;
    require(part.rounding >= 0 && std::isfinite(part.rounding), "the rounding is a length");
    for (const Vec3d& p : part.positions)
      require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z), "positions are finite");
    for (const Triangle& t : part.triangles)
      for (const std::uint32_t i : t) require(i < part.positions.size(), "triangles join positions that there are");
  };
  try {
    if (extension == "obj") read_obj(content, sink);
    if (extension == "off") read_off(content, sink);
    if (extension == "ply") read_ply(content, sink);
    if (extension == "stl") read_stl(content, sink);
    if (extension == "gltf" || extension == "glb") {
      static const std::string beside = folder.write("mesh.gltf", {});
      read_gltf(content, extension == "glb", MeshFolder(beside), 100'000, sink);
    }
    if (extension == "dae") {
      check_dae(content);
      ++parts;
    }
    if (const AssimpFormat* format = find_assimp_format(extension)) {
      check_assimp(*format, content);
      ++parts;
    }
    return parts > 0;
  } catch (const LoadError& error) {
    const std::size_t length = std::string(error.what()).size();
    require(length > 0 && length < 500, "a complaint about a file does not quote all of it");
    return false;
  }
}
