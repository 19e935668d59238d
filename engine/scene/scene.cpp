#include "engine/scene/scene.h"

#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "engine/base/digest.h"
#include "engine/base/fp_environment.h"
#include "engine/bvh/surface.h"
#include "engine/hull/primitive.h"
#include "engine/hull/shapes.h"
#include "engine/mesh/mesh.h"
#include "engine/scene/geometry.h"
#include "engine/scene/mesh_geometry.h"

namespace clearance {

namespace {

// Pairs that ignore() may name in all: more is a mistake in the scene file, not a wish.
constexpr std::size_t kMaxIgnoredPairs = std::size_t{1} << 27;

std::string in_quotes(const std::string& name) {
  return '"' + name + '"';
}

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", x);
  char shorter[32];
  std::snprintf(shorter, sizeof shorter, "%g", x);
  return std::strtod(shorter, nullptr) == x ? shorter : text;
}

// The length of the UTF-8 character at text[i], or 0 if there is none that may stand in a name.
std::size_t printable_character(const std::string& text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return k < text.size() ? static_cast<unsigned char>(text[k]) : 0u; };
  const unsigned c = byte(i);
  if (c < 0x80) return c >= 0x20 && c != 0x7f ? 1 : 0;
  const std::size_t length = c >= 0xf0 ? 4 : c >= 0xe0 ? 3 : 2;
  if (c < 0xc2 || c > 0xf4) return 0;
  std::uint32_t code = c & (0xffu >> (length + 1));
  for (std::size_t k = 1; k < length; ++k) {
    if ((byte(i + k) & 0xc0) != 0x80) return 0;
    code = code << 6 | (byte(i + k) & 0x3f);
  }
  constexpr std::uint32_t kSmallest[] = {0, 0, 0x80, 0x800, 0x10000};
  const bool surrogate = code >= 0xd800 && code < 0xe000;
  return code >= kSmallest[length] && code <= 0x10ffff && !surrogate && code >= 0xa0 ? length : 0;
}

void check_name(const std::string& name, const char* what) {
  const std::string subject = std::string(what) + " name";
  if (name.empty()) throw SceneError(subject + " is empty");
  if (name.size() > static_cast<std::size_t>(kMaxNameBytes))
    throw SceneError(subject + " has " + std::to_string(name.size()) + " bytes, expected at most " +
                     std::to_string(kMaxNameBytes) + ": " + in_quotes(name.substr(0, 40)) + "...");
  if (name == "*") throw SceneError(subject + " \"*\" is taken: it stands for every body");
  for (std::size_t i = 0; i < name.size();) {
    const std::size_t length = printable_character(name, i);
    if (length == 0)
      throw SceneError(subject + " holds an unprintable character or bad UTF-8 at byte " + std::to_string(i));
    i += length;
  }
}

void check_positive(const std::string& name, const char* what, double x, bool zero_allowed = false) {
  if ((x > 0 || (zero_allowed && x == 0)) && x <= kMaxCoordinate) return;
  throw SceneError("body " + in_quotes(name) + ": " + what + ": expected a number of metres " +
                   (zero_allowed ? ">= 0" : "> 0") + ", got " + number(x));
}

void check_may_be_live(const Body& body) {
  if (body.robot != kNone) throw SceneError("body " + in_quotes(body.name) + ": live: " + placed_by_joints(body));
  if (body.is_static)
    throw SceneError("body " + in_quotes(body.name) + ": live: a static body never gets another pose than its own");
}

void check_uncertainty(const Body& body) {
  const auto& [position, angle] = body.uncertainty;
  check_positive(body.name, "uncertainty.position", position, true);
  check_positive(body.name, "padding", body.padding, true);
  const std::string who = "body " + in_quotes(body.name) + ": ";
  if (!(angle >= 0 && angle <= 3.2))
    throw SceneError(who + "uncertainty.angle: expected 0 to 3.2 radians, got " + number(angle));
  if (!(body.max_speed >= 0 && body.max_speed <= kMaxCoordinate))
    throw SceneError(who + "max_speed: expected a number of metres a second >= 0, got " + number(body.max_speed));
}

constexpr const char* kPlaneStands = "a half_space follows no body: it stands where its pose says";

bool is_plane(const Body& body) {
  return std::any_of(body.pieces.begin(), body.pieces.end(), [](const PiecePtr& p) { return is_half_space(*p); });
}

// A half-space has points at any distance, which the least turn moves by any length: it stays as its pose says,
// exactly.
void settle_half_space(Body& body) {
  if (!is_plane(body)) return;
  const std::string who = "body " + in_quotes(body.name) + ": ";
  if (body.pieces.size() > 1) throw SceneError(who + "a half_space is a body of its own, and no piece of another");
  if (body.parent != kNone) throw SceneError(who + "parent: " + kPlaneStands);
  if (body.uncertainty.angle > 0)
    throw SceneError(who +
                     "uncertainty.angle: expected 0, since a turn moves a half_space by any length, far enough out");
  body.is_static = true;
}

// A body whose one piece is a cloud has its points replaced like any that was made for it.
void settle_cloud(Body& body) {
  const Surface* const cloud = body.pieces.size() == 1 ? body.pieces[0]->surface.get() : nullptr;
  if (is_cloud(body) || !cloud || !cloud->is_cloud()) return;
  body.cloud = CloudState::kPoints;
  const double grown_by = body.is_grown ? body.padding + body.uncertainty.position : 0;
  body.cloud_radius = std::max(0.0, body.pieces[0]->radius - grown_by);
  body.voxel = cloud->edge();
  body.model_error = std::max(body.model_error, cloud->rounding());
  body.model_inner = std::max(body.model_inner, cloud->rounding());
}

constexpr std::size_t kRememberedVertices = 5'000;  // of shapes that are recognised before their hulls are made

// What a file is recognised by: another one, or the same one written anew, gives another key.
std::string file_key(const std::string& path) {
  struct stat info{};
  if (::stat(path.c_str(), &info) != 0) return path + "|";
  return std::to_string(info.st_dev) + ':' + std::to_string(info.st_ino) + ':' + std::to_string(info.st_size) + ':' +
         std::to_string(info.st_mtim.tv_sec) + '.' + std::to_string(info.st_mtim.tv_nsec) + '|' + path + '|';
}

}  // namespace

Body Scene::body_from(const std::string& name, const BodyOptions& options) const {
  Body body;
  body.name = name;
  body.is_static = options.is_static;
  body.pose = options.pose;
  body.is_live = options.is_live;
  body.uncertainty = options.uncertainty;
  body.padding = options.padding;
  body.max_speed = options.max_speed;
  check_positive(name, "radius", options.radius, true);
  if (!options.parent.empty()) {
    body.parent = find_body(options.parent);
    if (body.parent == kNone)
      throw SceneError("body " + in_quotes(name) + ": parent: there is no body " + in_quotes(options.parent));
  }
  return body;
}

template <class F>
std::uint32_t Scene::add_geometry(const std::string& name, const BodyOptions& options, F&& geometry_of) {
  check_free(name, "body");
  Body body = body_from(name, options);
  try {
    const Geometry geometry = geometry_of();
    for (const PiecePtr& piece : geometry.pieces) body.pieces.push_back(shared_piece(piece));
    body.display = geometry.display;
    body.model_error = geometry.model_error;
    body.model_inner = geometry.model_inner;
    body.hull_excess = geometry.hull_excess;
    body.empty_share = geometry.empty_share;
    body.source = geometry.source;
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

std::uint32_t Scene::add_mesh(const std::string& name, const std::string& path, Vec3d scale, Convexify convexify,
                              const BodyOptions& options, UpAxis up) {
  const FpEnvironment environment;
  return add_geometry(name, options, [&] { return mesh_geometry(path, {scale, convexify, options.radius, up}); });
}

std::uint32_t Scene::add_mesh(const std::string& name, std::span<const Vec3d> vertices,
                              std::span<const Triangle> triangles, Convexify convexify, const BodyOptions& options) {
  const FpEnvironment environment;
  return add_geometry(name, options,
                      [&] { return geometry_of_triangles(vertices, triangles, convexify, options.radius); });
}

// Of a file, scale and so on that were asked for before: what was made then. Throws MeshError.
const Geometry& Scene::mesh_geometry(const std::string& path, const MeshRecipe& recipe) {
  const auto& [scale, convexify, radius, up] = recipe;
  const std::string key = file_key(path) + number(scale.x) + ',' + number(scale.y) + ',' + number(scale.z) + ',' +
                          std::to_string(static_cast<int>(convexify)) + ',' + number(radius) + ',' +
                          std::to_string(static_cast<int>(up));
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
  return add_geometry(name, options,
                      [&] { return geometry_of_primitive(cylinder_of(radius, length), options.radius, "cylinder"); });
}

std::uint32_t Scene::add_cone(const std::string& name, double radius, double length, const BodyOptions& options) {
  const FpEnvironment environment;
  check_positive(name, "cone radius", radius);
  check_positive(name, "cone length", length);
  return add_geometry(name, options,
                      [&] { return geometry_of_primitive(cone_of(radius, length), options.radius, "cone"); });
}

std::uint32_t Scene::add_ellipsoid(const std::string& name, Vec3d radii, const BodyOptions& options) {
  const FpEnvironment environment;
  for (int k = 0; k < 3; ++k) check_positive(name, "ellipsoid half axis", radii[k]);
  return add_geometry(name, options, [&] {
    return geometry_of_primitive({Primitive::Kind::kEllipsoid, radii}, options.radius, "ellipsoid");
  });
}

std::uint32_t Scene::add_half_space(const std::string& name, const BodyOptions& options) {
  const FpEnvironment environment;
  return add_geometry(name, options, [&] {
    return geometry_of_primitive({Primitive::Kind::kHalfSpace, {0, 0, 0}}, options.radius, "half_space");
  });
}

void Scene::check_free(const std::string& name, const char* what) const {
  check_name(name, what);
  if (body_ids_.count(name))
    throw SceneError(std::string(what) + " name " + in_quotes(name) + " is already that of a body");
  if (group_ids_.count(name))
    throw SceneError(std::string(what) + " name " + in_quotes(name) + " is already that of a group");
}

std::uint32_t Scene::add_body(Body body) {
  const FpEnvironment environment;
  check_free(body.name, "body");
  if (body.pieces.empty()) throw SceneError("body " + in_quotes(body.name) + ": expected at least one piece");
  return insert_body(std::move(body));
}

// A body with a free name; one without pieces is a frame.
std::uint32_t Scene::insert_body(Body body) {
  const std::string who = "body " + in_quotes(body.name) + ": ";
  for (const PiecePtr& piece : body.pieces)
    if (!piece) throw SceneError(who + "a piece is null");
  if (bodies_.size() >= kGroupBit) throw SceneError(who + "too many bodies");
  if (body.pose && check(*body.pose) == PoseQuality::kBad)
    throw SceneError(who + "pose: expected finite numbers and a quaternion of norm 1e-6 to 1e6");
  if (!(body.model_error >= 0 && body.model_error <= kMaxCoordinate))
    throw SceneError(who + "model_error: expected a number of metres >= 0, got " + number(body.model_error));
  if (!(body.model_inner >= 0 && body.model_inner <= kMaxCoordinate))
    throw SceneError(who + "model_inner: expected a number of metres >= 0, got " + number(body.model_inner));
  check_uncertainty(body);
  settle_half_space(body);
  settle_cloud(body);
  if (body.is_live) check_may_be_live(body);
  const std::uint32_t parent = body.parent;
  body.parent = kNone;
  if (parent != kNone && parent >= bodies_.size())
    throw SceneError(who + "parent: there is no body with the id " + std::to_string(parent));
  if (parent != kNone && body.is_static && !bodies_[parent].is_static)
    throw SceneError(who + "a static body cannot follow the movable body " + in_quotes(bodies_[parent].name));
  if (!body.pose && (body.is_static || parent != kNone)) body.pose = Pose{};
  body.parent = parent;
  grow(body);
  by_pieces_ = nullptr;
  has_uncertainties_ |= has_uncertainty(body);
  has_surfaces_ |= has_surface(body);
  const auto id = static_cast<std::uint32_t>(bodies_.size());
  body_ids_.emplace(body.name, id);
  bodies_.push_back(std::move(body));
  return id;
}

void Scene::set_parent(const std::string& child, const std::string& parent) {
  const std::uint32_t c = find_body(child), p = find_body(parent);
  if (c == kNone) throw SceneError("there is no body " + in_quotes(child));
  const std::string who = "body " + in_quotes(child) + ": ";
  if (p == kNone) throw SceneError(who + "parent: there is no body " + in_quotes(parent));
  if (bodies_[c].robot != kNone) throw SceneError(who + "parent: " + placed_by_joints(bodies_[c]));
  if (is_plane(bodies_[c])) throw SceneError(who + "parent: " + kPlaneStands);
  if (bodies_[c].is_static && !bodies_[p].is_static)
    throw SceneError(who + "a static body cannot follow the movable body " + in_quotes(parent));
  for (std::uint32_t above = p; above != kNone; above = bodies_[above].parent)
    if (above == c) throw SceneError(who + "parent: " + in_quotes(parent) + " follows " + in_quotes(child) + " itself");
  bodies_[c].parent = p;
  if (!bodies_[c].pose) bodies_[c].pose = Pose{};
}

void Scene::set_live(const std::string& body) {
  const std::uint32_t id = find_body(body);
  if (id == kNone) throw SceneError("there is no body " + in_quotes(body));
  check_may_be_live(bodies_[id]);
  bodies_[id].is_live = true;
}

void Scene::add_group(const std::string& name, std::span<const std::string> bodies) {
  check_free(name, "group");
  Group group{name, {}};
  for (const std::string& body : bodies) {
    group.bodies.push_back(find_body(body));
    if (group.bodies.back() == kNone)
      throw SceneError("group " + in_quotes(name) + ": there is no body " + in_quotes(body));
  }
  insert_group(std::move(group));
}

void Scene::insert_group(Group group) {
  std::sort(group.bodies.begin(), group.bodies.end());
  group.bodies.erase(std::unique(group.bodies.begin(), group.bodies.end()), group.bodies.end());
  group_ids_.emplace(group.name, static_cast<std::uint32_t>(groups_.size()));
  groups_.push_back(std::move(group));
}

std::vector<std::uint32_t> Scene::resolve(const std::string& body_or_group) const {
  // A robot's name is that of a group and of a frame, which has no pairs.
  if (const std::uint32_t id = find_group(body_or_group); id != kNone) return groups_[id].bodies;
  if (const std::uint32_t id = find_body(body_or_group); id != kNone) return {id};
  if (body_or_group != "*") throw SceneError("there is no body or group " + in_quotes(body_or_group));
  std::vector<std::uint32_t> every(bodies_.size());
  for (std::uint32_t i = 0; i < every.size(); ++i) every[i] = i;
  return every;
}

void Scene::ignore(const std::string& a, const std::string& b) {
  const std::vector<std::uint32_t> of_a = resolve(a), of_b = resolve(b);
  if (a == b && of_a.size() == 1 && find_body(a) != kNone)
    throw SceneError("ignore: " + in_quotes(a) + " with itself: a body has no pair with itself");
  if (of_a.size() * of_b.size() > kMaxIgnoredPairs)
    throw SceneError("ignore: " + in_quotes(a) + " and " + in_quotes(b) +
                     " name too many pairs: " + std::to_string(of_a.size() * of_b.size()));
  std::vector<std::pair<std::uint32_t, std::uint32_t>> fresh;
  for (const std::uint32_t i : of_a)
    for (const std::uint32_t j : of_b)
      if (i != j) fresh.emplace_back(std::min(i, j), std::max(i, j));
  leave_out(std::move(fresh));
}

// Pairs (a < b) in any order.
void Scene::leave_out(std::vector<std::pair<std::uint32_t, std::uint32_t>> fresh) {
  std::sort(fresh.begin(), fresh.end());
  const auto old = static_cast<std::ptrdiff_t>(ignored_.size());
  ignored_.insert(ignored_.end(), fresh.begin(), fresh.end());
  std::inplace_merge(ignored_.begin(), ignored_.begin() + old, ignored_.end());
  ignored_.erase(std::unique(ignored_.begin(), ignored_.end()), ignored_.end());
}

std::uint32_t Scene::find_body(std::string_view name) const {
  const auto found = body_ids_.find(std::string(name));
  return found == body_ids_.end() ? kNone : found->second;
}

std::uint32_t Scene::find_group(std::string_view name) const {
  const auto found = group_ids_.find(std::string(name));
  return found == group_ids_.end() ? kNone : found->second;
}

std::uint32_t Scene::find_joint(std::string_view name) const {
  const auto found = joint_ids_.find(std::string(name));
  return found == joint_ids_.end() ? kNone : found->second;
}

std::uint64_t Scene::revision() const {
  const FpEnvironment environment;
  Digest digest;
  digest.add(std::uint64_t{bodies_.size()});
  for (const Body& body : bodies_) {
    digest.add(std::string_view(body.name));
    digest.add(std::uint64_t{body.parent});
    digest.add(std::uint64_t{body.is_static} | std::uint64_t{body.is_live} << 1);
    digest.add(body.model_error);
    const double uncertainties[] = {body.model_inner, body.uncertainty.position, body.uncertainty.angle, body.padding,
                                    body.max_speed};
    if (std::any_of(std::begin(uncertainties), std::end(uncertainties),
                    [](double uncertainty) { return uncertainty > 0; }))
      for (const double uncertainty : uncertainties) digest.add(uncertainty);
    digest.add(std::uint64_t{body.pose.has_value()});
    if (body.pose) {
      digest.add(body.pose->translation);
      for (const double q : {body.pose->qw, body.pose->qx, body.pose->qy, body.pose->qz}) digest.add(q);
    }
    if (is_cloud(body)) {
      digest.add(static_cast<std::uint64_t>(body.cloud));
      digest.add(double{body.voxel});
    }
    digest.add(std::uint64_t{body.pieces.size()});
    for (const PiecePtr& piece : body.pieces) digest.add(piece->digest);
  }
  digest.add(std::uint64_t{groups_.size()});
  for (const Group& group : groups_) {
    digest.add(std::string_view(group.name));
    digest.add(std::uint64_t{group.bodies.size()});
    for (const std::uint32_t id : group.bodies) digest.add(std::uint64_t{id});
  }
  digest.add(std::uint64_t{ignored_.size()});
  for (const auto& [a, b] : ignored_) digest.add(std::uint64_t{a} << 32 | b);
  for (const auto& robot : robots_) digest.add(robot->digest);
  for (const SceneJoint& joint : joints_) {
    digest.add(std::uint64_t{joint.home.has_value()});
    digest.add(joint.home.value_or(0));
  }
  return digest.value();
}

}  // namespace clearance
