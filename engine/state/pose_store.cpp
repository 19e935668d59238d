#include "engine/state/pose_store.h"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <string>
#include <tuple>
#include <utility>

namespace clearance {

std::int64_t monotonic_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

void PoseSnapshot::place_again(std::span<const std::uint32_t> bodies) {
  constexpr std::size_t kAtATime = 64;
  Pose poses[kAtATime];
  Mat3d rotations[kAtATime];
  assert(placed.size() == local.size() && parent.size() == local.size());
  const auto is_given = [&](std::uint32_t b) { return given[b] && scene->bodies()[b].cloud != CloudState::kAwaited; };
  for (std::size_t begin = 0; begin < bodies.size(); begin += kAtATime) {
    const auto part = bodies.subspan(begin, std::min(kAtATime, bodies.size() - begin));
    for (std::size_t i = 0; i < part.size(); ++i) poses[i] = local[part[i]];
    rotations_of(std::span(poses, part.size()), std::span(rotations, part.size()));
    for (std::size_t i = 0; i < part.size(); ++i) {
      const std::uint32_t b = part[i];
      placed[b] =
          place(is_given(b) ? &local[b] : nullptr, parent[b] == kNone ? nullptr : &placed[parent[b]], &rotations[i]);
      placed[b].beyond_limits |= beyond_limits[b] != 0;
    }
  }
}

std::int64_t PoseSnapshot::receipt_of_chain(std::uint32_t body) const {
  std::int64_t oldest = 0;
  const auto take_oldest = [&](std::int64_t receipt) {
    if (receipt != 0 && (oldest == 0 || receipt < oldest)) oldest = receipt;
  };
  for (std::uint32_t b = body; b != kNone; b = parent[b]) take_oldest(receipt_ns[b]);
  if (const ReceivedPoints* own = points_of(body)) take_oldest(own->receipt_ns);
  return oldest;
}

std::vector<std::uint32_t> PoseSnapshot::with_followers(std::span<const std::uint32_t> bodies) const {
  std::vector<std::uint8_t> moved(local.size(), 0);
  for (const std::uint32_t b : bodies) moved[b] = 1;
  std::vector<std::uint32_t> all;
  for (const std::uint32_t b : *order) {
    if (parent[b] != kNone && moved[parent[b]]) moved[b] = 1;
    if (moved[b]) all.push_back(b);
  }
  return all;
}

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

PoseStore::PoseStore(const engine::Scene& scene, std::chrono::nanoseconds max_stamp_lead)
    : scene_(scene),
      max_stamp_lead_(max_stamp_lead),
      marks_(scene.bodies().size()),
      joint_marks_(scene.joints().size()),
      points_marks_(scene.bodies().size()) {
  auto first = std::make_shared<PoseSnapshot>();
  first->scene =
      std::shared_ptr<const engine::Scene>(std::shared_ptr<const engine::Scene>(), &scene);  // outlives the snapshot
  const std::size_t n = scene.bodies().size();
  first->loaded_ns = monotonic_ns();
  first->local.resize(n);
  first->given.resize(n);
  first->placed.resize(n);
  first->stamp_ns.resize(n);
  first->receipt_ns.resize(n);
  first->sequence.resize(n);
  first->beyond_limits.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Body& body = scene.bodies()[i];
    first->parent.push_back(body.parent);
    first->local[i] = body.pose.value_or(Pose{});
    first->given[i] = body.pose.has_value() && !body.requires_pose;
  }
  const std::size_t joints = scene.joints().size();
  for (const SceneJoint& joint : scene.joints()) {
    first->joints.position.push_back(joint.home.value_or(0));
    first->joints.given.push_back(joint.home.has_value());
  }
  first->joints.stamp_ns.resize(joints);
  first->joints.receipt_ns.resize(joints);
  first->joints.sequence.resize(joints);
  for (const auto& robot : scene.robots()) first->move_links(*robot, {});
  first->ignored = std::make_shared<const IgnoredPairs>(scene);
  enable_pairs(*first);
  first->place_again(*first->order);
  publish(std::move(first));
}

std::shared_ptr<const PoseSnapshot> PoseStore::snapshot() const {
  const std::lock_guard lock(current_mutex_);
  return current_;
}

// Copies the current snapshot, into the memory of an unused one if possible.
std::shared_ptr<PoseSnapshot> PoseStore::copy() {
  std::unique_ptr<PoseSnapshot> next;
  {
    const std::lock_guard lock(spares_->mutex);
    if (!spares_->snapshots.empty()) {
      next = std::move(spares_->snapshots.back());
      spares_->snapshots.pop_back();
    }
  }
  const std::shared_ptr<const PoseSnapshot> current = snapshot();
  if (!next || !catch_up(*next, *current)) {
    if (!next) next = std::make_unique<PoseSnapshot>();
    *next = *current;
    PoseSnapshot::for_each_column([&](auto column) { copied_bytes_ += std::span(*current.*column).size_bytes(); });
  }
  next->is_published = false;
  return {next.release(), [spares = spares_](PoseSnapshot* done) {
            std::unique_ptr<PoseSnapshot> snapshot(done);
            snapshot->scene = nullptr;  // its points may be large
            snapshot->points = nullptr;
            const std::lock_guard lock(spares->mutex);
            if (spares->snapshots.size() < kSpares) spares->snapshots.push_back(std::move(snapshot));
          }};
}

// Brings an older snapshot up to date if the changed bodies are recorded; in a large scene most are unchanged.
bool PoseStore::catch_up(PoseSnapshot& old, const PoseSnapshot& current) {
  const std::uint64_t behind = current.revision - old.revision;
  if (!old.is_published || behind > changes_.size()) return false;
  for (auto changed = changes_.end() - static_cast<std::ptrdiff_t>(behind); changed != changes_.end(); ++changed)
    for (const std::uint32_t b : *changed)
      PoseSnapshot::for_each_column([&](auto column) {
        (old.*column)[b] = (current.*column)[b];
        copied_bytes_ += sizeof(old.*column)[b];
      });
  old.joints = current.joints;
  old.scene = current.scene;
  old.points = current.points;
  old.revision = current.revision;
  return true;
}

// Records the changes of the next published revision.
void PoseStore::record_changes(std::vector<std::uint32_t> changed) {
  if (changed.size() > scene_.bodies().size() / kLargestRecordedShare) return changes_.clear();
  changes_.push_back(std::move(changed));
  if (changes_.size() > kRecordedRevisions) changes_.pop_front();
}

namespace {

void note_receipts_of_points(PoseSnapshot& next) {
  for (const ReceivedPoints& of : *next.points) {
    if (next.oldest_receipt_ns == 0 || of.receipt_ns < next.oldest_receipt_ns) next.oldest_receipt_ns = of.receipt_ns;
    if (const std::pair stamped(of.stamp_ns, of.sequence);
        stamped > std::pair(next.newest_stamp_ns, next.newest_sequence))
      std::tie(next.newest_stamp_ns, next.newest_sequence) = stamped;
  }
}

}  // namespace

void PoseStore::publish(std::shared_ptr<PoseSnapshot> next) {
  next->is_published = true;
  next->oldest_receipt_ns = next->newest_stamp_ns = next->newest_sequence = 0;
  for (std::size_t b = 0; b < next->receipt_ns.size(); ++b) {
    const std::int64_t receipt = next->receipt_ns[b];
    if (receipt == 0) continue;
    if (next->oldest_receipt_ns == 0 || receipt < next->oldest_receipt_ns) next->oldest_receipt_ns = receipt;
    const std::pair stamped(next->stamp_ns[b], next->sequence[b]);
    if (stamped > std::pair(next->newest_stamp_ns, next->newest_sequence))
      std::tie(next->newest_stamp_ns, next->newest_sequence) = stamped;
  }
  if (next->points) note_receipts_of_points(*next);
  assert(next->pairs && next->order && next->local.size() == scene_.bodies().size());
  std::shared_ptr<const PoseSnapshot> old = std::move(next);  // freed outside the lock
  const std::lock_guard lock(current_mutex_);
  current_.swap(old);
}

void PoseStore::check_stamp(std::int64_t stamp_ns) const {
  using std::chrono::nanoseconds;
  const nanoseconds now = std::chrono::system_clock::now().time_since_epoch();
  if (stamp_ns >= 0 && (nanoseconds(stamp_ns) <= now || nanoseconds(stamp_ns) - now <= max_stamp_lead_)) return;
  ++out_of_range_;
  const auto seconds = [](nanoseconds span) {
    return std::to_string(std::chrono::duration_cast<std::chrono::seconds>(span).count());
  };
  throw engine::QueryError(QueryErrorCode::kBadQuery,
                           "stamp_ns: " + std::to_string(stamp_ns) +
                               (stamp_ns < 0 ? " is below 0"
                                             : " is " + seconds(nanoseconds(stamp_ns) - now) +
                                                   " s ahead of this machine's clock; " + seconds(max_stamp_lead_) +
                                                   " s may be (Options::max_stamp_lead, limit max-stamp-lead-s)"));
}

void PoseStore::check_not_late(const StampMarks& marks, std::uint32_t id, const std::string& name,
                               std::int64_t stamp_ns, std::uint64_t publisher) {
  const std::int64_t last = marks.last(id, publisher);
  if (stamp_ns == 0 || stamp_ns >= last) return;
  ++late_;
  throw engine::QueryError(QueryErrorCode::kBadQuery, "stamp_ns: " + std::to_string(stamp_ns) + " is older than " +
                                                          std::to_string(last) +
                                                          ", the last from this publisher for '" + name + "'");
}

PoseUpdateResult PoseStore::set(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence,
                                std::uint64_t publisher) {
  check_stamp(stamp_ns);
  const auto lock = lock_for_update();
  for (const BodyPose& p : poses) {
    if (p.body >= scene_.bodies().size()) continue;
    const Body& body = scene_.bodies()[p.body];
    if (body.robot != kNone) throw engine::QueryError(QueryErrorCode::kBadQuery, "poses: " + placed_by_joints(body));
    check_not_late(marks_, p.body, body.name, stamp_ns, publisher);
  }
  const std::shared_ptr<PoseSnapshot> next = copy();
  const std::int64_t now = monotonic_ns();
  PoseUpdateResult result;
  std::vector<std::uint32_t> moved;
  for (const BodyPose& p : poses) {
    if (p.body >= next->local.size()) {
      ++result.unknown;
      continue;
    }
    if (scene_.bodies()[p.body].is_static) {
      ++result.fixed;
      continue;
    }
    next->local[p.body] = p.pose;
    next->given[p.body] = 1;
    next->stamp_ns[p.body] = stamp_ns;
    next->receipt_ns[p.body] = now;
    next->sequence[p.body] = sequence;
    marks_.note(p.body, publisher, stamp_ns);
    moved.push_back(p.body);
    ++(check(p.pose) == PoseQuality::kBad ? result.bad : result.applied);
  }
  if (!moved.empty()) publish_moved(next, moved);
  result.revision = next->revision;
  result.copied_bytes = std::exchange(copied_bytes_, 0);
  return result;
}

void PoseStore::publish_moved(const std::shared_ptr<PoseSnapshot>& next, std::span<const std::uint32_t> moved) {
  std::vector<std::uint32_t> placed = next->with_followers(moved);
  next->place_again(placed);
  ++next->revision;
  record_changes(std::move(placed));
  publish(next);
}

std::unique_lock<std::mutex> PoseStore::lock_for_update() {
  std::unique_lock lock(writers_);
  if (is_stopped_) throw UpdatesStopped();
  return lock;
}

void PoseStore::stop_updates(bool stop) {
  const std::lock_guard lock(writers_);
  is_stopped_ = stop;
}

PoseUpdateResult PoseStore::attach(std::uint32_t child, std::uint32_t parent, const Pose* X_pc,
                                   std::span<const std::uint32_t> allow) {
  const auto lock = lock_for_update();
  const std::shared_ptr<PoseSnapshot> next = copy();
  const auto& bodies = scene_.bodies();
  const auto reject = [](const std::string& why) {
    throw engine::QueryError(QueryErrorCode::kBadQuery, "attach: " + why);
  };
  if (child >= bodies.size()) reject("unknown child, body " + std::to_string(child));
  if (parent != kNone && parent >= bodies.size()) reject("unknown parent, body " + std::to_string(parent));
  if (bodies[child].is_static) reject("'" + bodies[child].name + "' is static");
  if (bodies[child].robot != kNone) reject(placed_by_joints(bodies[child]));
  for (std::uint32_t b = parent; b != kNone; b = next->parent[b])
    if (b == child) reject("'" + bodies[child].name + "' would follow itself through '" + bodies[parent].name + "'");
  if (X_pc && check(*X_pc) == PoseQuality::kBad) reject("the pose of '" + bodies[child].name + "' is not usable");
  if (parent == kNone && !allow.empty()) reject("allow is only for a body with a parent");
  IgnoredPairs ignored = *next->ignored;
  ignored.release(child);
  ignored.allow_attached(child, allow, scene_);
  if (!X_pc) {
    for (const std::uint32_t b : {child, parent})
      if (b != kNone && next->placed[b].status != Status::kOk) reject("'" + bodies[b].name + "' has no usable pose");
    const Pose X_wc = next->placed[child].pose.X_wb;
    next->local[child] = parent == kNone ? X_wc : compose(inverse(next->placed[parent].pose.X_wb), X_wc);
  } else {
    next->local[child] = *X_pc;
  }
  next->given[child] = 1;
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
