#include "engine/scene_io/geometry_yaml.h"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <optional>
#include <system_error>
#include <utility>

#include "engine/base/fp_environment.h"
#include "engine/geometry/geometry_file.h"
#include "engine/geometry/make_geometry.h"
#include "engine/scene/scene_robot.h"
#include "engine/scene_io/points_yaml.h"
#include "engine/scene_io/robot_yaml.h"

namespace clearance {

namespace fs = std::filesystem;

namespace {

// Limit on the vertices of all uv_spheres, whose parts take about 3 GB.
constexpr std::uint64_t kMaxMadeVertices = 20'000'000;

// A number in a key, with all of its bits and a separator.
std::string key_of(double x) {
  char text[40];
  std::snprintf(text, sizeof text, "%a,", x);
  return text;
}

std::string key_of(const Vec3d& v) {
  return key_of(v.x) + key_of(v.y) + key_of(v.z);
}

// [radius, length] of a capsule, cylinder or cone.
std::pair<double, double> read_round(const YamlValue& value, bool zero_length) {
  if (!value.is_list() || value.size() != 2) value.fail_expected("2 numbers [radius, length]");
  const std::vector<YamlValue> x = value.list("");
  return {x[0].positive(), zero_length ? x[1].not_negative() : x[1].positive()};
}

// The primitive of a kind, or none if the kind is another one.
std::optional<Primitive> read_primitive(const std::string& kind, const YamlValue& value) {
  if (kind == "cone" || kind == "cylinder") {
    const auto [r, length] = read_round(value, false);
    return kind == "cone" ? cone_of(r, length) : cylinder_of(r, length);
  }
  if (kind == "ellipsoid") {
    if (!value.is_list() || value.size() != 3) value.fail_expected("3 half axes [x, y, z]");
    const std::vector<YamlValue> x = value.list("");
    return Primitive{Primitive::Kind::kEllipsoid, {x[0].positive(), x[1].positive(), x[2].positive()}};
  }
  if (kind != "half_space") return {};
  if (!value.boolean()) value.fail_expected("true");
  return Primitive{Primitive::Kind::kHalfSpace, {0, 0, 0}};
}

// A shape and the numbers that identify it.
struct NumberedShape {
  std::string numbers;
  std::function<Shape()> make;
  std::uint64_t vertices = 0;  // of a uv_sphere
};

// The shape of a kind, or none if the kind is another one.
std::optional<NumberedShape> read_shape(const std::string& kind, const YamlValue& value) {
  if (kind == "box") {
    const Vec3d size = read_box(value);
    return NumberedShape{key_of(size), [size] { return make_box(size); }};
  }
  if (kind == "sphere") {
    const double r = value.positive();
    return NumberedShape{key_of(r), [r] { return make_sphere(r); }};
  }
  if (kind == "capsule") {
    const auto [r, length] = read_round(value, true);
    return NumberedShape{key_of(r) + key_of(length), [r = r, length = length] { return make_capsule(r, length); }};
  }
  if (kind != "uv_sphere") return {};
  value.map("{radius: ..., resolution: ...}");
  value.check_keys({"radius", "resolution"});
  const auto radius = value.find("radius"), resolution = value.find("resolution");
  if (!radius) value.fail("expected the key \"radius\"");
  if (!resolution) value.fail("expected the key \"resolution\"");
  const double r = radius->positive();
  const int n = static_cast<int>(resolution->integer(2, kMaxUvSphereResolution));
  return NumberedShape{key_of(r) + std::to_string(n), [r, n] { return make_uv_sphere(r, n); },
                       2 * std::uint64_t(n) * (n - 1) + 2};
}

// The one key of a body that names its geometry, and its value.
std::pair<std::string, YamlValue> find_geometry(const YamlValue& body) {
  constexpr const char* kKinds[] = {"mesh",     "box",          "sphere",     "capsule", "cylinder",
                                    "cone",     "ellipsoid",    "half_space", "points",  "uv_sphere",
                                    "geometry", "height_field", "octomap"};
  std::optional<std::pair<std::string, YamlValue>> found;
  for (const char* kind : kKinds)
    if (const auto here = body.find(kind)) {
      if (found) here->fail("a body has one geometry, and \"" + found->first + "\" is there already");
      found.emplace(kind, *here);
    }
  if (!found)
    body.fail(
        "expected one of the keys mesh, box, sphere, capsule, cylinder, cone, ellipsoid, half_space, points, "
        "uv_sphere, height_field, octomap");
  return *found;
}

// Fails for a key that belongs to another kind of geometry.
void check_extra_keys(const YamlValue& body, const std::string& kind, const YamlValue& value) {
  if (kind != "mesh")
    for (const char* key : {"scale", "mesh_as", "up"})
      if (const auto extra = body.find(key)) extra->fail("only a mesh has this key");
  if (const auto extra = body.find("voxel"); extra && (kind != "points" || !is_cloud_value(value)))
    extra->fail("only points of a file, or points: [], have this key");
  if (const auto extra = body.find("cell"); extra && kind != "height_field")
    extra->fail("only a height_field has this key");
  if (const auto extra = body.find("unknown"); extra && kind != "octomap") extra->fail("only an octomap has this key");
}

}  // namespace

Vec3d read_box(const YamlValue& value) {
  if (!value.is_list()) {
    if (!value.is_text()) value.fail_expected("an edge length, or 3 of them [x, y, z]");
    const double edge = value.positive();
    return {edge, edge, edge};
  }
  const std::vector<YamlValue> edges = value.list("");
  if (edges.size() != 3) value.fail_expected("an edge length, or 3 of them [x, y, z]");
  return {edges[0].positive(), edges[1].positive(), edges[2].positive()};
}

std::size_t GeometryReader::read(const YamlValue& body) {
  const auto [kind, value] = find_geometry(body);
  double radius = 0;
  if (const auto r = body.find("radius")) {
    if (kind == "geometry") r->fail("a geometry's pieces have their radius already");
    radius = r->not_negative();
  }
  check_extra_keys(body, kind, value);
  if (kind == "mesh") return read_mesh(body, value, radius);
  if (const auto shape = read_shape(kind, value)) {
    const std::size_t before = planned_.size();
    const std::size_t index =
        add(kind + " " + shape->numbers + " +" + key_of(radius), value,
            [make = shape->make, radius, kind = kind] { return geometry_of_shape(make(), radius, kind); });
    if (planned_.size() > before) made_vertices_ += shape->vertices;
    if (made_vertices_ > kMaxMadeVertices)
      value.fail("the uv_spheres of this scene have more than " + std::to_string(kMaxMadeVertices) + " vertices");
    return index;
  }
  if (const auto p = read_primitive(kind, value))
    return add(kind + " " + key_of(p->size) + " +" + key_of(radius), value,
               [p = *p, radius, kind = kind] { return geometry_of_primitive(p, radius, kind); });
  return read_file(kind, body, value, radius);
}

// Reads a geometry as large as its file, which no two bodies share by their numbers.
std::size_t GeometryReader::read_file(const std::string& kind, const YamlValue& body, const YamlValue& value,
                                      double radius) {
  if (kind == "geometry") {
    const std::string path = resolve(value, value.text("the path of a geometry file"));
    return add("geometry " + path, value, [path] { return read_geometry_file(path); });
  }
  const ResolvePath path_of = [this](const YamlValue& file) { return resolve(file, file.text("the path of a file")); };
  const auto make = [&]() -> MakeGeometry {
    if (kind == "octomap") return read_octomap(body, value, radius, path_of);
    if (kind == "height_field") return read_height_field(body, value, radius, path_of);
    if (is_cloud_value(value)) return read_cloud(body, value, radius, path_of);
    return [points = value.vectors(), radius] { return geometry_of_points(points, radius); };
  };
  return add(kind + " " + std::to_string(planned_.size()), value, make());
}

std::size_t GeometryReader::read_mesh(const YamlValue& body, const YamlValue& mesh, double radius) {
  const std::string named = mesh.text("the path of a mesh file");
  Vec3d scale{1, 1, 1};
  if (const auto s = body.find("scale")) {
    if (s->is_list()) {
      const std::vector<double> x = s->numbers(3, "a number, or 3 of them [sx, sy, sz]");
      scale = {x[0], x[1], x[2]};
    } else {
      const double x = s->number("a number, or 3 of them [sx, sy, sz]");
      scale = {x, x, x};
    }
    if (scale.x == 0 || scale.y == 0 || scale.z == 0) s->fail("expected factors other than 0");
  }
  const auto how = body.find("mesh_as");
  const MeshAs mesh_as = how ? read_mesh_as(*how) : MeshAs::kAuto;
  UpAxis up = UpAxis::kZ;
  if (const auto axis = body.find("up")) {
    const std::string letter = axis->text("y or z");
    if (letter != "y" && letter != "z") axis->fail_expected("y or z");
    if (letter == "y") up = UpAxis::kY;
  }
  const std::string path = resolve(mesh, named);
  std::shared_ptr<MeshFile>& file = mesh_files_[path];
  if (!file) file = std::make_shared<MeshFile>(path);
  const std::string key = "mesh " + path + " " + key_of(scale) + std::to_string(static_cast<int>(mesh_as)) +
                          std::to_string(static_cast<int>(up)) + " +" + key_of(radius);
  return add(key, mesh, [this, file = file, recipe = MeshRecipe{scale, mesh_as, radius, up}, named] {
    const auto in_file = [&](const std::exception& e) { return named + ": " + e.what(); };
    try {
      return meshes_.make(*file, recipe, named);
    } catch (const MeshError& e) {
      throw MeshError(in_file(e));
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(in_file(e));
    }
  });
}

std::string GeometryReader::resolve(const YamlValue& value, const std::string& named) const {
  if (named.empty() || named.find('\0') != std::string::npos) value.fail_expected("the path of a mesh file");
  const fs::path path = folder_ / named;  // an absolute path replaces the folder
  const auto outside = [&](const std::string& how) {
    value.fail("\"" + named + "\" " + how + "; " + kOutsideIsRejected);
  };
  if (!allow_outside_) {
    if (fs::path(named).is_absolute()) outside("is an absolute path, not one inside the scene's folder");
    const fs::path normal = fs::path(named).lexically_normal();
    if (*normal.begin() == "..") outside("leaves the scene's folder");
  }
  std::error_code error;
  const fs::path real = fs::canonical(path, error);
  if (error) value.fail("\"" + named + "\": " + error.message());
  if (!allow_outside_) {
    const fs::path home = fs::canonical(folder_, error);
    const auto [end, rest] = std::mismatch(home.begin(), home.end(), real.begin(), real.end());
    if (error || end != home.end()) outside("leaves the scene's folder through a symbolic link");
  }
  return fs::absolute(path).lexically_normal().string();  // keeps the given name, whose extension is the format
}

std::size_t GeometryReader::add(const std::string& key, const YamlValue& place, std::function<Geometry()> make) {
  const auto [at, is_new] = index_of_.try_emplace(key, planned_.size());
  if (is_new) planned_.push_back({place, std::move(make), nullptr, ""});
  return at->second;
}

void GeometryReader::build() {
  const int n = static_cast<int>(planned_.size());
  mesh_files_.clear();  // each geometry keeps the file that it needs
  // A single geometry is built outside of a parallel region, so that its own loops may use every core.
#pragma omp parallel for schedule(dynamic) if (n > 1)
  for (int i = 0; i < n; ++i) {
    Planned& one = planned_[i];
    const FpEnvironment environment;
    try {
      one.built = std::make_shared<const Geometry>(one.make());
    } catch (const std::exception& e) {
      one.error = e.what();
    }
    one.make = nullptr;  // releases the mesh
  }
  for (const Planned& one : planned_)
    if (!one.built) one.place.fail(one.error.empty() ? "cannot be built" : one.error);
}

}  // namespace clearance
