#include "engine/scene/scene.h"

#include <algorithm>
#include <iterator>

#include "engine/base/digest.h"
#include "engine/base/fp_environment.h"
#include "engine/scene/body_checks.h"
#include "wire/api/unknown_name.h"

namespace clearance::engine {

namespace {

// Pairs of one ignore(). More is a mistake in the scene file.
constexpr std::size_t kMaxIgnoredPairs = std::size_t{1} << 27;

// Adds all of a body that a revision depends on.
void add_body_to(Digest& digest, const Body& body) {
  digest.add(std::string_view(body.name));
  digest.add(std::uint64_t{body.parent});
  digest.add(std::uint64_t{body.is_static} | std::uint64_t{body.requires_pose} << 1);
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
  digest.add(std::uint64_t{body.parts.size()});
  for (const ConvexPartPtr& part : body.parts) digest.add(part->digest);
}

}  // namespace

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
  if (body.parts.empty()) throw SceneError("body " + in_quotes(body.name) + ": expected at least one piece");
  return insert_body(std::move(body));
}

// Inserts a body with a free name; one without parts is a frame.
std::uint32_t Scene::insert_body(Body body) {
  const std::string who = "body " + in_quotes(body.name) + ": ";
  for (const ConvexPartPtr& part : body.parts)
    if (!part) throw SceneError(who + "a piece is null");
  if (bodies_.size() >= kGroupBit) throw SceneError(who + "too many bodies");
  if (body.pose && check(*body.pose) == PoseQuality::kBad)
    throw SceneError(who + "pose: expected finite numbers and a quaternion of norm 1e-6 to 1e6");
  if (!(body.model_error >= 0 && body.model_error <= kMaxCoordinate))
    throw SceneError(who + "model_error: expected a number of metres >= 0, got " + number_text(body.model_error));
  if (!(body.model_inner >= 0 && body.model_inner <= kMaxCoordinate))
    throw SceneError(who + "model_inner: expected a number of metres >= 0, got " + number_text(body.model_inner));
  check_uncertainty(body);
  fix_half_space(body);
  adopt_cloud(body);
  if (body.requires_pose) check_may_require_pose(body);
  const std::uint32_t parent = body.parent;
  body.parent = kNone;
  if (parent != kNone && parent >= bodies_.size())
    throw SceneError(who + "parent: there is no body with the id " + std::to_string(parent));
  if (parent != kNone && body.is_static && !bodies_[parent].is_static)
    throw SceneError(who + "a static body cannot follow the movable body " + in_quotes(bodies_[parent].name));
  if (!body.pose && (body.is_static || parent != kNone)) body.pose = Pose{};
  body.parent = parent;
  grow(body);
  has_uncertainties_ |= has_uncertainty(body);
  has_surfaces_ |= has_surface(body);
  const auto id = static_cast<std::uint32_t>(bodies_.size());
  body_ids_.emplace(body.name, id);
  bodies_.push_back(std::move(body));
  return id;
}

void Scene::replace_shape(const std::string& name, const Geometry& shape) {
  const FpEnvironment environment;
  const std::uint32_t id = find_body(name);
  if (id == kNone) throw SceneError(no_body(*this, name));
  Body next = bodies_[id];
  const std::string who = "body " + in_quotes(name) + ": ";
  // The bounds on a link's pose contain its size (LinkErrors).
  if (next.robot != kNone) throw SceneError(who + "the shape of a robot's link cannot be replaced");
  if (next.parts.empty()) throw SceneError(who + "a frame has no shape to replace");
  static_cast<Geometry&>(next) = shape;
  for (ConvexPartPtr& part : next.parts) part = shared_part(part);
  if (is_plane(next) && !next.is_static) throw SceneError(who + "a half_space is static, and this body may move");
  fix_half_space(next);
  adopt_cloud(next);
  next.is_grown = false;
  next.reach = 0;
  grow(next);
  bodies_[id] = std::move(next);
  has_uncertainties_ = std::any_of(bodies_.begin(), bodies_.end(), has_uncertainty);
  has_surfaces_ = std::any_of(bodies_.begin(), bodies_.end(), has_surface);
}

void Scene::set_parent(const std::string& child, const std::string& parent) {
  const std::uint32_t c = find_body(child), p = find_body(parent);
  if (c == kNone) throw SceneError(no_body(*this, child));
  const std::string who = "body " + in_quotes(child) + ": ";
  if (p == kNone) throw SceneError(who + "parent: " + no_body(*this, parent));
  if (bodies_[c].robot != kNone) throw SceneError(who + "parent: " + placed_by_joints(bodies_[c]));
  if (is_plane(bodies_[c])) throw SceneError(who + "parent: " + kPlaneStands);
  if (bodies_[c].is_static && !bodies_[p].is_static)
    throw SceneError(who + "a static body cannot follow the movable body " + in_quotes(parent));
  for (std::uint32_t above = p; above != kNone; above = bodies_[above].parent)
    if (above == c) throw SceneError(who + "parent: " + in_quotes(parent) + " follows " + in_quotes(child) + " itself");
  bodies_[c].parent = p;
  if (!bodies_[c].pose) bodies_[c].pose = Pose{};
}

void Scene::set_requires_pose(const std::string& body) {
  const std::uint32_t id = find_body(body);
  if (id == kNone) throw SceneError(no_body(*this, body));
  check_may_require_pose(bodies_[id]);
  bodies_[id].requires_pose = true;
}

void Scene::add_group(const std::string& name, std::span<const std::string> bodies) {
  check_free(name, "group");
  Group group{name, {}};
  for (const std::string& body : bodies) {
    group.bodies.push_back(find_body(body));
    if (group.bodies.back() == kNone) throw SceneError("group " + in_quotes(name) + ": " + no_body(*this, body));
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
  if (body_or_group != "*")
    throw SceneError("there is no body or group " + in_quotes(body_or_group) +
                     did_you_mean(body_or_group, all_names(groups_, all_names(bodies_))));
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
  for (const Body& body : bodies_) add_body_to(digest, body);
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

}  // namespace clearance::engine
