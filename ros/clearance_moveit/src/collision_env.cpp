#include <clearance_moveit/collision_env.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <moveit/robot_state/attached_body.hpp>
#include <rclcpp/logging.hpp>
#include <stdexcept>
#include <utility>

#include "bodies.h"
#include "robot_frames.h"

namespace clearance_moveit {
namespace {

using namespace collision_detection;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kPairFields = clearance::kDefaultFields | clearance::kFieldFlags | clearance::kFieldPoints |
                                      clearance::kFieldNormal | clearance::kFieldPair;

std::pair<std::string, std::string> sorted(const std::string& a, const std::string& b) {
  return a < b ? std::pair{a, b} : std::pair{b, a};
}

/// A pair of which nothing is proved.
DistanceResultsData unproved(const ItemPair& pair) {
  DistanceResultsData data;
  data.distance = -kInfinity;
  data.link_names[0] = pair.first->name;
  data.link_names[1] = pair.second->name;
  data.body_types[0] = pair.first->type;
  data.body_types[1] = pair.second->type;
  return data;
}

/// A pair with row `i` of a result; points and normal are zeros where there are none.
DistanceResultsData data(const ItemPair& pair, const clearance::Result& found, std::size_t i) {
  DistanceResultsData data = unproved(pair);
  const auto row = [&](std::span<const double> column) -> Eigen::Vector3d {
    const Eigen::Vector3d vector = Eigen::Map<const Eigen::Vector3d>(column.data() + 3 * i);
    return vector.allFinite() ? vector : Eigen::Vector3d::Zero();
  };
  if (!(found.flags()[i] & clearance::kFlagIncomplete) && found.lower()[i] > -kInfinity)
    data.distance = found.lower()[i];
  data.nearest_points[0] = row(found.point_a());
  data.nearest_points[1] = row(found.point_b());
  data.normal = row(found.normal());
  return data;
}

/// Stores a contact, unless the request has enough of its pair or in all.
/// \param distance of the pair, or NaN
void store(const CollisionRequest& request, CollisionResult& result, const DistanceResultsData& data, double distance,
           double time = 0) {
  if (!request.contacts || result.contact_count >= request.max_contacts) return;
  std::vector<Contact>& contacts = result.contacts[sorted(data.link_names[0], data.link_names[1])];
  if (contacts.size() >= request.max_contacts_per_pair) return;
  Contact& contact = contacts.emplace_back();
  contact.body_name_1 = data.link_names[0];
  contact.body_type_1 = data.body_types[0];
  contact.body_name_2 = data.link_names[1];
  contact.body_type_2 = data.body_types[1];
  contact.nearest_points[0] = data.nearest_points[0];
  contact.nearest_points[1] = data.nearest_points[1];
  contact.pos = 0.5 * (data.nearest_points[0] + data.nearest_points[1]);
  contact.normal = data.normal;
  contact.depth = std::max(0.0, -distance);
  contact.percent_interpolation = std::isfinite(time) ? time : 0;
  ++result.contact_count;
}

/// Adds a pair to a result: all of its rows, or the nearest ones.
void add(const DistanceRequest& request, DistanceResult& result, const DistanceResultsData& data) {
  if (data.distance < result.minimum_distance.distance) result.minimum_distance = data;
  result.collision |= !(data.distance > 0);
  if (request.type == DistanceRequestType::GLOBAL) return;
  std::vector<DistanceResultsData>& of_pair = result.distances[sorted(data.link_names[0], data.link_names[1])];
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

std::vector<Item> CollisionEnv::items(const State& state) const {
  std::vector<const moveit::core::AttachedBody*> attached;
  state.getAttachedBodies(attached);
  const auto& links = robot_model_->getLinkModelsWithCollisionGeometry();
  std::vector<Item> items;
  items.reserve(links.size() + attached.size() + getWorld()->size());
  for (const auto* link : links)
    items.push_back({link->getName(),
                     BodyTypes::ROBOT_LINK,
                     link,
                     {},
                     {},
                     {},
                     getLinkPadding(link->getName()),
                     getLinkScale(link->getName()),
                     {}});
  for (const auto* body : attached)
    items.push_back({body->getName(), BodyTypes::ROBOT_ATTACHED, body->getAttachedLink(), body->getShapes(),
                     body->getShapePosesInLinkFrame(), body->getTouchLinks(),
                     getLinkPadding(body->getAttachedLinkName()), getLinkScale(body->getAttachedLinkName()),
                     cells_of(body->getShapes())});
  for (const auto& [name, object] : *getWorld())
    items.push_back({name,
                     BodyTypes::WORLD_OBJECT,
                     nullptr,
                     object->shapes_,
                     object->global_shape_poses_,
                     {},
                     0,
                     1,
                     cells_of(object->shapes_)});
  return items;
}

/// The bodies of a state and of the world, which do not change while a copy of the pointer exists.
std::shared_ptr<Bodies> CollisionEnv::bodies(const State& state) const {
  std::vector<Item> items = this->items(state);
  const std::lock_guard lock(mutex_);
  if (bodies_ && bodies_->are(items)) return bodies_;
  std::shared_ptr<Bodies> next = std::move(bodies_);  // an exception leaves none half made
  if (next.use_count() != 1) next = std::make_shared<Bodies>(*frames_);
  std::atomic_thread_fence(std::memory_order_acquire);  // after the last use by other threads
  next->become(std::move(items));
  return bodies_ = next;
}

void CollisionEnv::check(Against against, const Request& request, Result& result, const State& state, const State* to,
                         const Matrix* matrix) const {
  try {
    collide(against, request, result, state, to, matrix);
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

void CollisionEnv::collide(Against against, const Request& request, Result& result, const State& state, const State* to,
                           const Matrix* matrix) const {
  const std::shared_ptr<Bodies> bodies = this->bodies(state);
  if (to && !bodies->are(items(*to))) throw std::invalid_argument("the states of a motion have other attached bodies");
  const Rows rows = frames_->rows(state, to);
  const auto* active = robot_model_->hasJointModelGroup(request.group_name)
                           ? &robot_model_->getJointModelGroup(request.group_name)->getUpdatedLinkModelsSet()
                           : nullptr;
  for (const bool is_exact : {false, true}) {
    const std::shared_ptr<Plan> plan = bodies->plan(against, matrix, active, is_exact);
    if (plan->pairs.empty() && !plan->unknown) return;
    if (to && !frames_->is_straight() && !plan->unknown)
      throw std::invalid_argument("this robot does not move straight in its joints");
    double time = 0;
    ItemPair pair = plan->unknown.value_or(ItemPair{});
    if (!plan->unknown) {
      const clearance::Result found = bodies->run(*plan, rows);
      if (found.all_free()) return;
      pair = bodies->items(found, 0);
      if (to) time = found.time()[0];
    }
    if (is_allowed(matrix, pair)) continue;  // not in an exact plan
    result.collision = true;
    if (to || plan->unknown) return store(request, result, unproved(pair), 0, time);
    if (!request.contacts) return;
    clearance::Query query{.max_distance = 0, .signed_distance = true, .reduce = clearance::Reduce::kWithin};
    query.fields = kPairFields;
    for (const clearance::Result& found : bodies->distances(*plan, rows, query))
      for (std::size_t i = 0; i < found.rows(); ++i)
        if (const ItemPair hit = bodies->items(found, i); !is_allowed(matrix, hit))
          store(request, result, data(hit, found, i), found.distance()[i]);
    return;
  }
}

void CollisionEnv::distance(Against against, const DistanceRequest& request, DistanceResult& result,
                            const State& state) const {
  try {
    const std::shared_ptr<Bodies> bodies = this->bodies(state);
    const auto plan = bodies->plan(against, request.acm, request.active_components_only, true);
    if (plan->unknown) return add(request, result, unproved(*plan->unknown));
    if (plan->pairs.empty()) return;
    const bool is_global = request.type == DistanceRequestType::GLOBAL;
    clearance::Query query;
    query.max_distance = request.distance_threshold < std::numeric_limits<double>::max()
                             ? std::max(0.0, request.distance_threshold)
                             : kInfinity;
    query.signed_distance = request.enable_signed_distance;
    query.reduce = is_global ? clearance::Reduce::kMin : clearance::Reduce::kWithin;
    query.fields = kPairFields;
    for (const clearance::Result& found : bodies->distances(*plan, frames_->rows(state, nullptr), query))
      for (std::size_t i = 0; i < found.rows(); ++i)
        if (found.status()[i] != clearance::Status::kBeyond)
          add(request, result, data(bodies->items(found, i), found, i));
  } catch (const std::exception& error) {
    log(error);
    result.collision = true;
    result.minimum_distance.distance = -kInfinity;
  }
}

}  // namespace clearance_moveit
