// Convex parts that replace a solid: read from a record of the cache, which may be invalid; read from another record,
// whose claimed deviation is ignored; and proved for parts of any shape.
#include <algorithm>
#include <cmath>

#include "engine/decomposition/measure.h"
#include "engine/decomposition/prove.h"
#include "engine/geometry/mesh_geometry.h"
#include "tests/fuzz/fuzz_target.h"

namespace clearance::fuzz {
namespace {

using Proposal = std::vector<std::vector<Vec3d>>;

bool is_finite(const Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
bool is_length(double x) {
  return x >= 0 && std::isfinite(x);
}

void check_decomposition(const Decomposition& of) {
  require(!of.parts.empty() && of.parts.size() == of.outer.size(), "each piece has an outer bound");
  require(is_length(of.inner) && std::ranges::all_of(of.outer, is_length), "bounds are lengths");
  for (const ConvexPartPtr& part : of.parts)
    require(part && !part->vertices.empty() && part->radius == 0 && std::ranges::all_of(part->vertices, is_finite),
            "pieces are cores of finite vertices");
}

/// A cube from -1 to 1.
struct Cube {
  std::vector<Vec3d> vertices;
  std::vector<Triangle> triangles{{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                  {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  Cube() {
    for (int i = 0; i < 8; ++i) vertices.push_back({2.0 * (i & 1) - 1, 2.0 * (i >> 1 & 1) - 1, 2.0 * (i >> 2) - 1});
  }
};

std::vector<std::byte> record_of(std::shared_ptr<const Decomposition> parts, Tables tables) {
  const Cube cube;
  Geometry geometry;
  geometry.parts = {make_surface_part(cube.vertices, cube.triangles, true, 0, 0, std::move(parts))};
  return geometry_record(geometry, tables);
}

const Decomposition* read_back(const std::optional<Geometry>& geometry) {
  if (!geometry || geometry->parts.size() != 1 || !geometry->parts[0]->surface) return nullptr;
  return geometry->parts[0]->surface->decomposition();
}

/// Reads arbitrary bytes as a record of the cache.
bool reads(Bytes record) {
  const std::optional<Geometry> geometry = geometry_of_record(record);
  if (!geometry) return false;
  bool any = false;
  for (const ConvexPartPtr& part : geometry->parts) {
    if (!part->surface) continue;
    const Surface& surface = *part->surface;
    require(!surface.is_solid() || open_edge(surface.vertices(), surface.triangles()).empty(), "a solid is closed");
    if (!surface.decomposition()) continue;
    check_decomposition(*surface.decomposition());
    any = true;
  }
  return any;
}

/// Half of a cube for the whole, with arbitrary lengths: the cache's are kept if they are valid lengths, others are
/// proved again.
bool is_proved_anew(Input in) {
  auto claimed = std::make_shared<Decomposition>();
  std::vector<Vec3d> half;
  for (const Vec3d& v : Cube().vertices) half.push_back({std::min(v.x, 0.0), v.y, v.z});
  claimed->parts = {make_convex_part(half)};
  claimed->inner = in.number<double>();
  claimed->outer = {in.number<double>()};
  const bool are_lengths = is_length(claimed->inner) && is_length(claimed->outer[0]);
  const auto kept = geometry_of_record(record_of(claimed, Tables::kKept), Tables::kKept);
  const Decomposition* const of_cache = read_back(kept);
  require(are_lengths || !of_cache, "what is no length is refused");
  if (of_cache) {
    check_decomposition(*of_cache);
    require(of_cache->inner == claimed->inner && of_cache->outer == claimed->outer, "what is kept comes back");
  }
  const auto anew = geometry_of_record(record_of(claimed, Tables::kMadeAnew), Tables::kMadeAnew);
  const Decomposition* const of_file = read_back(anew);
  require(of_file, "pieces are proved whatever is said of them");
  check_decomposition(*of_file);
  require(of_file->inner >= 1 && of_file->inner < 1.25 && of_file->outer[0] < 0.125, "by what they are");
  return of_cache != nullptr;
}

/// Parts with arbitrary corners for a cube.
bool is_proved(Input in) {
  const Cube cube;
  const Surface exact_value(cube.vertices, cube.triangles, true);
  Proposal proposal(in.number<std::uint8_t>() % 5);
  for (std::vector<Vec3d>& part : proposal) {
    const int corners = in.number<std::uint8_t>() % 10;
    const double scale = std::ldexp(1.0, in.number<std::int8_t>() / 2);
    for (int i = 0; i < corners; ++i) {
      Vec3d v;
      for (int k = 0; k < 3; ++k) v[k] = scale * in.number<std::int8_t>();
      part.push_back(v);
    }
  }
  Decomposition proved;
  try {
    ProofEffort little;
    little.inner_distances = 400;
    little.outer_distances = 200;
    proved = prove_decomposition(exact_value, proposal, little).decomposition;
  } catch (const std::invalid_argument& e) {
    require(*e.what() != 0, "an error says what it is");
    return false;
  }
  check_decomposition(proved);
  require(proved.parts.size() == proposal.size(), "none is left out");
  Measure measure(0);
  for (const Vec3d& v : cube.vertices) {
    double nearest = HUGE_VAL;
    for (const ConvexPartPtr& part : proved.parts) nearest = std::min(nearest, measure.to(*part, v).lower);
    require(nearest <= proved.inner, "no corner of the mesh is farther from the pieces than the inner bound");
  }
  for (std::size_t i = 0; i < proposal.size(); ++i)
    for (const Vec3d& v : proposal[i]) {
      Vec3d out;
      for (int k = 0; k < 3; ++k) out[k] = std::max(std::abs(v[k]) - 1, 0.0);
      require(norm(out) * (1 - 0x1p-40) <= proved.outer[i],
              "no corner of a piece is farther from it than the outer one");
    }
  return true;
}

}  // namespace
}  // namespace clearance::fuzz

/// First byte, modulo 3: for 0 the rest is a record, for 1 two claimed lengths, for 2 corners of parts.
CLEARANCE_FUZZ_TARGET(decomposition) {
  using namespace clearance::fuzz;
  Input in(bytes);
  switch (in.number<std::uint8_t>() % 3) {
    case 0:
      return reads(in.rest());
    case 1:
      return is_proved_anew(in);
    default:
      return is_proved(in);
  }
}
