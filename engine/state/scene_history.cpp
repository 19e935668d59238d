#include "engine/state/scene_history.h"

#include <algorithm>
#include <cassert>

#include "engine/state/ignored_pairs.h"

namespace clearance {
namespace {

/// Limit on changed pairs times group pairs compared for one query; beyond it the scene counts as changed.
constexpr std::uint64_t kMostComparisons = std::uint64_t{1} << 22;

std::uint64_t at(const std::vector<std::uint64_t>& changes, std::uint32_t id) {
  return id < changes.size() ? changes[id] : 0;
}
void mark(std::vector<std::uint64_t>& changes, std::uint32_t id, std::uint64_t change) {
  if (id >= changes.size()) changes.resize(id + 1);
  changes[id] = change;
}

/// Returns whether a body or group has the same name in two scenes.
template <class T>
bool same_name(const std::vector<T>& was, const std::vector<T>& is, std::uint32_t id) {
  return id < was.size() && id < is.size() && was[id].name == is[id].name;
}

/// Returns whether the same joints place a body in the same way: no joints, or those of the same robot.
bool same_joints(const engine::Scene& old_scene, const engine::Scene& scene, std::uint32_t id) {
  const std::uint32_t was = old_scene.bodies()[id].robot, is = scene.bodies()[id].robot;
  if (was == kNone || is == kNone) return was == is;
  return old_scene.robots()[was]->digest == scene.robots()[is]->digest;
}

/// Returns whether a body id has the same meaning in two scenes. An id beyond both is unknown in both.
bool same_body(const engine::Scene& old_scene, const engine::Scene& scene, std::uint32_t id) {
  const std::vector<Body>&was = old_scene.bodies(), &is = scene.bodies();
  if (id >= was.size() || id >= is.size()) return id >= was.size() && id >= is.size();
  return was[id].name == is[id].name && was[id].parts == is[id].parts && was[id].is_static == is[id].is_static &&
         same_joints(old_scene, scene, id);
}

bool names(std::uint32_t selector, std::uint32_t body, const engine::Scene& scene) {
  if (selector == kEveryBody) return true;
  if (!(selector & kGroupBit)) return selector == body;
  const std::uint32_t group = selector & ~kGroupBit;
  if (group >= scene.groups().size()) return false;
  const std::vector<std::uint32_t>& members = scene.groups()[group].bodies;
  return std::binary_search(members.begin(), members.end(), body);
}

}  // namespace

void SceneHistory::begin_change(std::uint64_t revision) {
  seen_[revision] = changes_;
  order_.emplace_back(revision, changes_);
  ++changes_;
}

void SceneHistory::forget_old() {
  while (order_.size() > kMostRecords || pairs_.size() > kMostRecords) {
    const auto [revision, change] = order_.front();
    order_.pop_front();
    const auto seen = seen_.find(revision);
    if (seen != seen_.end() && seen->second == change) seen_.erase(seen);
    forgotten_ = change + 1;
    while (!pairs_.empty() && pairs_.front().change <= forgotten_) pairs_.pop_front();
  }
}

void SceneHistory::note(std::span<const BodyPair> changed) {
  for (const BodyPair pair : changed) pairs_.push_back({changes_, pair.a, pair.b});
}

void SceneHistory::ignored(std::uint64_t revision, std::span<const BodyPair> pairs) {
  const std::lock_guard lock(mutex_);
  begin_change(revision);
  note(pairs);
  forget_old();
}

void SceneHistory::attached(std::uint64_t revision, std::uint32_t child, std::uint32_t was, std::uint32_t is,
                            std::span<const BodyPair> ignored) {
  const std::lock_guard lock(mutex_);
  assert(was != is);
  begin_change(revision);
  mark(parent_changed_, child, changes_);
  for (const std::uint32_t parent : {was, is})
    if (parent != kNone) pairs_.push_back({changes_, std::min(child, parent), std::max(child, parent)});
  note(ignored);
  forget_old();
}

void SceneHistory::replaced(const SceneHistory& old, std::uint64_t old_revision, const State& before,
                            const State& after) {
  const auto& [old_scene, old_parents, old_ignored] = before;
  const auto& [scene, parents, ignored] = after;
  assert(old_parents.size() == old_scene.bodies().size() && parents.size() == scene.bodies().size());
  const std::scoped_lock lock(mutex_, old.mutex_);
  changes_ = old.changes_;
  seen_ = old.seen_;
  order_ = old.order_;
  body_changed_ = old.body_changed_;
  parent_changed_ = old.parent_changed_;
  group_changed_ = old.group_changed_;
  body_renamed_ = old.body_renamed_;
  group_renamed_ = old.group_renamed_;
  bodies_changed_ = old.bodies_changed_;
  pairs_ = old.pairs_;
  forgotten_ = old.forgotten_;
  begin_change(old_revision);

  const std::size_t most = std::max(old_parents.size(), parents.size());
  for (std::uint32_t id = 0; id < most; ++id) {
    if (!same_name(old_scene.bodies(), scene.bodies(), id)) mark(body_renamed_, id, changes_);
    if (!same_body(old_scene, scene, id)) {
      mark(body_changed_, id, changes_);
      bodies_changed_ = changes_;
    } else if (old_parents[id] != parents[id]) {
      mark(parent_changed_, id, changes_);
      for (const std::uint32_t parent : {old_parents[id], parents[id]})
        if (parent != kNone) pairs_.push_back({changes_, std::min(id, parent), std::max(id, parent)});
    }
  }
  const std::vector<Group>&was = old_scene.groups(), &is = scene.groups();
  const auto mark_groups = [&](std::vector<std::uint64_t>& groups, const std::vector<std::uint64_t>& of_bodies) {
    for (std::uint32_t g = 0; g < std::max(was.size(), is.size()); ++g)
      if (!same_name(was, is, g) || was[g].bodies != is[g].bodies ||
          std::ranges::any_of(is[g].bodies, [&](std::uint32_t id) { return at(of_bodies, id) == changes_; }))
        mark(groups, g, changes_);
  };
  mark_groups(group_changed_, body_changed_);
  mark_groups(group_renamed_, body_renamed_);
  note(changed_pairs(old_ignored, ignored));
  forget_old();
}

std::uint64_t SceneHistory::changes() const {
  const std::lock_guard lock(mutex_);
  return changes_;
}

bool SceneHistory::find(std::uint64_t revision, std::uint64_t changes, std::uint64_t& since) const {
  const auto seen = seen_.find(revision);
  if (changes != changes_ || seen == seen_.end() || seen->second < forgotten_) return false;
  since = seen->second;
  return true;
}

bool SceneHistory::unchanged(std::uint32_t selector, std::uint64_t since, bool with_parents) const {
  if (selector == kEveryBody) return bodies_changed_ <= since;
  if (selector & kGroupBit) return at(group_changed_, selector & ~kGroupBit) <= since;
  return at(body_changed_, selector) <= since && (!with_parents || at(parent_changed_, selector) <= since);
}

bool SceneHistory::pairs_unchanged(BodyPair pair, std::uint64_t since, const engine::Scene& scene) const {
  return std::none_of(pairs_.rbegin(), pairs_.rend(), [&](const ChangedPair& changed) {
    return changed.change > since && ((names(pair.a, changed.a, scene) && names(pair.b, changed.b, scene)) ||
                                      (names(pair.a, changed.b, scene) && names(pair.b, changed.a, scene)));
  });
}

bool SceneHistory::ids_valid_since(std::uint64_t revision, std::uint64_t changes,
                                   std::span<const std::uint32_t> selectors, bool with_parents) const {
  const std::lock_guard lock(mutex_);
  std::uint64_t since = 0;
  return find(revision, changes, since) && std::all_of(selectors.begin(), selectors.end(), [&](std::uint32_t selector) {
           return unchanged(selector, since, with_parents);
         });
}

bool SceneHistory::names_valid_since(std::uint64_t revision, std::span<const std::uint32_t> selectors,
                                     bool with_parents) const {
  const std::lock_guard lock(mutex_);
  std::uint64_t since = 0;
  return find(revision, changes_, since) && std::ranges::all_of(selectors, [&](std::uint32_t selector) {
           if (selector == kEveryBody) return true;
           if (selector & kGroupBit) return at(group_renamed_, selector & ~kGroupBit) <= since;
           return at(body_renamed_, selector) <= since && (!with_parents || at(parent_changed_, selector) <= since);
         });
}

bool SceneHistory::ids_valid_since(const RevisionCheck& check, std::uint64_t changes,
                                   const engine::Scene& scene) const {
  const std::lock_guard lock(mutex_);
  std::uint64_t since = 0, of_groups = 0;
  if (!find(check.revision, changes, since)) return false;
  if (check.a_row_for_each_body && bodies_changed_ > since) return false;
  for (const std::uint32_t body : check.bodies)
    if (!unchanged(body, since, true)) return false;
  for (const MarginEntry& entry : check.margins)
    for (const std::uint32_t selector : {entry.a, entry.b})
      if (selector != kEveryBody && !unchanged(selector, since, false)) return false;
  for (const BodyPair pair : check.pairs) {
    if (!unchanged(pair.a, since, false) || !unchanged(pair.b, since, false)) return false;
    if (!((pair.a | pair.b) & kGroupBit)) continue;
    of_groups += pairs_.size();
    if (of_groups > kMostComparisons || !pairs_unchanged(pair, since, scene)) return false;
  }
  return true;
}

}  // namespace clearance
