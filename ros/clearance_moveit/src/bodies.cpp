#include "bodies.h"

#include <clearance/eigen.h>

#include <algorithm>
#include <rclcpp/logging.hpp>

namespace clearance_moveit {
namespace {

using namespace collision_detection;

constexpr std::size_t kMostPlans = 16;

bool have_same_shapes(const Item& a, const Item& b) {
  return a.type == b.type && a.link == b.link && a.padding == b.padding && a.scale == b.scale && a.shapes == b.shapes &&
         a.name == b.name && a.cells == b.cells;
}

bool are_same(const Item& a, const Item& b) {
  const auto same = [](const auto& X, const auto& Y) { return X.matrix() == Y.matrix(); };
  return have_same_shapes(a, b) && a.touch_links == b.touch_links && std::ranges::equal(a.poses, b.poses, same);
}

bool is_of_world(const Item& item) {
  return item.type == BodyTypes::WORLD_OBJECT;
}

const auto& shapes_of(const Item& item) {
  return item.type == BodyTypes::ROBOT_LINK ? item.link->getShapes() : item.shapes;
}

const auto& poses_of(const Item& item) {
  return item.type == BodyTypes::ROBOT_LINK ? item.link->getCollisionOriginTransforms() : item.poses;
}

/// Whether a pair is never checked: bodies attached to one link, and touch links.
bool may_touch(const Item& a, const Item& b) {
  if (is_of_world(a) || is_of_world(b)) return false;
  if (a.type == BodyTypes::ROBOT_ATTACHED && b.type == BodyTypes::ROBOT_ATTACHED && a.link == b.link) return true;
  return a.touch_links.contains(b.name) || b.touch_links.contains(a.name);
}

}  // namespace

bool is_allowed(const Matrix* matrix, const ItemPair& pair) {
  AllowedCollision::Type type{};
  return matrix && matrix->getAllowedCollision(pair.first->name, pair.second->name, type) &&
         type == AllowedCollision::ALWAYS;
}

Bodies::Bodies(const RobotFrames& frames)
    : engine_(frames.make_engine()), joints_(frames.joints(engine_)), movers_(frames.movers(engine_)) {}

bool Bodies::are(const std::vector<Item>& items) const {
  return std::ranges::equal(items_, items, are_same);
}

void Bodies::become(std::vector<Item> items) {
  plans_.clear();
  items_.swap(items);  // `items` are the old ones
  for (Item& item : items_) {
    const auto old = std::ranges::find_if(items, [&](const Item& o) { return have_same_shapes(o, item); });
    if (old == items.end()) continue;
    item.bodies = std::move(old->bodies);
    item.is_whole = old->is_whole;
    items.erase(old);
  }
  for (const Item& item : items)
    for (const auto& names : item.bodies)
      for (const std::string& name : names) engine_.remove_body(name);
  for (Item& item : items_)
    if (item.bodies.empty()) add(item);
  items_by_id_.assign(engine_.scene().bodies.size(), nullptr);
  std::vector<std::pair<std::uint32_t, clearance::Pose7>> poses;
  for (Item& item : items_)
    for (std::size_t i = 0; i < item.bodies.size(); ++i)
      for (const std::string& name : item.bodies[i]) {
        items_by_id_[item.ids.emplace_back(engine_.body(name))] = &item;
        poses.emplace_back(item.ids.back(), clearance::eigen::pose(poses_of(item)[i]));
      }
  engine_.set_poses(poses);
}

void Bodies::add(Item& item) {
  for (std::size_t i = 0; i < shapes_of(item).size(); ++i) {
    item.bodies.emplace_back();
    try {
      clearance::NewBody body{.name = "shape" + std::to_string(made_++)};
      body.pose = clearance::eigen::pose(poses_of(item)[i]);
      body.padding = item.padding;
      if (item.link) body.parent = engine_.body(RobotFrames::frame(*item.link));
      add_shape(engine_, body, *shapes_of(item)[i], item.scale, item.bodies.back());
    } catch (const std::exception& error) {
      item.is_whole = false;
      RCLCPP_ERROR(rclcpp::get_logger("clearance"), "%s: counts as in collision: shape %zu: %s", item.name.c_str(), i,
                   error.what());
    }
  }
}

std::shared_ptr<Plan> Bodies::plan(Against against, const Matrix* matrix, const ActiveLinks* active, bool is_exact) {
  const auto allows = [&](const ItemPair& pair) { return is_allowed(matrix, pair); };
  const std::lock_guard lock(plans_mutex_);
  for (const auto& plan : plans_)
    if (plan->against == against && plan->active.has_value() == !!active && (!active || *plan->active == *active) &&
        std::ranges::all_of(plan->allowed, allows) && !(is_exact && std::ranges::any_of(plan->checked, allows)))
      return plan;
  if (plans_.size() == kMostPlans) plans_.pop_back();
  return *plans_.insert(plans_.begin(), make_plan(against, matrix, active));
}

std::shared_ptr<Plan> Bodies::make_plan(Against against, const Matrix* matrix, const ActiveLinks* active) const {
  auto plan = std::make_shared<Plan>();
  plan->against = against;
  if (active) plan->active = *active;
  std::vector<clearance::IdPair> without_depth;
  const auto is_active = [&](const Item& item) { return item.link && active->contains(item.link); };
  for (const Item& b : items_)
    for (const Item& a : std::span(items_.data(), &b)) {
      if (is_of_world(a) && is_of_world(b)) continue;
      if ((is_of_world(a) || is_of_world(b)) != (against == Against::kWorld)) continue;
      if (active && !is_active(a) && !is_active(b)) continue;
      if (may_touch(a, b)) continue;
      const ItemPair pair(&a, &b);
      (is_allowed(matrix, pair) ? plan->allowed : plan->checked).push_back(pair);
      if (is_allowed(matrix, pair)) continue;
      if (!a.is_whole || !b.is_whole) plan->unknown = pair;
      auto& pairs = a.cells.empty() && b.cells.empty() ? plan->pairs : without_depth;
      for (const std::uint32_t id_a : a.ids)
        for (const std::uint32_t id_b : b.ids) pairs.push_back({id_a, id_b});
    }
  plan->pairs_with_depth = plan->pairs.size();
  plan->pairs.insert(plan->pairs.end(), without_depth.begin(), without_depth.end());
  return plan;
}

clearance::Result Bodies::run(Plan& plan, const Rows& rows) const {
  const bool is_motion = rows.positions.size() > joints_.size() || rows.poses.size() > movers_.size();
  auto& idle = is_motion ? plan.motions : plan.checks;
  std::optional<clearance::Prepared> prepared;
  {
    const std::lock_guard lock(plan.mutex);
    if (!idle.empty()) {
      prepared.emplace(std::move(idle.back()));
      idle.pop_back();
    }
  }
  if (!prepared) {
    clearance::Query query{.pairs = plan.pairs, .all_pairs = false, .bodies = movers_, .joints = joints_};
    query.reduce = clearance::Reduce::kAny;
    prepared.emplace(engine_.prepare(is_motion ? clearance::as_motions(query) : clearance::as_check(query)));
  }
  const clearance::Result result = prepared->run({rows.positions, rows.poses});
  const std::lock_guard lock(plan.mutex);
  idle.push_back(std::move(*prepared));
  return result;
}

std::vector<clearance::Result> Bodies::distances(const Plan& plan, const Rows& rows, clearance::Query query) const {
  query.all_pairs = false;
  query.bodies = movers_;
  query.configurations = rows.poses;
  query.joints = joints_;
  query.positions = rows.positions;
  const std::span<const clearance::IdPair> pairs(plan.pairs);
  const std::size_t with_depth = query.signed_distance ? plan.pairs_with_depth : 0;
  std::vector<clearance::Result> results;
  for (const bool is_signed : {true, false}) {
    query.pairs = is_signed ? pairs.first(with_depth) : pairs.subspan(with_depth);
    query.signed_distance = is_signed;
    if (!query.pairs.empty()) results.push_back(engine_.distances(query));
  }
  return results;
}

ItemPair Bodies::items(const clearance::Result& result, std::size_t i) const {
  return {items_by_id_.at(result.pair()[i][0]), items_by_id_.at(result.pair()[i][1])};
}

}  // namespace clearance_moveit
