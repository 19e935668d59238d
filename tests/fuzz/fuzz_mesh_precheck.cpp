// Mesh files of any bytes, as the loader looks at them before assimp does.
#include "engine/mesh_precheck.h"
#include "fuzz_target.h"
#include "mesh_extension.h"

CLEARANCE_FUZZ_TARGET(mesh_precheck) {
  using namespace clearance::fuzz;
  Input in(bytes);
  const char* extension = next_mesh_extension(in);
  const Bytes content = in.rest();
  const std::string wrong =
      clearance::mesh_precheck(extension, {reinterpret_cast<const char*>(content.data()), content.size()});
  require(wrong.size() < 500, "a complaint about a file does not quote all of it");
  return wrong.empty();
}
