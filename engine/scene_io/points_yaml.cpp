#include "engine/scene_io/points_yaml.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>

#include "engine/bvh/surface.h"
#include "engine/geometry/cloud_geometry.h"
#include "engine/geometry/make_geometry.h"
#include "engine/mesh/mesh.h"

namespace clearance {

namespace {

// Products with a power of two are exact.
bool is_a_power_of_two(double x) {
  int exponent = 0;
  return std::frexp(x, &exponent) == 0.5;
}

// Calls a function that reads a file, and adds its name to errors.
template <class F>
auto in_file(const std::string& named, F&& f) {
  try {
    return f();
  } catch (const MeshError& e) {
    throw MeshError(named + ": " + e.what());
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument(named + ": " + e.what());
  }
}

// Boxes around float32 centres for the voxels of a map. Their deviation from the voxels counts as slack.
Geometry voxels_of(const Octomap& map, double radius, const std::string& named) {
  constexpr double kUp = 1 + 0x1p-40;
  const float edge = voxel_of(map.edge);
  double off = 0;  // of a centre's coordinate
  std::vector<CloudPoint> rounded;
  for (const Vec3d& c : map.centres) {
    CloudPoint& p = rounded.emplace_back();
    for (int k = 0; k < 3; ++k) {
      const float x = p[static_cast<std::size_t>(k)] = static_cast<float>(c[k]);
      off = std::max(off, std::abs(double{x} - c[k]) + (is_a_power_of_two(map.edge) ? 0 : 0x1p-53 * std::abs(c[k])));
    }
  }
  Geometry cloud;
  if (rounded.empty()) {
    cloud.parts = {part_of_no_points()};
    cloud.cloud = CloudState::kEmpty;
    cloud.cloud_radius = radius;
    cloud.voxel = edge;
    cloud.source = named + " (octomap)";
    return cloud;
  }
  cloud.parts = {make_cloud_part(rounded, edge, radius)};
  const double of_corner = std::sqrt(3.0) * (off + 0.5 * (double{edge} - map.edge)) * kUp;
  cloud.model_error = cloud.model_inner = (cloud.parts[0]->surface->rounding() + of_corner) * kUp;
  cloud.source = named + " (octomap)";
  return cloud;
}

// A mesh of a grid's samples, with two triangles in each cell whose corners all exist.
Geometry height_field(const std::vector<Vec3d>& samples, double cell, double radius, const std::string& named) {
  std::unordered_map<std::uint64_t, std::uint32_t> at;  // by row and column
  const auto place = [](double row, double column) {
    return static_cast<std::uint64_t>(row) << 32 | static_cast<std::uint64_t>(column);
  };
  std::vector<Vec3d> vertices;
  double far = 0;
  for (const Vec3d& s : samples) {
    if (!(s.x >= 0 && s.x < 0x1p32 && s.y >= 0 && s.y < 0x1p32) || s.x != std::floor(s.x) || s.y != std::floor(s.y))
      throw std::invalid_argument("expected an array of heights");
    at[place(s.y, s.x)] = static_cast<std::uint32_t>(vertices.size());
    vertices.push_back({cell * s.x, cell * s.y, s.z});
    far = std::max({far, cell * s.x, cell * s.y});
  }
  std::vector<Triangle> triangles;
  for (const Vec3d& s : samples) {
    const auto a = at.find(place(s.y, s.x)), b = at.find(place(s.y, s.x + 1)), c = at.find(place(s.y + 1, s.x)),
               d = at.find(place(s.y + 1, s.x + 1));
    if (b == at.end() || c == at.end() || d == at.end()) continue;
    triangles.push_back({a->second, b->second, d->second});
    triangles.push_back({a->second, d->second, c->second});
  }
  if (triangles.empty()) throw std::invalid_argument("no four neighbouring samples are numbers");
  Geometry geometry = geometry_of_triangles(vertices, triangles, MeshAs::kSurface, radius);
  if (!is_a_power_of_two(cell)) geometry.model_error = geometry.model_inner = 0x1p-52 * far;
  geometry.source = named + " (height field)";
  return geometry;
}

}  // namespace

namespace {

float read_voxel(const YamlValue& body) {
  const auto edge = body.find("voxel");
  if (!edge) return 0;
  try {
    return voxel_of(edge->positive());
  } catch (const std::invalid_argument& e) {
    edge->fail(e.what());
  }
}

}  // namespace

bool is_cloud_value(const YamlValue& points) {
  return points.is_text() || (points.is_list() && points.size() == 0);
}

MakeGeometry read_cloud(const YamlValue& body, const YamlValue& points, double radius, const ResolvePath& resolve) {
  const float voxel = read_voxel(body);
  if (!points.is_text()) {
    const auto requires_pose = body.find("requires_pose");
    Geometry empty;
    empty.parts = {part_of_no_points()};
    empty.source = voxel > 0 ? "voxels" : "cloud";
    empty.cloud = requires_pose && requires_pose->boolean() ? CloudState::kAwaited : CloudState::kEmpty;
    empty.cloud_radius = radius;
    empty.voxel = voxel;
    return [empty] { return empty; };
  }
  const std::string named = points.text("the path of a file of points"), path = resolve(points);
  return [=] {
    return in_file(named, [&] {
      std::vector<CloudPoint> rounded;
      for (const Vec3d& p : load_points(path))
        rounded.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z)});
      Geometry cloud;
      cloud.parts = {make_cloud_part(rounded, voxel, radius)};
      cloud.model_error = cloud.model_inner = cloud.parts[0]->surface->rounding();
      cloud.source = named + (voxel > 0 ? " (voxels)" : " (cloud)");
      return cloud;
    });
  };
}

MakeGeometry read_octomap(const YamlValue& body, const YamlValue& file, double radius, const ResolvePath& resolve) {
  const auto unknown = body.find("unknown");
  if (!unknown) body.fail("an octomap needs the key \"unknown\": how unknown space is treated; expected free");
  if (const std::string word = unknown->text("free"); word != "free")
    unknown->fail(word == "occupied" ? "not yet: unknown: occupied; expected free" : "expected free");
  const std::string named = file.text("the path of an octomap"), path = resolve(file);
  return [=] { return in_file(named, [&] { return voxels_of(load_octomap(path), radius, named); }); };
}

MakeGeometry read_height_field(const YamlValue& body, const YamlValue& file, double radius,
                               const ResolvePath& resolve) {
  const auto cell = body.find("cell");
  if (!cell) body.fail("a height_field needs the key \"cell\": metres between its samples");
  const double metres = cell->positive();
  const std::string named = file.text("the path of an NPY file of heights"), path = resolve(file);
  return [=] { return in_file(named, [&] { return height_field(load_heights(path), metres, radius, named); }); };
}

}  // namespace clearance
