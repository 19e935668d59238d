#include "engine/cost/query_cost.h"

#include <algorithm>
#include <set>

#include "engine/bvh/surface.h"
#include "engine/narrow/work_meter.h"

namespace clearance {
namespace {

std::uint64_t times(std::uint64_t a, std::uint64_t b) {
  std::uint64_t product;
  return __builtin_mul_overflow(a, b, &product) ? ~std::uint64_t{0} : product;
}

std::uint64_t plus(std::uint64_t a, std::uint64_t b) {
  std::uint64_t sum;
  return __builtin_add_overflow(a, b, &sum) ? ~std::uint64_t{0} : sum;
}

// Estimated work of a search in a surface: more per triangle than a well pruned tree needs, so that a query of large
// meshes counts as large.
std::uint64_t units_of(const Body& body, const Surface* surface) {
  constexpr std::uint64_t kOfASearch = 64, kElementsPerUnit = 64,
                          kOfACloud = 100'000;  // a constant, since points change
  if (is_cloud(body)) return kOfASearch + kOfACloud / kElementsPerUnit;
  return surface ? kOfASearch + surface->size() / kElementsPerUnit : 0;
}

}  // namespace

void SceneCost::SelectorCost::add(const SelectorCost& other) {
  bodies += other.bodies;
  parts += other.parts;
  units += other.units;
}

SceneCost::SceneCost(const engine::Scene& scene) : scene_(&scene) {
  for (const Body& body : scene.bodies()) {
    SelectorCost& side = bodies_.emplace_back(SelectorCost{1, body.parts.size(), 0});
    for (const ConvexPartPtr& part : body.parts)
      side.units += WorkMeter::units_of(*part) + units_of(body, part->surface.get());
    all_.add(side);
  }
  for (const Group& group : scene.groups()) {
    SelectorCost& side = groups_.emplace_back();
    for (const std::uint32_t body : group.bodies) side.add(bodies_[body]);
  }
}

SceneCost::SelectorCost SceneCost::side(std::uint32_t selector) const {
  if (selector == kEveryBody) return all_;
  const bool is_group = selector & kGroupBit;
  const std::vector<SelectorCost>& known = is_group ? groups_ : bodies_;
  const std::uint32_t at = is_group ? selector & ~kGroupBit : selector;
  return at < known.size() ? known[at] : SelectorCost{1, 0, 0};
}

/// \param are_same both sides are the same bodies, so that each pair counts once
void SceneCost::add_pairs(QueryCost& cost, const SelectorCost& a, const SelectorCost& b, bool are_same) {
  const std::uint64_t ordered = times(a.bodies, b.bodies);
  cost.pairs = plus(cost.pairs, are_same ? (ordered - a.bodies) / 2 : ordered);
  cost.part_pairs = plus(cost.part_pairs, times(a.parts, b.parts));
  cost.units = plus(cost.units, plus(times(a.units, b.parts), times(b.units, a.parts)));
}

QueryCost SceneCost::of(const QueryView& query, const PoseSnapshot& snapshot) const {
  QueryCost cost;
  std::set<std::shared_ptr<const SceneRobot>> robots;
  for (const std::uint32_t joint : query.joints)
    if (joint < scene_->joints().size()) robots.insert(scene_->robots()[scene_->joints()[joint].robot]);
  for (const auto& robot : robots) cost.links += robot->bodies.size();
  const bool moves = !query.bodies.empty() || !query.joints.empty();
  if (!query.all_pairs) {
    for (const BodyPair pair : query.pairs) {
      const SelectorCost a = side(pair.a), b = side(pair.b);
      add_pairs(cost, a, b, pair.a == pair.b && a.bodies > 1);
    }
    cost.listed = cost.pairs;
  } else {
    SelectorCost moved;
    std::vector<std::uint32_t> known;
    for (const std::uint32_t body : query.bodies)
      if (body < bodies_.size()) known.push_back(body);
    for (const auto& robot : robots)
      for (const std::uint32_t body : robot->bodies) known.push_back(body);
    if (!known.empty())
      for (const std::uint32_t body : snapshot.with_followers(known)) moved.add(bodies_[body]);
    add_pairs(cost, moves ? moved : all_, all_);
    cost.pairs = std::min(cost.pairs, snapshot.pairs->size());
    cost.listed = moves ? cost.pairs : 0;
  }
  for (const MarginEntry& entry : query.margins)
    cost.listed = plus(cost.listed, plus(side(entry.a).bodies, side(entry.b).bodies));
  std::uint64_t configurations = std::max<std::uint64_t>(query.configuration_count, 1);
  if (query.max_evaluations > 0)
    configurations = times(configurations / std::max(query.control_points, 2u), query.max_evaluations);
  return {times(cost.pairs, configurations), times(cost.part_pairs, configurations), times(cost.units, configurations),
          times(cost.links, configurations), cost.listed};
}

}  // namespace clearance
