#include "bodies.h"

#include <clearance/eigen.h>

#include <algorithm>
#include <limits>
#include <rclcpp/logging.hpp>
#include <stdexcept>
#include <utility>

#include "shapes.h"

namespace clearance_moveit {
namespace {

using namespace collision_detection;

constexpr std::size_t kMostPlans = 16;

bool same_poses(const EigenSTL::vector_Isometry3d& a, const EigenSTL::vector_Isometry3d& b) {
  return std::ranges::equal(a, b, [](const auto& x, const auto& y) { return x.matrix() == y.matrix(); });
}

/// A pose of NaN for a matrix that is not rigid: a query then has no proof for the body.
clearance::Pose7 pose_of(const Eigen::Isometry3d& X) {
  try {
    return clearance::eigen::pose(X);
  } catch (const std::invalid_argument&) {
    clearance::Pose7 bad;
    bad.fill(std::numeric_limits<double>::quiet_NaN());
    return bad;
  }
}

bool is_of_world(const Item& item) {
  return item.type == BodyTypes::WORLD_OBJECT;
}

bool has_octree(const Item& item) {
  return std::ranges::any_of(item.shapes, [](const auto& shape) { return shape->type == shapes::OCTREE; });
}

/// Whether a pair is never checked: bodies attached to one link, and touch links.
bool may_touch(const Item& a, const Item& b) {
  if (is_of_world(a) || is_of_world(b)) return false;
  if (a.type == BodyTypes::ROBOT_ATTACHED && b.type == BodyTypes::ROBOT_ATTACHED && a.link == b.link) return true;
  return a.touch_links.contains(b.name) || b.touch_links.contains(a.name);
}

bool is_active(const Item& item, const ActiveLinks& active) {
  return item.link && active.contains(item.link);
}

}  // namespace

Item::Item(const ItemView& view)
    : name(view.name),
      type(view.type),
      link(view.link),
      shapes(view.shapes),
      poses(view.poses),
      padding(view.padding),
      scale(view.scale) {
  if (view.touch_links) touch_links = *view.touch_links;
}

bool Item::has_shapes_of(const ItemView& view) const {
  return type == view.type && link == view.link && padding == view.padding && scale == view.scale &&
         shapes == view.shapes && name == view.name;
}

bool Item::is(const ItemView& view) const {
  return has_shapes_of(view) && same_poses(poses, view.poses) &&
         (view.touch_links ? touch_links == *view.touch_links : touch_links.empty());
}

bool is_allowed(const Matrix* matrix, const Item& a, const Item& b) {
  AllowedCollision::Type type{};
  return matrix && matrix->getAllowedCollision(a.name, b.name, type) && type == AllowedCollision::ALWAYS;
}

Bodies::Bodies(const RobotFrames& frames)
    : engine_(frames.make_engine()), joints_(frames.joints(engine_)), movers_(frames.bodies(engine_)) {}

bool Bodies::are(const std::vector<ItemView>& views) const {
  return std::ranges::equal(items_, views, [](const auto& item, const ItemView& view) { return item->is(view); });
}

void Bodies::become(const std::vector<ItemView>& views) {
  plans_.clear();
  std::vector<std::unique_ptr<Item>> kept(views.size());
  for (auto& item : items_) {
    const auto view = std::ranges::find_if(views, [&](const ItemView& v) { return item->has_shapes_of(v); });
    if (view != views.end() && !kept[view - views.begin()]) {
      kept[view - views.begin()] = std::move(item);
    } else {
      for (const auto& names : item->bodies)
        for (const std::string& name : names) engine_.remove_body(name);
      item->bodies.clear();
    }
  }
  items_ = std::move(kept);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const bool is_new = !items_[i];
    auto item = std::make_unique<Item>(views[i]);
    if (is_new) {
      add(*item);
    } else {
      item->bodies = std::move(items_[i]->bodies);
      item->is_whole = items_[i]->is_whole;
    }
    items_[i] = std::move(item);
  }
  items_by_id_.assign(engine_.scene().bodies.size(), nullptr);
  for (auto& item : items_) {
    for (const auto& names : item->bodies)
      for (const std::string& name : names) items_by_id_[item->ids.emplace_back(engine_.body(name))] = item.get();
    place(*item);
  }
}

void Bodies::add(Item& item) {
  for (std::size_t i = 0; i < item.shapes.size(); ++i) {
    item.bodies.emplace_back();
    try {
      Placement placement{.scale = item.scale, .padding = item.padding};
      placement.pose = pose_of(item.poses[i]);
      if (item.link) placement.parent = engine_.body(RobotFrames::frame(*item.link));
      item.bodies.back() = add_shape(engine_, "shape" + std::to_string(made_++), *item.shapes[i], placement);
    } catch (const std::exception& error) {
      item.is_whole = false;
      RCLCPP_ERROR(rclcpp::get_logger("clearance"), "%s: counts as in collision: shape %zu: %s", item.name.c_str(), i,
                   error.what());
    }
  }
}

void Bodies::place(const Item& item) {
  std::vector<std::pair<std::uint32_t, clearance::Pose7>> poses;
  for (std::size_t i = 0; i < item.bodies.size(); ++i)
    for (std::size_t b = 0; b < item.bodies[i].size(); ++b)
      poses.emplace_back(item.ids[poses.size()], pose_of(item.poses[i]));
  engine_.set_poses(poses);
}

std::shared_ptr<Plan> Bodies::plan(Against against, const Matrix* matrix, const ActiveLinks* active, bool is_exact) {
  const std::lock_guard lock(plans_mutex_);
  const auto found = std::ranges::find_if(plans_, [&](const auto& plan) {
    return plan->against == against && plan->has_matrix == (matrix != nullptr) &&
           plan->active.has_value() == !!active && (!active || *plan->active == *active);
  });
  if (found != plans_.end()) {
    const auto allows = [&](const ItemPair& pair) { return is_allowed(matrix, *pair.first, *pair.second); };
    if (std::ranges::all_of((*found)->allowed, allows) && !(is_exact && std::ranges::any_of((*found)->checked, allows)))
      return *found;
    plans_.erase(found);
  }
  if (plans_.size() == kMostPlans) plans_.erase(plans_.begin());
  return plans_.emplace_back(make_plan(against, matrix, active));
}

std::shared_ptr<Plan> Bodies::make_plan(Against against, const Matrix* matrix, const ActiveLinks* active) const {
  auto plan = std::make_shared<Plan>();
  plan->against = against;
  plan->has_matrix = matrix != nullptr;
  if (active) plan->active = *active;
  std::vector<clearance::IdPair> without_depth;
  for (std::size_t i = 0; i < items_.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const Item &a = *items_[j], &b = *items_[i];
      if (is_of_world(a) && is_of_world(b)) continue;
      if ((is_of_world(a) || is_of_world(b)) != (against == Against::kWorld)) continue;
      if (active && !is_active(a, *active) && !is_active(b, *active)) continue;
      if (may_touch(a, b)) continue;
      if (is_allowed(matrix, a, b)) {
        plan->allowed.emplace_back(&a, &b);
        continue;
      }
      plan->checked.emplace_back(&a, &b);
      if (!a.is_whole || !b.is_whole) plan->unknown.emplace(&a, &b);
      auto& pairs = has_octree(a) || has_octree(b) ? without_depth : plan->pairs;
      for (const std::uint32_t id_a : a.ids)
        for (const std::uint32_t id_b : b.ids) pairs.push_back({id_a, id_b});
    }
  plan->pairs_with_depth = plan->pairs.size();
  plan->pairs.insert(plan->pairs.end(), without_depth.begin(), without_depth.end());
  return plan;
}

clearance::Query Bodies::query(const Plan& plan, const Rows& rows) const {
  return {.pairs = plan.pairs,
          .all_pairs = false,
          .bodies = movers_,
          .configurations = rows.poses,
          .joints = joints_,
          .positions = rows.positions};
}

clearance::Result Bodies::run(Plan& plan, const Rows& rows, bool is_motion) {
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
    clearance::Query query = this->query(plan, {});
    query.reduce = clearance::Reduce::kAny;
    prepared.emplace(engine_.prepare(is_motion ? clearance::as_motions(query) : clearance::as_check(query)));
  }
  const clearance::Result result = prepared->run({rows.positions, rows.poses});
  const std::lock_guard lock(plan.mutex);
  idle.push_back(std::move(*prepared));
  return result;
}

}  // namespace clearance_moveit
