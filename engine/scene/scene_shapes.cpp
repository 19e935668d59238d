// The functions of Scene that add bodies of one geometry.
#include <sys/stat.h>

#include <algorithm>

#include "engine/base/fp_environment.h"
#include "engine/bvh/surface.h"
#include "engine/geometry/cloud_geometry.h"
#include "engine/geometry/make_geometry.h"
#include "engine/geometry/mesh_geometry.h"
#include "engine/scene/body_checks.h"
#include "engine/scene/scene.h"

namespace clearance::engine {

namespace {

constexpr std::size_t kRememberedVertices = 5'000;  // of shapes whose geometry is kept

// Key of a file, which changes when the file is replaced or rewritten.
std::string file_key(const std::string& path) {
  struct stat info{};
  if (::stat(path.c_str(), &info) != 0) return path + "|";
  return std::to_string(info.st_dev) + ':' + std::to_string(info.st_ino) + ':' + std::to_string(info.st_size) + ':' +
         std::to_string(info.st_mtim.tv_sec) + '.' + std::to_string(info.st_mtim.tv_nsec) + '|' + path + '|';
}

// Replaces the points of a body, not yet grown by its uncertainty.
void put_points(Body& body, const ConvexPartPtr& cloud) {
  body.parts = {cloud ? cloud : part_of_no_points()};
  body.cloud = cloud ? CloudState::kPoints : CloudState::kEmpty;
  body.model_error = body.model_inner = cloud ? cloud->surface->rounding() : 0;
  body.reach = 0;
  body.is_grown = false;
}

// Makes the geometry of a primitive.
auto primitive(const Primitive& shape, const char* source, const Scene::BodyOptions& options) {
  return [=, radius = options.radius] { return geometry_of_primitive(shape, radius, source); };
}

}  // namespace

Body Scene::body_from(const std::string& name, const BodyOptions& options) const {
  Body body;
  body.name = name;
  body.is_static = options.is_static;
  body.pose = options.pose;
  body.requires_pose = options.requires_pose;
  body.uncertainty = options.uncertainty;
  body.padding = options.padding;
  body.max_speed = options.max_speed;
  check_positive(name, "radius", options.radius, true);
  if (!options.parent.empty()) {
    body.parent = find_body(options.parent);
    if (body.parent == kNone)
      throw SceneError("body " + in_quotes(name) + ": parent: " + no_body(*this, options.parent));
  }
  return body;
}

template <class F>
std::uint32_t Scene::add_geometry(const std::string& name, const BodyOptions& options, F&& geometry_of) {
  check_free(name, "body");
  Body body = body_from(name, options);
  try {
    static_cast<Geometry&>(body) = geometry_of();
    for (ConvexPartPtr& part : body.parts) part = shared_part(part);
  } catch (const std::invalid_argument& e) {
    throw SceneError("body " + in_quotes(name) + ": " + e.what());
  } catch (const MeshError& e) {
    throw SceneError("body " + in_quotes(name) + ": " + e.what());
  }
  return add_body(std::move(body));
}

std::uint32_t Scene::add_hull(const std::string& name, std::span<const Vec3d> vertices, const BodyOptions& options) {
  const FpEnvironment environment;
  return add_geometry(name, options, [&] { return geometry_of_points(vertices, options.radius); });
}

std::uint32_t Scene::add_shape(const std::string& name, const Shape& shape, const char* source,
                               const BodyOptions& options) {
  return add_geometry(name, options, [&] {
    if (shape.vertices.size() > kRememberedVertices) return geometry_of_shape(shape, options.radius, source);
    std::string key = std::string(source) + '\0';
    const auto append = [&key](const auto* data, std::size_t count) {
      key.append(reinterpret_cast<const char*>(data), count * sizeof *data);
    };
    append(&shape.radius, 1);
    append(&options.radius, 1);
    append(shape.vertices.data(), shape.vertices.size());
    std::shared_ptr<const Geometry>& known = geometries_[key];
    if (!known) known = std::make_shared<const Geometry>(geometry_of_shape(shape, options.radius, source));
    return *known;
  });
}

std::uint32_t Scene::add_mesh(const std::string& name, const std::string& path, Vec3d scale, MeshAs mesh_as,
                              const BodyOptions& options, UpAxis up) {
  const FpEnvironment environment;
  return add_geometry(name, options, [&] { return mesh_geometry(path, {scale, mesh_as, options.radius, up}); });
}

std::uint32_t Scene::add_mesh(const std::string& name, std::span<const Vec3d> vertices,
                              std::span<const Triangle> triangles, MeshAs mesh_as, const BodyOptions& options) {
  const FpEnvironment environment;
  return add_geometry(name, options,
                      [&] { return geometry_of_triangles(vertices, triangles, mesh_as, options.radius); });
}

// Geometry of a file, kept for the next body of the same file and recipe. Throws MeshError.
const Geometry& Scene::mesh_geometry(const std::string& path, const MeshRecipe& recipe) {
  const auto& [scale, mesh_as, radius, up] = recipe;
  const std::string key = file_key(path) + number_text(scale.x) + ',' + number_text(scale.y) + ',' +
                          number_text(scale.z) + ',' + std::to_string(static_cast<int>(mesh_as)) + ',' +
                          number_text(radius) + ',' + std::to_string(static_cast<int>(up));
  std::shared_ptr<const Geometry>& known = geometries_[key];
  if (known) return *known;
  try {
    if (!meshes_) meshes_ = std::make_shared<MeshGeometries>();
    MeshFile file(path);
    known = std::make_shared<const Geometry>(meshes_->make(file, recipe, path));
    return *known;
  } catch (const std::exception& e) {
    geometries_.erase(key);
    throw MeshError(path + ": " + e.what());
  }
}

std::uint32_t Scene::add_uv_sphere(const std::string& name, double radius, int resolution, const BodyOptions& options) {
  const FpEnvironment environment;
  check_positive(name, "uv_sphere radius", radius);
  if (resolution < 2 || resolution > kMaxUvSphereResolution)
    throw SceneError("body " + in_quotes(name) + ": uv_sphere resolution: expected an integer from 2 to " +
                     std::to_string(kMaxUvSphereResolution) + ", got " + std::to_string(resolution));
  return add_shape(name, make_uv_sphere(radius, resolution), "uv_sphere", options);
}

std::uint32_t Scene::add_box(const std::string& name, Vec3d size, const BodyOptions& options) {
  const FpEnvironment environment;
  for (int k = 0; k < 3; ++k) check_positive(name, "box edge", size[k]);
  return add_shape(name, make_box(size), "box", options);
}

std::uint32_t Scene::add_sphere(const std::string& name, double radius, const BodyOptions& options) {
  const FpEnvironment environment;
  check_positive(name, "sphere radius", radius);
  return add_shape(name, make_sphere(radius), "sphere", options);
}

std::uint32_t Scene::add_capsule(const std::string& name, double radius, double length, const BodyOptions& options) {
  const FpEnvironment environment;
  check_positive(name, "capsule radius", radius);
  check_positive(name, "capsule length", length, true);
  return add_shape(name, make_capsule(radius, length), "capsule", options);
}

std::uint32_t Scene::add_cylinder(const std::string& name, double radius, double length, const BodyOptions& options) {
  const FpEnvironment environment;
  check_positive(name, "cylinder radius", radius);
  check_positive(name, "cylinder length", length);
  return add_geometry(name, options, primitive(cylinder_of(radius, length), "cylinder", options));
}

std::uint32_t Scene::add_cone(const std::string& name, double radius, double length, const BodyOptions& options) {
  const FpEnvironment environment;
  check_positive(name, "cone radius", radius);
  check_positive(name, "cone length", length);
  return add_geometry(name, options, primitive(cone_of(radius, length), "cone", options));
}

std::uint32_t Scene::add_ellipsoid(const std::string& name, Vec3d radii, const BodyOptions& options) {
  const FpEnvironment environment;
  for (int k = 0; k < 3; ++k) check_positive(name, "ellipsoid half axis", radii[k]);
  return add_geometry(name, options, primitive({Primitive::Kind::kEllipsoid, radii}, "ellipsoid", options));
}

std::uint32_t Scene::add_half_space(const std::string& name, const BodyOptions& options) {
  const FpEnvironment environment;
  return add_geometry(name, options, primitive({Primitive::Kind::kHalfSpace, {0, 0, 0}}, "half_space", options));
}

std::uint32_t Scene::add_points(const std::string& name, std::span<const CloudPoint> points, double voxel,
                                const BodyOptions& options) {
  const FpEnvironment environment;
  check_free(name, "body");
  Body body = body_from(name, options);
  const std::string who = "body " + in_quotes(name) + ": ";
  body.cloud_radius = options.radius;
  body.source = voxel > 0 ? "voxels" : "cloud";
  try {
    body.voxel = voxel_of(voxel);
    put_points(body, points.empty() ? nullptr : make_cloud_part(points, body.voxel, options.radius));
  } catch (const std::invalid_argument& e) {
    throw SceneError(who + e.what());
  }
  if (points.empty() && options.requires_pose) body.cloud = CloudState::kAwaited;
  return add_body(std::move(body));
}

Scene Scene::with_points(std::uint32_t id, const ConvexPartPtr& cloud) const {
  const FpEnvironment environment;
  Scene next = without_memory();
  put_points(next.bodies_.at(id), cloud);
  next.grow(next.bodies_[id], false);
  next.has_uncertainties_ = std::ranges::any_of(next.bodies_, has_uncertainty);
  return next;
}

}  // namespace clearance::engine
