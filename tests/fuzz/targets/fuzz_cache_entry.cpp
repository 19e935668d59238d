// Arbitrary entries in the cache, and arbitrary records in intact entries: a read returns the written record, valid
// geometry, or nothing.
#include <sys/stat.h>

#include <algorithm>
#include <cmath>

#include "engine/bvh/surface.h"
#include "engine/geometry/mesh_geometry.h"
#include "engine/hull/direction_table.h"
#include "tests/fuzz/scratch_file.h"

namespace clearance::fuzz {
namespace {

void check_table(const DirectionTable& table, std::size_t vertices) {
  // Directions in every cell of a coarse map, and on its edges and corners.
  for (int i = -8; i <= 8; ++i)
    for (int j = -8; j <= 8; ++j)
      for (const double z : {-1.0, 1.0, 0.0}) {
        const auto found = table.candidates({i / 8.0, j / 8.0, z});
        require(!found.empty(), "a list has vertices");
        for (const std::uint32_t v : found) require(v < vertices, "a list has vertices that there are");
      }
}

void check_surface(const Surface& surface) {
  require(!surface.triangles().empty(), "a surface has triangles");
  for (const Triangle& t : surface.triangles())
    require(std::max({t[0], t[1], t[2]}) < surface.vertices().size(), "they are of vertices that there are");
  for (const Vec3d& v : surface.vertices())
    require(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z), "its vertices are finite");
  require(!surface.is_solid() || open_edge(surface.vertices(), surface.triangles()).empty(), "a solid is closed");
}

bool is_usable(const std::optional<Geometry>& geometry) {
  if (!geometry) return false;
  require(!geometry->parts.empty() && geometry->model_error >= 0, "a body has pieces and an error");
  for (const ConvexPartPtr& part : geometry->parts) {
    require(!part->vertices.empty() && part->radius >= 0, "a piece has vertices and a radius");
    for (const Vec3d& v : part->vertices)
      require(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z), "vertices are finite");
    if (part->surface) check_surface(*part->surface);
    if (part->table) check_table(*part->table, part->vertices.size());
  }
  if (geometry->display)
    for (const Triangle& t : geometry->display->triangles)
      require(std::max({t[0], t[1], t[2]}) < geometry->display->vertices.size(),
              "triangles are of vertices that there are");
  return true;
}

}  // namespace
}  // namespace clearance::fuzz

/// First byte: if 0, the rest is the entry's file; otherwise the rest is a record that is stored first.
CLEARANCE_FUZZ_TARGET(cache_entry) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static const ScratchFolder folder;
  static const Cache cache(folder / "cache");
  static const std::string name = CacheKey("mesh", "1").name();
  require(cache.is_on(), "there is a cache");
  Input in(bytes);
  const bool raw = in.number<std::uint8_t>() == 0;
  const Bytes rest = in.rest();
  if (raw) {
    ::chmod(folder.write("cache/" + name, rest).c_str(), 0600);
    require(!cache.read(name), "nobody guesses a digest");
    return false;
  }
  cache.write(name, rest);
  const auto record = cache.read(name);
  require(record && std::ranges::equal(*record, rest), "what is kept comes back");
  return is_usable(geometry_of_record(*record));
}
