// The part of the pose store that takes over the state of another one, whose scene this one replaces.
#include <algorithm>
#include <utility>

#include "engine/state/pose_store.h"

namespace clearance {

// Takes over the received poses and attachments of bodies with the same names. Returns the new id of each old body.
std::vector<std::uint32_t> PoseStore::take_over_poses(const PoseStore& old_store, PoseSnapshot& next) {
  const PoseSnapshot& old = *old_store.current_;
  const std::vector<Body>&bodies = scene_.bodies(), &old_bodies = old_store.scene_.bodies();
  std::vector<std::uint32_t> ids(old_bodies.size(), kNone), received;
  const auto leader_of = [&](std::uint32_t was) { return old.parent[was] == kNone ? kNone : ids[old.parent[was]]; };
  const auto follows = [&](std::uint32_t body, std::uint32_t leader) {
    for (std::uint32_t b = body; b != kNone; b = next.parent[b])
      if (b == leader) return true;
    return false;
  };
  for (std::uint32_t was = 0; was < old_bodies.size(); ++was) {
    const std::uint32_t now = ids[was] = scene_.find_body(old_bodies[was].name);
    if (now == kNone) continue;
    marks_.take_over(now, old_store.marks_, was);
    points_marks_.take_over(now, old_store.points_marks_, was);
    if (!bodies[now].is_static && bodies[now].robot == kNone && old.receipt_ns[was] != 0) received.push_back(was);
  }
  // A body whose leader is gone keeps the scene's pose, as its own has no frame.
  std::erase_if(received, [&](std::uint32_t was) { return old.parent[was] != kNone && leader_of(was) == kNone; });
  for (const std::uint32_t was : received) next.parent[ids[was]] = kNone;  // an exchange of leaders is no cycle
  for (const std::uint32_t was : received) {
    const std::uint32_t now = ids[was], leader = leader_of(was), loaded = bodies[now].parent;
    if (leader != kNone && follows(leader, now)) {
      const bool may_follow = loaded == kNone || !follows(loaded, now);
      next.parent[now] = may_follow ? loaded : kNone;
      next.given[now] &= may_follow;
      continue;
    }
    next.parent[now] = leader;
    next.local[now] = old.local[was];
    next.given[now] = old.given[was];
    next.velocity[now] = old.velocity[was];
    next.stamp_ns[now] = old.stamp_ns[was];
    next.receipt_ns[now] = old.receipt_ns[was];
    next.sequence[now] = old.sequence[was];
  }
  return ids;
}

void PoseStore::take_over(const PoseStore& old_store, std::string_view reshaped) {
  const std::scoped_lock lock(writers_, old_store.writers_);
  const PoseSnapshot& old = *old_store.current_;  // safe to read: the old store's writers are locked out
  out_of_range_ += old_store.out_of_range_;
  late_ += old_store.late_;
  const std::shared_ptr<PoseSnapshot> next = copy();
  const std::vector<std::uint32_t> ids = take_over_poses(old_store, *next);
  std::vector<std::uint8_t> keeps(scene_.bodies().size(), 0);  // attached, as before
  for (std::uint32_t was = 0; was < ids.size(); ++was)
    if (ids[was] != kNone && old.parent[was] != kNone)
      keeps[ids[was]] = next->receipt_ns[ids[was]] != 0 && next->parent[ids[was]] == ids[old.parent[was]];
  changes_.clear();
  take_over_joints(old_store, *next);
  take_over_points(old_store, *next, reshaped);
  IgnoredPairs ignored(scene_);
  ignored.take_over(*old.ignored, old_store.scene_, ids, keeps, scene_);
  next->ignored = std::make_shared<const IgnoredPairs>(std::move(ignored));
  history_->replaced(*old_store.history_, old.scene_revision, {old_store.scene_, old.parent, old.ignored->all()},
                     {scene_, next->parent, next->ignored->all()});
  enable_pairs(*next);
  next->place_again(*next->order);
  next->revision = old.revision + 1;
  publish(next);
}

}  // namespace clearance
