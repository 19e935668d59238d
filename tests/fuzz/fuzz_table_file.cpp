// Table files of any bytes beside a mesh: a table that is used leads to vertices that there are, in every direction.
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <vector>

#include "engine/shapes.h"
#include "engine/table_file.h"
#include "scratch_file.h"

namespace clearance::fuzz {
namespace {

constexpr std::uint64_t kKey = 0x1234;

bool is_usable(const std::string& path, std::span<const Vec3d> vertices) {
  const std::optional<DirectionTable> table = read_table_file(path, kKey, vertices);
  if (!table) return false;
  // Directions in every cell of a coarse map, its edges and its corners.
  for (int i = -8; i <= 8; ++i)
    for (int j = -8; j <= 8; ++j)
      for (const double z : {-1.0, 1.0, 0.0}) {
        const auto found = table->candidates({i / 8.0, j / 8.0, z});
        require(!found.empty() && found.size() <= vertices.size(), "a list has vertices");
        for (const std::uint32_t v : found) require(v < vertices.size(), "a list has vertices that there are");
      }
  return true;
}

}  // namespace
}  // namespace clearance::fuzz

/// First byte: 0 the rest is the file; else the rest are grid_bits 1 B, cells 2 B, and the words of a table, which is
/// written with the header and checksum that belong to it.
CLEARANCE_FUZZ_TARGET(table_file) {
  using namespace clearance;
  using namespace clearance::fuzz;
  static const ScratchFolder folder;
  static const std::vector<Vec3d> vertices = make_uv_sphere(1, 5).vertices;
  const std::string path = folder / "mesh.table";
  Input in(bytes);
  if (in.number<std::uint8_t>() == 0) {
    folder.write("mesh.table", in.rest());
    ::chmod(path.c_str(), 0644);
    return is_usable(path, vertices);
  }
  DirectionTable table;
  table.grid_bits = in.number<std::uint8_t>();
  const auto cells = in.number<std::uint16_t>();
  while (!in.empty()) (table.cells.size() < cells ? table.cells : table.lists).push_back(in.number<std::uint32_t>());
  ::unlink(path.c_str());
  write_table_file(path, kKey, vertices.size(), table);
  return is_usable(path, vertices);
}
