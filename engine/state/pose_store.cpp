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
  first->velocity.resize(n);
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
    if (body.max_speed > 0) first->velocity[i] = kUnknownTwist;
  }
  const std::size_t joints = scene.joints().size();
  for (const SceneJoint& joint : scene.joints()) {
    first->joints.position.push_back(joint.home.value_or(0));
    first->joints.given.push_back(joint.home.has_value());
    first->joints.velocity.push_back(0);
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
  address_.store(current_.get(), std::memory_order_release);
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
    next->velocity[p.body] = p.velocity;
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

}  // namespace clearance
