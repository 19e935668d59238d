// Arbitrary points: files through their readers, and parts of clouds over LCM through the check and the assembler. The
// results are finite, or one whole frame that the daemon's parser accepts.
#include <cmath>
#include <string>
#include <vector>

#include "engine/mesh/mesh_part.h"
#include "engine/mesh/mesh_text.h"
#include "server/lcm/lcm_points.h"
#include "tests/fuzz/fuzz_target.h"
#include "wire/lcm/lcm_check.h"
#include "wire/wire.h"

namespace clearance::fuzz {
namespace {

bool read(void (*reader)(std::string_view, const PartSink&), Bytes bytes) {
  int parts = 0;
  try {
    reader({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, [&](const MeshPart& part) {
      ++parts;
      require(part.triangles.empty() && !part.positions.empty(), "points, and at least one");
      for (const Vec3d& p : part.positions)
        require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z), "points are finite");
    });
  } catch (const LoadError& error) {
    const std::size_t length = std::string(error.what()).size();
    require(length > 0 && length < 500, "a complaint about a file does not quote all of it");
    return false;
  }
  return parts > 0;
}

/// Repeated [milliseconds 1 B | size 2 B | a packet].
bool assemble(Input& in) {
  LcmPoints points;
  LcmPoints::Clock::time_point now{};
  bool accepted = !in.empty();
  while (!in.empty()) {
    now += std::chrono::milliseconds(in.number<std::uint8_t>());
    const Bytes packet = in.take(in.number<std::uint16_t>());
    clearance_lcm::points_t part;
    if (!decode_checked(packet, part).empty()) {
      accepted = false;
      continue;
    }
    const std::optional<FrameBytes> frame = points.add(part, 7, now);
    accepted = frame.has_value();  // of the last packet
    if (!frame) continue;
    wire::FrameHeader header;
    const auto payload = wire::split_frame(frame->span(), header);
    const wire::PointsParts parts = wire::parse_points(payload);
    require(parts.header.body == 7 && parts.header.count == static_cast<std::uint64_t>(part.total) &&
                parts.header.count <= LcmPoints::kMostPoints,
            "a cloud is whole");
  }
  return accepted;
}

}  // namespace
}  // namespace clearance::fuzz

/// [kind 1 B | a file, or packets]
CLEARANCE_FUZZ_TARGET(points) {
  using namespace clearance;
  using namespace clearance::fuzz;
  Input in(bytes);
  switch (in.number<std::uint8_t>() % 5) {
    case 0:
      return read(read_xyz, in.rest());
    case 1: {
      const Bytes file = in.rest();
      const bool has_heights = read(read_npy_heights, file);
      return read(read_npy, file) || has_heights;
    }
    case 2:
      return read(read_pcd, in.rest());
    case 4:
      return read(read_octomap, in.rest());
    default:
      return assemble(in);
  }
}
