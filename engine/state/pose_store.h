// Poses of all bodies: immutable snapshots, each replaced as a whole by a batch of updates.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/query_error.h"
#include "engine/pose/body_pose.h"
#include "engine/pose/placed.h"
#include "engine/state/ignored_pairs.h"
#include "engine/state/pair_table.h"
#include "engine/state/scene_history.h"
#include "engine/state/stamp_marks.h"

namespace clearance {

/// The most recently received points of a body.
struct ReceivedPoints {
  std::uint32_t body;
  ConvexPartPtr cloud;  ///< without the body's uncertainty; null if there are no points
  std::uint64_t count;  ///< of points
  std::int64_t stamp_ns, receipt_ns, sequence;
  /// Owner of the cover of the points: it lives as long as a snapshot has them.
  std::shared_ptr<const void> owner = std::make_shared<char>();
};

/// The poses of all bodies at one moment, and data derived from them. Shared by jobs; immutable once published.
struct PoseSnapshot {
  std::uint64_t revision = 0;
  std::int64_t newest_stamp_ns = 0;    ///< publisher's clock: the newest stamp of the poses below
  std::int64_t newest_sequence = 0;    ///< of the update with that stamp; 0 if its publisher does not number updates
  std::int64_t oldest_receipt_ns = 0;  ///< 0 if none was received
  std::int64_t loaded_ns = 0;          ///< monotonic clock: load time of the poses that the scene gives
  std::uint64_t scene_revision = 0;    ///< changes with attachments and ignored pairs
  std::uint64_t scene_changes = 0;     ///< SceneHistory::changes() at that revision
  std::shared_ptr<const SceneHistory> history;
  std::shared_ptr<const IgnoredPairs> ignored;
  std::shared_ptr<const PairTable> pairs;
  /// The scene at this moment; differs from the loaded one after points were received.
  std::shared_ptr<const engine::Scene> scene;
  std::shared_ptr<const std::vector<ReceivedPoints>> points;  ///< null if none were received

  std::vector<Pose> local;          ///< as given: X_wb, or X_pb of a body with a parent
  std::vector<std::uint8_t> given;  ///< whether `local` was ever given
  /// At `local`, relative to the parent. 0 while nothing moves a body from its place in the scene or its attachment; of
  /// a link, that of its root alone. NaN if unknown.
  std::vector<BodyTwist> velocity;
  std::vector<std::uint32_t> parent;
  std::shared_ptr<const std::vector<std::uint32_t>> order;  ///< parents before children
  bool has_followers = false;                               ///< some body has a parent

  std::vector<BodyPlacement> placed;
  std::vector<std::int64_t> stamp_ns, receipt_ns, sequence;  ///< of a link: the least recently set joint of its chain
  std::vector<std::uint8_t> beyond_limits;                   ///< by body: whether one of its joints is beyond limits
  bool is_published = false;                                 ///< it is, or was, the current snapshot

  /// Columns of Scene::joints().
  struct Joints {
    std::vector<double> position;
    std::vector<double> velocity;  ///< at `position`; 0 while the joint is where the scene puts it, NaN if unknown
    std::vector<std::uint8_t> given;
    std::vector<std::int64_t> stamp_ns, receipt_ns, sequence;
  } joints;

  /// Calls f(member) for every column with one entry per body.
  template <class F>
  static void for_each_column(F&& f) {
    f(&PoseSnapshot::local);
    f(&PoseSnapshot::given);
    f(&PoseSnapshot::velocity);
    f(&PoseSnapshot::placed);
    f(&PoseSnapshot::stamp_ns);
    f(&PoseSnapshot::receipt_ns);
    f(&PoseSnapshot::sequence);
    f(&PoseSnapshot::beyond_limits);
  }

  /// Recomputes the poses of links from their joints; the caller still has to place the bodies.
  /// \param changed joints that changed; empty for all
  /// \return the bodies whose local poses changed
  std::vector<std::uint32_t> move_links(const SceneRobot& robot, std::span<const std::uint32_t> changed);
  /// Recomputes the placement of bodies, parents before children.
  void place_again(std::span<const std::uint32_t> bodies);
  /// Returns the points received for a body, or null.
  const ReceivedPoints* points_of(std::uint32_t body) const;
  /// Oldest receipt among the body, its points and the bodies that it follows; 0 if there was none.
  std::int64_t receipt_of_chain(std::uint32_t body) const;
  /// Returns `bodies` and all their followers, parents before children.
  std::vector<std::uint32_t> with_followers(std::span<const std::uint32_t> bodies) const;
};

class PoseStore {
 public:
  PoseStore(const engine::Scene& scene, std::chrono::nanoseconds max_stamp_lead);

  std::shared_ptr<const PoseSnapshot> snapshot() const;
  /// The current snapshot if it is the one that was seen, otherwise null. Takes no lock.
  std::shared_ptr<const PoseSnapshot> same(const std::weak_ptr<const PoseSnapshot>& seen) const {
    std::shared_ptr<const PoseSnapshot> snapshot = seen.lock();
    if (snapshot.get() != address_.load(std::memory_order_acquire)) snapshot = nullptr;
    return snapshot;
  }
  PoseUpdateResult set(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence,
                       std::uint64_t publisher);
  PoseUpdateResult set_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns, std::int64_t sequence,
                              std::uint64_t publisher);
  /// Replaces all points of a body of points. Takes as long as building their tree, and blocks only other replacements
  /// of points.
  /// \param radius growth of the points, in metres; the scene's value if unset
  PoseUpdateResult set_points(std::uint32_t body, std::span<const CloudPoint> points, std::optional<double> radius,
                              std::int64_t stamp_ns, std::int64_t sequence, std::uint64_t publisher);
  /// Takes over updates and attachments since `old` was loaded, for bodies whose names are in both scenes.
  /// \param reshaped body whose shape was replaced, and with it the points received; or empty
  void take_over(const PoseStore& old, std::string_view reshaped = {});
  /// Makes updates throw UpdatesStopped, or accepts them again.
  void stop_updates(bool stop);
  void check_stamp(std::int64_t stamp_ns) const;
  std::uint64_t stamps_out_of_range() const { return out_of_range_; }
  std::uint64_t stamps_late() const { return late_; }
  PoseUpdateResult attach(std::uint32_t child, std::uint32_t parent, const Pose* X_pc,
                          std::span<const std::uint32_t> allow);
  PoseUpdateResult allow(std::uint32_t a, std::uint32_t b, bool allow);

 private:
  static constexpr std::size_t kSpares = 2, kRecordedRevisions = 8;
  static constexpr std::size_t kLargestRecordedShare = 8;  // recorded changes concern at most one body in so many
  struct Spares {
    std::mutex mutex;
    std::vector<std::unique_ptr<PoseSnapshot>> snapshots;
  };
  std::unique_lock<std::mutex> lock_for_update();
  std::vector<std::uint32_t> take_over_poses(const PoseStore& old_store, PoseSnapshot& next);
  std::shared_ptr<PoseSnapshot> copy();
  bool catch_up(PoseSnapshot& old, const PoseSnapshot& current);
  void record_changes(std::vector<std::uint32_t> changed);
  void enable_pairs(PoseSnapshot& snapshot) const;  // enables the pairs that its parents imply
  void publish(std::shared_ptr<PoseSnapshot> next);
  /// Places the moved bodies and those that follow them, and publishes the next revision.
  void publish_moved(const std::shared_ptr<PoseSnapshot>& next, std::span<const std::uint32_t> moved);
  void check_not_late(const StampMarks& marks, std::uint32_t id, const std::string& name, std::int64_t stamp_ns,
                      std::uint64_t publisher);
  void take_over_points(const PoseStore& old_store, PoseSnapshot& next, std::string_view reshaped);
  static void note_points(PoseSnapshot& next, ReceivedPoints received);
  void take_over_joints(const PoseStore& old_store, PoseSnapshot& next);

  const engine::Scene& scene_;
  const std::chrono::nanoseconds max_stamp_lead_;
  mutable std::atomic<std::uint64_t> out_of_range_{0};  // number of stamps
  std::atomic<std::uint64_t> late_{0};
  mutable std::mutex writers_;  // guards the following members
  bool is_stopped_ = false;
  StampMarks marks_, joint_marks_, points_marks_;
  std::shared_ptr<SceneHistory> history_ = std::make_shared<SceneHistory>();
  std::deque<std::vector<std::uint32_t>> changes_;  // bodies changed by the newest revisions, newest last
  std::uint64_t copied_bytes_ = 0;
  std::mutex points_writers_;  // guards the following members; locked before writers_
  /// Scenes that jobs may still read. The next replacement of points releases the unused ones, so that freeing a large
  /// cloud blocks no other thread.
  std::vector<std::shared_ptr<const engine::Scene>> scenes_;
  mutable std::mutex current_mutex_;  // held only while the pointer is copied
  std::shared_ptr<const PoseSnapshot> current_;
  std::atomic<const PoseSnapshot*> address_{nullptr};            // of current_
  std::shared_ptr<Spares> spares_ = std::make_shared<Spares>();  // shared, because snapshots may outlive the store
};

/// Monotonic clock of this process, in nanoseconds.
std::int64_t monotonic_ns();

}  // namespace clearance
