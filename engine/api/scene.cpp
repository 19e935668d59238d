#include "engine/api/conversions.h"
#include "engine/api/scene_impl.h"

namespace clearance {
namespace {

static_assert(sizeof(std::array<double, 3>) == sizeof(Vec3d) && sizeof(std::array<float, 3>) == sizeof(CloudPoint));

Vec3d vector_of(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}
std::span<const Vec3d> vectors_of(std::span<const std::array<double, 3>> rows) {
  return {reinterpret_cast<const Vec3d*>(rows.data()), rows.size()};
}

engine::Scene::BodyOptions options_of(const BodyOptions& options) {
  engine::Scene::BodyOptions ours{.radius = options.radius,
                                  .parent = options.parent,
                                  .is_static = options.is_static,
                                  .requires_pose = options.requires_pose,
                                  .uncertainty = {options.uncertainty_position, options.uncertainty_angle},
                                  .padding = options.padding,
                                  .max_speed = options.max_speed};
  if (options.X_parent_body) ours.pose = pose_of(*options.X_parent_body);
  return ours;
}

engine::RobotOptions options_of(const RobotOptions& options) {
  engine::RobotOptions ours{.urdf = options.urdf,
                            .srdf = options.srdf,
                            .packages = options.packages,
                            .parent = options.parent,
                            .base = pose_of(options.X_parent_base),
                            .is_static = options.is_static,
                            .visual = options.visual,
                            .mesh_as = options.mesh_as,
                            .link_mesh_as = options.link_mesh_as,
                            .home = options.home,
                            .home_state = options.home_state,
                            .padding = options.padding,
                            .link_padding = options.link_padding};
  for (const auto& [link, uncertainty] : options.link_uncertainty)
    ours.link_uncertainty[link] = {uncertainty.position, uncertainty.angle};
  return ours;
}

}  // namespace

Scene::Scene() : impl_(std::make_unique<Impl>()) {}
Scene::Scene(const Scene& other) : impl_(std::make_unique<Impl>(*other.impl_)) {}
Scene& Scene::operator=(const Scene& other) {
  *this = Scene(other);
  return *this;
}
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;
Scene::~Scene() = default;

Scene Scene::load(const std::string& path, bool allow_outside) {
  return translated([&] {
    Scene scene;
    scene.impl_->scene = engine::Scene::load(path, allow_outside);
    return scene;
  });
}
void Scene::save(const std::string& folder) const {
  translated([&] { impl_->scene.save(folder); });
}

std::uint32_t Scene::add_hull(const std::string& name, std::span<const std::array<double, 3>> vertices,
                              const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_hull(name, vectors_of(vertices), options_of(options)); });
}
std::uint32_t Scene::add_mesh(const std::string& name, const std::string& path, std::array<double, 3> scale,
                              MeshAs mesh_as, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_mesh(name, path, vector_of(scale), mesh_as, options_of(options)); });
}
std::uint32_t Scene::add_mesh(const std::string& name, std::span<const std::array<double, 3>> vertices,
                              std::span<const std::array<std::uint32_t, 3>> triangles, MeshAs mesh_as,
                              const BodyOptions& options) {
  return translated(
      [&] { return impl_->scene.add_mesh(name, vectors_of(vertices), triangles, mesh_as, options_of(options)); });
}
std::uint32_t Scene::add_points(const std::string& name, std::span<const std::array<float, 3>> points, double voxel,
                                const BodyOptions& options) {
  const std::span<const CloudPoint> cloud(reinterpret_cast<const CloudPoint*>(points.data()), points.size());
  return translated([&] { return impl_->scene.add_points(name, cloud, voxel, options_of(options)); });
}
std::uint32_t Scene::add_box(const std::string& name, std::array<double, 3> size, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_box(name, vector_of(size), options_of(options)); });
}
std::uint32_t Scene::add_sphere(const std::string& name, double radius, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_sphere(name, radius, options_of(options)); });
}
std::uint32_t Scene::add_capsule(const std::string& name, double radius, double length, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_capsule(name, radius, length, options_of(options)); });
}
std::uint32_t Scene::add_cylinder(const std::string& name, double radius, double length, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_cylinder(name, radius, length, options_of(options)); });
}
std::uint32_t Scene::add_cone(const std::string& name, double radius, double length, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_cone(name, radius, length, options_of(options)); });
}
std::uint32_t Scene::add_ellipsoid(const std::string& name, std::array<double, 3> radii, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_ellipsoid(name, vector_of(radii), options_of(options)); });
}
std::uint32_t Scene::add_half_space(const std::string& name, const BodyOptions& options) {
  return translated([&] { return impl_->scene.add_half_space(name, options_of(options)); });
}
void Scene::add_robot(const std::string& name, const RobotOptions& options) {
  translated([&] { impl_->scene.add_robot(name, options_of(options)); });
}
void Scene::add_group(const std::string& name, std::span<const std::string> bodies) {
  translated([&] { impl_->scene.add_group(name, bodies); });
}
void Scene::ignore(const std::string& a, const std::string& b) {
  translated([&] { impl_->scene.ignore(a, b); });
}

std::vector<BodyInfo> Scene::bodies() const {
  return bodies_of(impl_->scene);
}
std::vector<GroupInfo> Scene::groups() const {
  return groups_of(impl_->scene);
}
std::uint64_t Scene::revision() const {
  return impl_->scene.revision();
}
std::vector<std::string> Scene::warnings() const {
  return impl_->scene.warnings();
}

}  // namespace clearance
