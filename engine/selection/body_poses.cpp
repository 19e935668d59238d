#include "engine/selection/body_poses.h"

#include <algorithm>
#include <cassert>
#include <limits>

#include "engine/hull/box.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kMostConvexParts =
    8192;  // limit on the parts of moved bodies in all configurations of a worker

// \param each receives the box of each part of a body with a usable pose
template <class Each>
Aabb body_box(const Body& body, const BodyPlacement& placement, const Slack& slack, const Each& each) {
  Aabb box = kEmptyBox;
  if (placement.status != Status::kOk || body.cloud == CloudState::kEmpty) return box;
  for (std::size_t i = 0; i < body.parts.size(); ++i) {
    const Aabb part = certify_box(*body.parts[i], placement.pose.R_wb, placement.pose.t_w);
    box = joined(box, part);
    each(i, part);
  }
  return grown(box, slack.inner);
}

}  // namespace

Aabb body_box(const Body& body, const BodyPlacement& placement, const Slack& slack) {
  return body_box(body, placement, slack, [](std::size_t, const Aabb&) {});
}

double joints_between(const PoseUncertainty& a, const PoseUncertainty& b) {
  const LinkErrors* const robot = a.link.errors == b.link.errors ? a.link.errors : nullptr;
  return robot ? robot->between(a.link.link, b.link.link, std::max(a.link.travel, b.link.travel)) : kInf;
}

Slack pair_slack(const PoseUncertainty& a, const PoseUncertainty& b, const Slack& chain_a, const Slack& chain_b) {
  if (const double joints = joints_between(a, b); joints < kInf)
    return slack_between_links(a.relative + chain_a, b.relative + chain_b, joints);
  return (a.slack + chain_a) + (b.slack + chain_b);
}

Slack pair_slack(const BodyPoses& placement, BodyPair pair) {
  const Slack chain_a = placement.chain_slack(pair.a), chain_b = placement.chain_slack(pair.b);
  if (!placement.has_uncertainties()) return chain_a + chain_b;
  return pair_slack(placement.uncertainty(pair.a), placement.uncertainty(pair.b), chain_a, chain_b);
}

std::uint64_t BodyPoses::most(const engine::Scene& scene, const Plan& plan) {
  std::uint64_t parts = 1;
  for (const std::uint32_t b : plan.moved) parts += scene.bodies()[b].parts.size();
  return std::max<std::uint64_t>(kMostConvexParts / parts, 1);
}

BodyPoses::BodyPoses(const engine::Scene& scene, const Plan& plan, std::span<const Aabb> boxes)
    : scene_(scene), plan_(plan), boxes_(boxes) {
  if (plan.query.configuration_count == 0) return;
  moved_slot_.assign(scene.bodies().size(), kNone);
  std::size_t parts = 0;
  for (const std::uint32_t b : plan.moved) {
    moved_slot_[b] = static_cast<std::uint32_t>(local_.size());
    local_.push_back(plan.snapshot->local[b]);
    facts_.push_back((plan.snapshot->given[b] ? 0 : kLinkUnplaced) |
                     (plan.snapshot->beyond_limits[b] ? kLinkBeyondLimits : 0));
    first_part_.push_back(static_cast<std::uint32_t>(parts));
    parts += scene.bodies()[b].parts.size();
  }
  for (const std::uint32_t b : plan.moved)
    travels_.push_back(plan.uncertainties.empty() ? 0 : plan.uncertainties[b].link.travel);
  moved_.resize(local_.size());
  given_.resize(local_.size(), kNone);
  for (std::size_t m = 0; m < plan.bodies.size(); ++m)
    given_[moved_slot_[plan.bodies[m]]] = static_cast<std::uint32_t>(m);
  moved_boxes_.resize(local_.size());
  if (!plan.uncertainties.empty()) moved_uncertainties_.resize(local_.size());
  if (!boxes.empty()) part_boxes_.resize(parts);
}

void BodyPoses::configure(std::uint64_t k, const ConfigurationPoses::PoseBlock& given,
                          std::span<const Mat3d> rotations) {
  if (is_at(k)) return;
  assert(rotations.size() == plan_.bodies.size());
  number_ = plan_.number(k);
  is_whole_ = true;
  errors_ = given.errors;
  for (std::size_t i = 0; i < plan_.moved.size(); ++i)
    place_moved(i, given, given_[i] == kNone ? nullptr : &rotations[given_[i]]);
}

void BodyPoses::configure(std::uint64_t k, const ConfigurationPoses::PoseBlock& given,
                          std::span<const std::uint64_t> pairs) {
  if (is_at(k)) return;
  number_ = plan_.number(k);
  is_whole_ = false;
  errors_ = given.errors;
  is_wanted_.assign(plan_.moved.size(), 0);
  for (const std::uint64_t p : pairs) {
    const BodyPair pair = plan_.pairs.at(p);
    want(pair.a);
    want(pair.b);
  }
  for (std::size_t i = 0; i < plan_.moved.size(); ++i) {
    if (!is_wanted_[i]) continue;
    Mat3d rotation;
    if (given_[i] != kNone) rotation = rotation_of(given.poses[given_[i]]);
    place_moved(i, given, given_[i] == kNone ? nullptr : &rotation);
  }
}

// Marks a body and those that carry it.
void BodyPoses::want(std::uint32_t body) {
  for (; body < moved_slot_.size() && moved_slot_[body] != kNone && !is_wanted_[moved_slot_[body]];
       body = plan_.snapshot->parent[body])
    is_wanted_[moved_slot_[body]] = 1;
}

// Places a moved body, after the one that carries it.
// \param rotation of its pose, if that is given
void BodyPoses::place_moved(std::size_t i, const ConfigurationPoses::PoseBlock& given, const Mat3d* rotation) {
  assert(given.poses.size() == plan_.bodies.size() &&
         (given.facts.empty() || given.facts.size() == given.poses.size()));
  if (const std::uint32_t m = given_[i]; m != kNone) {
    local_[i] = given.poses[m];
    facts_[i] = given.facts.empty() ? 0 : given.facts[m];
    if (!given.travels.empty()) travels_[i] = given.travels[m];
  }
  const PoseSnapshot& snapshot = *plan_.snapshot;
  const std::uint32_t body = plan_.moved[i], parent = snapshot.parent[body];
  const BodyPlacement* const on = parent == kNone ? nullptr : &(*this)[parent];
  const bool is_unplaced = (facts_[i] & kLinkUnplaced) || scene_.bodies()[body].cloud == CloudState::kAwaited;
  moved_[i] = place(is_unplaced ? nullptr : &local_[i], on, rotation);
  moved_[i].beyond_limits |= (facts_[i] & kLinkBeyondLimits) != 0;
  if (moved_[i].status == Status::kOk && snapshot.placed[body].status == Status::kStalePose)
    moved_[i].status = Status::kStalePose;  // through a joint that the query does not move
  if (!moved_uncertainties_.empty() && moved_[i].status == Status::kOk) {
    // Bodies that the query places are there now.
    const double age_s =
        rotation ? points_age_s(snapshot, body, plan_.begun_ns) : pose_age_s(snapshot, body, plan_.begun_ns);
    PlacedLink link = plan_.uncertainties[body].link;
    link.travel = travels_[i];
    moved_uncertainties_[i] =
        uncertainty_of(scene_.bodies()[body], local_[i], moved_[i].pose.t_w, age_s,
                       parent == kNone ? nullptr : &uncertainty(parent), on && is_composed(*on), link);
  }
  if (boxes_.empty()) return;
  Aabb* const parts = part_boxes_.data() + first_part_[i];
  moved_boxes_[i] =
      body_box(scene_.bodies()[body], moved_[i], slack(body), [&](std::size_t p, const Aabb& box) { parts[p] = box; });
}

Aabb BodyPoses::box(std::uint32_t body) const {
  if (boxes_.empty()) return body_box(scene_.bodies()[body], (*this)[body], slack(body));
  return moved_slot_.empty() || moved_slot_[body] == kNone ? boxes_[body] : moved_boxes_[moved_slot_[body]];
}

}  // namespace clearance
