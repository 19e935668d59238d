#include "engine/device/query/device_uncertainty.h"

#include <algorithm>
#include <cassert>

namespace clearance::cuda {

namespace {

// The body of the query's pairs with the least id that satisfies `is_so`.
template <class IsSo>
std::uint32_t first_body(const engine::Scene& scene, const Plan& plan, const IsSo& is_so) {
  std::uint32_t found = kNone;
  const auto add = [&](std::uint32_t body) {
    if (body < scene.bodies().size() && body < found && is_so(body)) found = body;
  };
  if (plan.pairs.is_whole_table())
    for (std::uint32_t b = 0; b < scene.bodies().size(); ++b) add(b);
  else
    for (const auto [a, b] : plan.pairs.list()) add(a), add(b);
  return found;
}

}  // namespace

std::uint32_t uncertain_body(const engine::Scene& scene, const Plan& plan) {
  const PoseSnapshot& snapshot = *plan.snapshot;
  if (!scene.has_uncertainties() && !snapshot.has_followers) return kNone;
  return first_body(scene, plan, [&](std::uint32_t body) {
    return has_uncertainty(scene.bodies()[body]) || snapshot.parent[body] != kNone;
  });
}

std::uint32_t ageing_body(const engine::Scene& scene, const Plan& plan) {
  if (!scene.has_uncertainties()) return kNone;
  return first_body(scene, plan, [&](std::uint32_t body) {
    for (; body != kNone; body = plan.snapshot->parent[body])
      if (!scene.bodies()[body].is_static && scene.bodies()[body].max_speed > 0) return true;
    return false;
  });
}

DeviceUncertainty::DeviceUncertainty(const engine::Scene& scene, const Plan& plan) {
  assert(plan.uncertainties.size() == scene.bodies().size());
  for (const PoseUncertainty& uncertainty : plan.uncertainties)
    fixed_.push_back({uncertainty.slack, uncertainty.relative, uncertainty.link.travel});
  take_links(scene);
  if (plan.query.configuration_count > 0) take_moved(scene, plan);
}

void DeviceUncertainty::take_links(const engine::Scene& scene) {
  std::vector<std::uint64_t> first;
  for (const auto& robot : scene.robots()) {
    const auto pairs = robot->errors.pairs();
    first.push_back(link_pairs_.size());
    link_pairs_.insert(link_pairs_.end(), pairs.begin(), pairs.end());
  }
  for (const Body& body : scene.bodies()) {
    LinkPlace place;
    const LinkErrors* const errors = body.robot == kNone ? nullptr : &scene.robots()[body.robot]->errors;
    if (errors && !errors->pairs().empty() && errors->slot(body.link) != kNone)
      place = {body.robot, errors->slot(body.link), first[body.robot]};
    links_.push_back(place);
  }
}

void DeviceUncertainty::take_moved(const engine::Scene& scene, const Plan& plan) {
  const PoseSnapshot& snapshot = *plan.snapshot;
  constexpr std::uint32_t kGiven = kNone - 1;                          // placed by the query, not by a joint
  std::vector<std::uint32_t> placed_by(scene.bodies().size(), kNone);  // kGiven, or the index of the motion
  for (std::size_t i = 0; i < plan.given_bodies; ++i) placed_by[plan.bodies[i]] = kGiven;
  std::size_t at = plan.given_bodies;
  for (std::uint32_t m = 0; m < plan.motions.size(); ++m)
    for (std::size_t i = 0; i < plan.motions[m].links().size(); ++i) placed_by[plan.bodies[at++]] = m;
  assert(at == plan.bodies.size());
  std::vector<std::uint8_t> is_moved(scene.bodies().size(), 0);
  for (const std::uint32_t body : plan.moved) is_moved[body] = 1;
  for (const std::uint32_t body : plan.moved) {
    UncertaintyStep move;
    move.source = uncertainty_source(scene.bodies()[body]);
    // Bodies placed by the query are up to date.
    move.age_s = placed_by[body] == kNone ? pose_age_s(snapshot, body, plan.begun_ns)
                                          : points_age_s(snapshot, body, plan.begun_ns);
    const PlacedLink& link = plan.uncertainties[body].link;
    if (link.errors) {
      const PlacementError& error = link.errors->origin(link.link);
      move.joint_fixed = error.fixed;
      move.joint_per_travel = error.per_travel;
      move.joint_turn = error.turn;
    }
    move.travel = link.travel;
    if (placed_by[body] != kGiven) move.robot = placed_by[body];
    moves_.push_back(move);
    std::uint32_t on = body;
    while (on != kNone && is_moved[on]) on = snapshot.parent[on];
    base_.push_back(on == kNone ? PlacedUncertainty() : PlacedUncertainty(plan.uncertainties[on]));
  }
}

UncertaintySetup DeviceUncertainty::setup() const {
  return {fixed_, links_, link_pairs_, moves_, base_};
}

}  // namespace clearance::cuda
