// Arbitrary mesh files through assimp in this process. A crash here is assimp's and would only end a loader; any other
// outcome must leave a result that the reader accepts.
#include <sys/mman.h>
#include <unistd.h>

#include <assimp/DefaultLogger.hpp>
#include <assimp/Importer.hpp>
#include <memory>

#include "engine/mesh/mesh_result.h"
#include "engine/mesh/readers/mesh_import.h"
#include "tests/fuzz/mesh_extension.h"
#include "tests/fuzz/scratch_file.h"

CLEARANCE_FUZZ_TARGET(mesh_import) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static const ScratchFolder folder;
  static const int fd = ::memfd_create("clearance-fuzz", MFD_CLOEXEC);
  Input in(bytes);
  const std::string extension = next_mesh_extension(in);
  const Bytes content = in.rest();
  const std::string path = folder.write("mesh." + extension, content);
  require(::ftruncate(fd, 0) == 0, "the result is emptied");
  {
    std::unique_ptr<Assimp::Importer> kept;
    require(import_mesh(&kept, path, {reinterpret_cast<const char*>(content.data()), content.size()},
                        std::uint64_t{1} << 28, fd),
            "the loader leaves a whole result");
  }
  Assimp::DefaultLogger::kill();
  try {
    const std::optional<Mesh> mesh = read_mesh_result(fd);
    require(mesh.has_value(), "a whole result is read");
    return true;
  } catch (const MeshError& error) {
    require(!std::string_view(error.what()).starts_with("the mesh loader's result is corrupted"),
            "a whole result makes sense");
    return false;
  }
}
