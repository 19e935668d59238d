// Arbitrary results of a compromised mesh loader: the reader returns a valid mesh or an error.
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "engine/mesh/mesh_format.h"
#include "engine/mesh/mesh_result.h"
#include "tests/fuzz/fuzz_target.h"

/// First byte: whether the header's magic and length are corrected.
CLEARANCE_FUZZ_TARGET(mesh_result) {
  using namespace clearance;
  using namespace clearance::fuzz;
  Input in(bytes);
  const bool mend = in.number<std::uint8_t>() & 1;
  const Bytes content = in.rest();
  static const int fd = ::memfd_create("clearance-fuzz", MFD_CLOEXEC);
  require(::ftruncate(fd, 0) == 0 &&
              ::pwrite(fd, content.data(), content.size(), 0) == static_cast<ssize_t>(content.size()),
          "the result is written");
  MeshHeader header{};
  if (mend && content.size() >= sizeof header) {
    std::memcpy(&header, content.data(), sizeof header);
    header.magic = kMeshMagic;
    header.total_bytes = content.size();
    require(::pwrite(fd, &header, sizeof header, 0) == sizeof header, "the header is written");
  }
  try {
    const std::optional<Mesh> mesh = read_mesh_result(fd);
    if (!mesh) return false;
    require(!mesh->submeshes.empty(), "a mesh has a part");
    for (const Submesh& part : mesh->submeshes) {
      require(!part.vertices.empty(), "a part has a vertex");
      for (const Vec3d& v : part.vertices)
        require(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z), "vertices are finite");
      for (const Triangle& t : part.triangles)
        require(std::max({t[0], t[1], t[2]}) < part.vertices.size(), "triangles are of vertices that there are");
    }
    return true;
  } catch (const MeshError& error) {
    for (const char* c = error.what(); *c; ++c)
      require(*c >= 0x20 && *c < 0x7f, "an error that goes into the log is plain text");
    return false;
  }
}
