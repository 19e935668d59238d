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
  moved_.resize(plan.moved.size());
  std::size_t parts = 0;
  for (std::size_t i = 0; i < moved_.size(); ++i) {
    const std::uint32_t b = plan.moved[i];
    moved_slot_[b] = static_cast<std::uint32_t>(i);
    Moved& moved = moved_[i];
    moved.local = plan.snapshot->local[b];
    moved.facts = static_cast<std::uint8_t>((plan.snapshot->given[b] ? 0 : kLinkUnplaced) |
                                            (plan.snapshot->beyond_limits[b] ? kLinkBeyondLimits : 0));
    moved.first_part = static_cast<std::uint32_t>(parts);
    if (!plan.uncertainties.empty()) moved.travel = plan.uncertainties[b].link.travel;
    parts += scene.bodies()[b].parts.size();
  }
  for (std::size_t m = 0; m < plan.bodies.size(); ++m)
    moved_[moved_slot_[plan.bodies[m]]].given = static_cast<std::uint32_t>(m);
  if (!boxes.empty()) part_boxes_.resize(parts);
}

void BodyPoses::configure(std::uint64_t k, const ConfigurationPoses::PoseBlock& given,
                          std::span<const Mat3d> rotations) {
  if (is_at(k)) return;
  assert(rotations.size() == plan_.bodies.size());
  number_ = plan_.number(k);
  is_whole_ = true;
  errors_ = given.errors;
  for (std::size_t i = 0; i < moved_.size(); ++i)
    place_moved(i, given, moved_[i].given == kNone ? nullptr : &rotations[moved_[i].given]);
}

void BodyPoses::select(std::span<const std::uint64_t> pairs, std::vector<std::uint32_t>& slots) const {
  const auto begin = static_cast<std::ptrdiff_t>(slots.size());
  for (const std::uint64_t p : pairs) {
    const BodyPair pair = plan_.pairs.at(p);
    for (std::uint32_t body : {pair.a, pair.b})
      for (; body < moved_slot_.size() && moves(body); body = plan_.snapshot->parent[body])
        slots.push_back(moved_slot_[body]);
  }
  std::sort(slots.begin() + begin, slots.end());
  slots.erase(std::unique(slots.begin() + begin, slots.end()), slots.end());
}

void BodyPoses::configure(std::uint64_t k, const ConfigurationPoses::PoseBlock& given,
                          std::span<const std::uint32_t> slots, std::span<const Mat3d> rotations) {
  assert(rotations.size() == slots.size());
  number_ = plan_.number(k);
  is_whole_ = false;
  errors_ = given.errors;
  for (std::size_t i = 0; i < slots.size(); ++i)
    place_moved(slots[i], given, moved_[slots[i]].given == kNone ? nullptr : &rotations[i]);
}

// Places a moved body, after the one that carries it.
// \param rotation of its pose, if that is given
void BodyPoses::place_moved(std::size_t i, const ConfigurationPoses::PoseBlock& given, const Mat3d* rotation) {
  assert(given.poses.size() == plan_.bodies.size() &&
         (given.facts.empty() || given.facts.size() == given.poses.size()));
  Moved& moved = moved_[i];
  if (const std::uint32_t m = moved.given; m != kNone) {
    moved.local = given.poses[m];
    moved.facts = given.facts.empty() ? 0 : given.facts[m];
    if (!given.travels.empty()) moved.travel = given.travels[m];
  }
  const PoseSnapshot& snapshot = *plan_.snapshot;
  const std::uint32_t number = plan_.moved[i], parent = snapshot.parent[number];
  const Body& body = scene_.bodies()[number];
  const BodyPlacement* const on = parent == kNone ? nullptr : &(*this)[parent];
  const bool is_unplaced = (moved.facts & kLinkUnplaced) || body.cloud == CloudState::kAwaited;
  moved.placement = place(is_unplaced ? nullptr : &moved.local, on, rotation);
  moved.placement.beyond_limits |= (moved.facts & kLinkBeyondLimits) != 0;
  if (moved.placement.status == Status::kOk && snapshot.placed[number].status == Status::kStalePose)
    moved.placement.status = Status::kStalePose;  // through a joint that the query does not move
  if (!plan_.uncertainties.empty() && moved.placement.status == Status::kOk) {
    // Bodies that the query places are there now.
    const double age_s =
        rotation ? points_age_s(snapshot, number, plan_.begun_ns) : pose_age_s(snapshot, number, plan_.begun_ns);
    PlacedLink link = plan_.uncertainties[number].link;
    link.travel = moved.travel;
    moved.uncertainty = uncertainty_of(body, moved.local, moved.placement.pose.t_w, age_s,
                                       parent == kNone ? nullptr : &uncertainty(parent), on && is_composed(*on), link);
  }
  if (boxes_.empty()) return;
  Aabb* const parts = part_boxes_.data() + moved.first_part;
  moved.box = body_box(body, moved.placement, slack(number), [&](std::size_t p, const Aabb& box) { parts[p] = box; });
}

Aabb BodyPoses::box(std::uint32_t body) const {
  if (boxes_.empty()) return body_box(scene_.bodies()[body], (*this)[body], slack(body));
  return moved_slot_.empty() || moved_slot_[body] == kNone ? boxes_[body] : moved_[moved_slot_[body]].box;
}

}  // namespace clearance
