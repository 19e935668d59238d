#include <clearance_moveit/collision_env.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <moveit/robot_state/attached_body.hpp>
#include <optional>
#include <rclcpp/logging.hpp>
#include <shared_mutex>
#include <utility>

#include "bodies.h"
#include "robot_frames.h"

namespace clearance_moveit {
namespace {

using namespace collision_detection;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kPairFields = clearance::kDefaultFields | clearance::kFieldFlags | clearance::kFieldPoints |
                                      clearance::kFieldNormal | clearance::kFieldPair;

using Names = std::pair<std::string, std::string>;

Names sorted(const Item& a, const Item& b) {
  return a.name < b.name ? Names{a.name, b.name} : Names{b.name, a.name};
}

const ActiveLinks* active_links(const moveit::core::RobotModel& model, const std::string& group) {
  return model.hasJointModelGroup(group) ? &model.getJointModelGroup(group)->getUpdatedLinkModelsSet() : nullptr;
}

Contact contact(const Item& a, const Item& b) {
  Contact contact;
  contact.pos.setZero();
  contact.normal.setZero();
  for (Eigen::Vector3d& point : contact.nearest_points) point.setZero();
  contact.body_name_1 = a.name;
  contact.body_type_1 = a.type;
  contact.body_name_2 = b.name;
  contact.body_type_2 = b.type;
  return contact;
}

/// Stores a contact, unless the request has enough of its pair or in all.
void store(const CollisionRequest& request, CollisionResult& result, const Item& a, const Item& b,
           const Contact& contact) {
  if (result.contact_count >= request.max_contacts) return;
  std::vector<Contact>& contacts = result.contacts[sorted(a, b)];
  if (contacts.size() >= request.max_contacts_per_pair) return;
  contacts.push_back(contact);
  ++result.contact_count;
}

/// A point or normal of a column; zeros where there is none.
Eigen::Vector3d row(std::span<const double> column, std::size_t i) {
  const Eigen::Vector3d vector = Eigen::Map<const Eigen::Vector3d>(column.data() + 3 * i);
  return vector.allFinite() ? vector : Eigen::Vector3d::Zero();
}

/// Stores a contact of each pair of shapes that is not proved apart.
void store_contacts(const CollisionRequest& request, CollisionResult& result, const Bodies& bodies, const Plan& plan,
                    const Rows& rows, const AllowedCollisionMatrix* matrix) {
  clearance::Query query = bodies.query(plan, rows);
  query.max_distance = 0;
  query.signed_distance = true;
  query.reduce = clearance::Reduce::kWithin;
  query.fields = kPairFields;
  bodies.each_row(plan, query, [&](const clearance::Result& found, std::size_t i) {
    const Item &a = bodies.item(found.pair()[i][0]), &b = bodies.item(found.pair()[i][1]);
    if (is_allowed(matrix, a, b)) return;
    Contact one = contact(a, b);
    one.nearest_points[0] = row(found.point_a(), i);
    one.nearest_points[1] = row(found.point_b(), i);
    one.pos = 0.5 * (one.nearest_points[0] + one.nearest_points[1]);
    one.normal = row(found.normal(), i);
    one.depth = std::max(0.0, -found.distance()[i]);
    store(request, result, a, b, one);
  });
}

DistanceResultsData data(const DistanceRequest& request, const Item& a, const Item& b, const clearance::Result& found,
                         std::size_t i) {
  DistanceResultsData data;
  const bool is_known = !(found.flags()[i] & clearance::kFlagIncomplete) && found.lower()[i] > -kInfinity;
  data.distance = is_known ? found.lower()[i] : -kInfinity;
  data.link_names[0] = a.name;
  data.link_names[1] = b.name;
  data.body_types[0] = a.type;
  data.body_types[1] = b.type;
  if (!request.enable_nearest_points && !request.compute_gradient) return data;
  data.nearest_points[0] = row(found.point_a(), i);
  data.nearest_points[1] = row(found.point_b(), i);
  data.normal = row(found.normal(), i);
  return data;
}

/// Adds a row to a result: all of a pair, or the nearest ones.
void add(const DistanceRequest& request, DistanceResult& result, const Item& a, const Item& b,
         const DistanceResultsData& data) {
  if (data.distance < result.minimum_distance.distance) result.minimum_distance = data;
  result.collision |= !(data.distance > 0);
  if (request.type == DistanceRequestType::GLOBAL) return;
  std::vector<DistanceResultsData>& of_pair = result.distances[sorted(a, b)];
  const auto is_nearer = [](const auto& x, const auto& y) { return x.distance < y.distance; };
  of_pair.insert(std::ranges::upper_bound(of_pair, data, is_nearer), data);
  const std::size_t most = request.type == DistanceRequestType::SINGLE ? 1 : request.max_contacts_per_body;
  if (request.type != DistanceRequestType::ALL && of_pair.size() > most) of_pair.resize(most);
}

void log(const std::exception& error) {
  RCLCPP_ERROR(rclcpp::get_logger("clearance"), "counts as in collision: %s", error.what());
}

}  // namespace

const std::string CollisionDetectorAllocator::NAME = "Clearance";

CollisionEnv::CollisionEnv(const moveit::core::RobotModelConstPtr& model, double padding, double scale)
    : collision_detection::CollisionEnv(model, padding, scale), frames_(std::make_shared<RobotFrames>(*model)) {}

CollisionEnv::CollisionEnv(const moveit::core::RobotModelConstPtr& model, const WorldPtr& world, double padding,
                           double scale)
    : collision_detection::CollisionEnv(model, world, padding, scale), frames_(std::make_shared<RobotFrames>(*model)) {}

CollisionEnv::CollisionEnv(const CollisionEnv& other, const WorldPtr& world)
    : collision_detection::CollisionEnv(other, world), frames_(other.frames_) {
  const std::lock_guard lock(other.mutex_);
  bodies_ = other.bodies_;
}

CollisionEnv::~CollisionEnv() = default;

std::vector<ItemView> CollisionEnv::items(const State& state) const {
  std::vector<ItemView> items;
  for (const auto* link : robot_model_->getLinkModelsWithCollisionGeometry())
    items.push_back({link->getName(), BodyTypes::ROBOT_LINK, link, link->getShapes(),
                     link->getCollisionOriginTransforms(), nullptr, getLinkPadding(link->getName()),
                     getLinkScale(link->getName())});
  std::vector<const moveit::core::AttachedBody*> attached;
  state.getAttachedBodies(attached);
  for (const auto* body : attached)
    items.push_back({body->getName(), BodyTypes::ROBOT_ATTACHED, body->getAttachedLink(), body->getShapes(),
                     body->getShapePosesInLinkFrame(), &body->getTouchLinks(),
                     getLinkPadding(body->getAttachedLinkName()), getLinkScale(body->getAttachedLinkName())});
  if (const WorldConstPtr& world = getWorld())
    for (const auto& [name, object] : *world)
      items.push_back(
          {name, BodyTypes::WORLD_OBJECT, nullptr, object->shapes_, object->global_shape_poses_, nullptr, 0, 1});
  return items;
}

/// Calls `call` with the bodies of a state and of the world, which stay while it runs.
template <class Call>
void CollisionEnv::with_bodies(const State& state, Call&& call) const {
  const std::vector<ItemView> items = this->items(state);
  std::shared_ptr<Bodies> bodies;
  {
    const std::lock_guard lock(mutex_);
    bodies = bodies_;
  }
  if (bodies) {
    const std::shared_lock lock(bodies->mutex);
    if (bodies->are(items)) return call(*bodies);
  }
  const std::lock_guard lock(mutex_);
  bodies = bodies_;
  constexpr int kOwners = 2;  // this one's member and the copy above
  if (!bodies || bodies.use_count() > kOwners) bodies = std::make_shared<Bodies>(*frames_);
  bodies_.reset();  // so that no bodies stay that an exception has left half made
  const std::lock_guard alone(bodies->mutex);
  if (!bodies->are(items)) bodies->become(items);
  bodies_ = bodies;
  call(*bodies);
}

void CollisionEnv::check(Against against, const Request& request, Result& result, const State& state, const State* to,
                         const Matrix* matrix) const {
  try {
    with_bodies(state, [&](Bodies& bodies) {
      if (to && !bodies.are(items(*to)))
        throw std::invalid_argument("the states of a motion have other attached bodies");
      const Rows rows = to ? frames_->motion(state, *to) : frames_->rows(state);
      const bool is_unknown = to && !frames_->is_straight();
      const ActiveLinks* active = active_links(*robot_model_, request.group_name);
      for (bool is_exact = false;; is_exact = true) {
        const std::shared_ptr<Plan> plan = bodies.plan(against, matrix, active, is_exact);
        if (plan->unknown) {
          const auto& [a, b] = *plan->unknown;
          if (is_allowed(matrix, *a, *b)) continue;
          result.collision = true;
          if (request.contacts) store(request, result, *a, *b, contact(*a, *b));
          return;
        }
        if (plan->pairs.empty()) return;
        if (is_unknown) throw std::invalid_argument("this robot does not move straight in its joints");
        const clearance::Result found = bodies.run(*plan, rows, to != nullptr);
        if (found.all_free()) return;
        const Item &a = bodies.item(found.pair()[0][0]), &b = bodies.item(found.pair()[0][1]);
        if (is_allowed(matrix, a, b)) continue;  // not in an exact plan
        result.collision = true;
        if (!request.contacts) return;
        if (!to) return store_contacts(request, result, bodies, *plan, rows, matrix);
        Contact one = contact(a, b);
        one.percent_interpolation = std::isfinite(found.time()[0]) ? found.time()[0] : 0;
        return store(request, result, a, b, one);
      }
    });
  } catch (const std::exception& error) {
    log(error);
    result.collision = true;
  }
  if (!request.distance || to) return;
  DistanceRequest of_distance;
  of_distance.group_name = request.group_name;
  of_distance.acm = matrix;
  of_distance.enableGroup(getRobotModel());
  DistanceResult least;
  distance(against, of_distance, least, state);
  result.distance = std::min(result.distance, least.minimum_distance.distance);
  if (request.detailed_distance) result.distance_result = least;
}

void CollisionEnv::distance(Against against, const DistanceRequest& request, DistanceResult& result,
                            const State& state) const {
  try {
    with_bodies(state, [&](Bodies& bodies) {
      const auto plan = bodies.plan(against, request.acm, request.active_components_only, true);
      if (plan->unknown) {
        const auto& [a, b] = *plan->unknown;
        DistanceResultsData unknown;
        unknown.distance = -kInfinity;
        unknown.link_names[0] = a->name;
        unknown.link_names[1] = b->name;
        unknown.body_types[0] = a->type;
        unknown.body_types[1] = b->type;
        return add(request, result, *a, *b, unknown);
      }
      if (plan->pairs.empty()) return;
      const Rows rows = frames_->rows(state);
      clearance::Query query = bodies.query(*plan, rows);
      const bool is_global = request.type == DistanceRequestType::GLOBAL;
      const double within = request.distance_threshold;
      query.max_distance = within < std::numeric_limits<double>::max() ? std::max(0.0, within) : kInfinity;
      query.signed_distance = request.enable_signed_distance;
      query.reduce = is_global ? clearance::Reduce::kMin : clearance::Reduce::kWithin;
      query.fields = kPairFields;
      bodies.each_row(*plan, query, [&](const clearance::Result& found, std::size_t i) {
        if (found.status()[i] == clearance::Status::kBeyond) return;
        const Item &a = bodies.item(found.pair()[i][0]), &b = bodies.item(found.pair()[i][1]);
        add(request, result, a, b, data(request, a, b, found, i));
      });
    });
  } catch (const std::exception& error) {
    log(error);
    result.collision = true;
    result.minimum_distance.distance = -kInfinity;
  }
}

void CollisionEnv::checkSelfCollision(const Request& request, Result& result, const State& state) const {
  check(Against::kSelf, request, result, state, nullptr, nullptr);
}
void CollisionEnv::checkSelfCollision(const Request& request, Result& result, const State& state,
                                      const Matrix& matrix) const {
  check(Against::kSelf, request, result, state, nullptr, &matrix);
}
void CollisionEnv::checkRobotCollision(const Request& request, Result& result, const State& state) const {
  check(Against::kWorld, request, result, state, nullptr, nullptr);
}
void CollisionEnv::checkRobotCollision(const Request& request, Result& result, const State& state,
                                       const Matrix& matrix) const {
  check(Against::kWorld, request, result, state, nullptr, &matrix);
}
void CollisionEnv::checkRobotCollision(const Request& request, Result& result, const State& from, const State& to,
                                       const Matrix& matrix) const {
  check(Against::kWorld, request, result, from, &to, &matrix);
}
void CollisionEnv::checkRobotCollision(const Request& request, Result& result, const State& from,
                                       const State& to) const {
  check(Against::kWorld, request, result, from, &to, nullptr);
}
void CollisionEnv::distanceSelf(const DistanceRequest& request, DistanceResult& result, const State& state) const {
  distance(Against::kSelf, request, result, state);
}
void CollisionEnv::distanceRobot(const DistanceRequest& request, DistanceResult& result, const State& state) const {
  distance(Against::kWorld, request, result, state);
}

}  // namespace clearance_moveit
