// The part of the pose store that changes parents and ignored pairs.
#include <algorithm>
#include <cassert>
#include <string>
#include <utility>

#include "engine/state/pose_store.h"

namespace clearance {

namespace {

// Orders bodies so that parents precede children. The parents must be free of cycles.
std::shared_ptr<const std::vector<std::uint32_t>> order_of(const std::vector<std::uint32_t>& parent) {
  auto order = std::make_shared<std::vector<std::uint32_t>>();
  order->reserve(parent.size());
  std::vector<std::uint8_t> done(parent.size(), 0);
  std::vector<std::uint32_t> chain;
  for (std::uint32_t b = 0; b < parent.size(); ++b) {
    for (std::uint32_t p = b; p != kNone && !done[p]; p = parent[p]) chain.push_back(p);
    for (; !chain.empty(); chain.pop_back()) {
      done[chain.back()] = 1;
      order->push_back(chain.back());
    }
  }
  assert(order->size() == parent.size());
  return order;
}

// Attachments and ignored pairs are part of the revision, because they change the enabled pairs.
std::uint64_t revision_with(const engine::Scene& scene, const std::vector<std::uint32_t>& parent,
                            std::span<const BodyPair> ignored) {
  std::uint64_t h = scene.revision();
  bool as_loaded = true;
  for (std::uint32_t b = 0; b < parent.size(); ++b) {
    as_loaded &= parent[b] == scene.bodies()[b].parent;
    h = (h ^ (parent[b] + 0x9E3779B97F4A7C15ull * (b + 1))) * 0xFF51AFD7ED558CCDull;
    h ^= h >> 32;
  }
  const std::vector<BodyPair> loaded = IgnoredPairs(scene).all();
  for (const BodyPair pair : changed_pairs(loaded, ignored)) {
    as_loaded = false;
    h = (h ^ (std::uint64_t{pair.a} << 32 | pair.b)) * 0xC4CEB9FE1A85EC53ull;
    h ^= h >> 29;
  }
  return as_loaded ? scene.revision() : (h ? h : 1);
}

[[noreturn]] void reject_attachment(const std::string& why) {
  throw engine::QueryError(QueryErrorCode::kBadQuery, "attach: " + why);
}

void check_attachment(const std::vector<Body>& bodies, const PoseSnapshot& snapshot, std::uint32_t child,
                      std::uint32_t parent, const Pose* X_pc) {
  if (child >= bodies.size()) reject_attachment("unknown child, body " + std::to_string(child));
  if (parent != kNone && parent >= bodies.size()) reject_attachment("unknown parent, body " + std::to_string(parent));
  if (bodies[child].is_static) reject_attachment("'" + bodies[child].name + "' is static");
  if (bodies[child].robot != kNone) reject_attachment(placed_by_joints(bodies[child]));
  for (std::uint32_t b = parent; b != kNone; b = snapshot.parent[b])
    if (b == child)
      reject_attachment("'" + bodies[child].name + "' would follow itself through '" + bodies[parent].name + "'");
  if (X_pc && check(*X_pc) == PoseQuality::kBad)
    reject_attachment("the pose of '" + bodies[child].name + "' is not usable");
}

// The pose that keeps a body in its place under a new parent.
Pose present_pose(const std::vector<Body>& bodies, const PoseSnapshot& snapshot, std::uint32_t child,
                  std::uint32_t parent) {
  for (const std::uint32_t b : {child, parent})
    if (b != kNone && snapshot.placed[b].status != Status::kOk)
      reject_attachment("'" + bodies[b].name + "' has no usable pose");
  const Pose X_wc = snapshot.placed[child].pose.X_wb;
  return parent == kNone ? X_wc : compose(inverse(snapshot.placed[parent].pose.X_wb), X_wc);
}

}  // namespace

void PoseStore::enable_pairs(PoseSnapshot& snapshot) const {
  snapshot.order = order_of(snapshot.parent);
  snapshot.has_followers =
      std::any_of(snapshot.parent.begin(), snapshot.parent.end(), [](std::uint32_t parent) { return parent != kNone; });
  snapshot.scene_revision = revision_with(scene_, snapshot.parent, snapshot.ignored->all());
  snapshot.pairs = std::make_shared<const PairTable>(scene_, snapshot.parent, snapshot.ignored->all());
  snapshot.scene_changes = history_->changes();
  snapshot.history = history_;
}

PoseUpdateResult PoseStore::attach(std::uint32_t child, std::uint32_t parent, const Pose* X_pc,
                                   std::span<const std::uint32_t> allow) {
  const auto lock = lock_for_update();
  const std::shared_ptr<PoseSnapshot> next = copy();
  const auto& bodies = scene_.bodies();
  check_attachment(bodies, *next, child, parent, X_pc);
  if (parent == kNone && !allow.empty()) reject_attachment("allow is only for a body with a parent");
  IgnoredPairs ignored = *next->ignored;
  ignored.release(child);
  ignored.allow_attached(child, allow, scene_);
  next->local[child] = X_pc ? *X_pc : present_pose(bodies, *next, child, parent);
  next->given[child] = 1;
  next->velocity[child] = parent == kNone ? kUnknownTwist : BodyTwist{};
  changes_.clear();  // followers and enabled pairs change
  const std::vector<BodyPair> changed = changed_pairs(next->ignored->all(), ignored.all());
  if (parent != next->parent[child])
    history_->attached(next->scene_revision, child, next->parent[child], parent, changed);
  else if (!changed.empty())
    history_->ignored(next->scene_revision, changed);
  next->ignored = std::make_shared<const IgnoredPairs>(std::move(ignored));
  next->parent[child] = parent;
  next->receipt_ns[child] = monotonic_ns();
  enable_pairs(*next);
  const std::uint32_t moved[] = {child};
  next->place_again(next->with_followers(moved));
  ++next->revision;
  PoseUpdateResult result;
  result.revision = next->revision;
  result.applied = 1;
  publish(next);
  return result;
}

PoseUpdateResult PoseStore::allow(std::uint32_t a, std::uint32_t b, bool allow) {
  const auto lock = lock_for_update();
  IgnoredPairs ignored = *snapshot()->ignored;
  allow ? ignored.allow(a, b, scene_) : ignored.forbid(a, b, scene_);
  const std::shared_ptr<PoseSnapshot> next = copy();
  const std::vector<BodyPair> changed = changed_pairs(next->ignored->all(), ignored.all());
  changes_.clear();  // the enabled pairs change
  // Even if no pair changes, the attachments that allow one may differ.
  next->ignored = std::make_shared<const IgnoredPairs>(std::move(ignored));
  if (!changed.empty()) {
    history_->ignored(next->scene_revision, changed);
    enable_pairs(*next);
  }
  ++next->revision;
  PoseUpdateResult result;
  result.revision = next->revision;
  result.applied = static_cast<std::uint32_t>(changed.size());
  publish(next);
  return result;
}

}  // namespace clearance
