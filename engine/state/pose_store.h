// Where every body is: immutable snapshots, replaced as a whole by each batch of updates.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/base/query_error.h"
#include "engine/pose/body_pose.h"
#include "engine/pose/placed.h"
#include "engine/state/ignored_pairs.h"
#include "engine/state/pair_table.h"
#include "engine/state/scene_history.h"
#include "engine/state/stamp_marks.h"

namespace clearance {

/// The points of a body that were received last.
struct ReceivedPoints {
  std::uint32_t body;
  PiecePtr cloud;       ///< not grown by what is doubted of the body; null: there are none
  std::uint64_t count;  ///< of points
  std::int64_t stamp_ns, receipt_ns, sequence;
};

/// The poses of all bodies at one moment, with what follows from them. Shared by jobs; never changed once published.
struct PoseSnapshot {
  std::uint64_t revision = 0;
  std::int64_t newest_stamp_ns = 0;    ///< publisher's clock: the newest among those of the poses below
  std::int64_t newest_sequence = 0;    ///< of the update that brought it; 0: its publisher does not count
  std::int64_t oldest_receipt_ns = 0;  ///< 0: none was received
  std::int64_t loaded_ns = 0;          ///< our monotonic clock: of the poses that the scene gives
  std::uint64_t scene_revision = 0;    ///< changes with attachments and ignored pairs
  std::uint64_t scene_changes = 0;     ///< SceneHistory::changes() at that revision
  std::shared_ptr<const SceneHistory> history;
  std::shared_ptr<const IgnoredPairs> ignored;
  std::shared_ptr<const PairTable> pairs;
  /// The scene as it is at this moment: another one than was loaded where points were received.
  std::shared_ptr<const Scene> scene;
  std::shared_ptr<const std::vector<ReceivedPoints>> points;  ///< null: none were received

  std::vector<Pose> local;          ///< as given: X_wb, or X_pb of a body with a parent
  std::vector<std::uint8_t> given;  ///< whether `local` was ever given
  std::vector<std::uint32_t> parent;
  std::shared_ptr<const std::vector<std::uint32_t>> order;  ///< parents before children
  bool has_followers = false;                               ///< some body has a parent

  std::vector<BodyPlacement> placed;
  std::vector<std::int64_t> stamp_ns, receipt_ns, sequence;  ///< of a link: of the joint on its way set longest ago
  std::vector<std::uint8_t> beyond_limits;                   ///< by body: a joint that places it is
  bool is_published = false;                                 ///< it is, or was, what everybody sees

  /// Of Scene::joints().
  struct Joints {
    std::vector<double> position;
    std::vector<std::uint8_t> given;
    std::vector<std::int64_t> stamp_ns, receipt_ns, sequence;
  } joints;

  /// What is known of each body: calls f(member) for every column.
  template <class F>
  static void for_each_column(F&& f) {
    f(&PoseSnapshot::local);
    f(&PoseSnapshot::given);
    f(&PoseSnapshot::placed);
    f(&PoseSnapshot::stamp_ns);
    f(&PoseSnapshot::receipt_ns);
    f(&PoseSnapshot::sequence);
    f(&PoseSnapshot::beyond_limits);
  }

  /// Places links anew by their joints. \param changed of them; empty: all. Returns the bodies whose poses are given
  /// anew; they are still to be placed.
  std::vector<std::uint32_t> move_links(const SceneRobot& robot, std::span<const std::uint32_t> changed);
  /// Places bodies anew, parents before children.
  void place_again(std::span<const std::uint32_t> bodies);
  /// What was received of a body's points; null: nothing.
  const ReceivedPoints* points_of(std::uint32_t body) const;
  /// The oldest receipt among the body, its points and those that it follows; 0 if none of them was ever received.
  std::int64_t receipt_of_chain(std::uint32_t body) const;
  /// `bodies` and everything that follows one of them, parents before children.
  std::vector<std::uint32_t> with_followers(std::span<const std::uint32_t> bodies) const;
};

class PoseStore {
 public:
  PoseStore(const Scene& scene, std::chrono::nanoseconds max_stamp_lead);

  std::shared_ptr<const PoseSnapshot> snapshot() const;
  PoseUpdateResult set(std::span<const BodyPose> poses, std::int64_t stamp_ns, std::int64_t sequence,
                       std::uint64_t publisher);
  PoseUpdateResult set_joints(std::span<const JointPosition> positions, std::int64_t stamp_ns, std::int64_t sequence,
                              std::uint64_t publisher);
  /// Replaces the points of a body of points, all at once. It takes as long as the tree over them does; meanwhile only
  /// others wait who replace points. \param radius metres, that they are grown by; none: as the scene has it
  PoseUpdateResult set_points(std::uint32_t body, std::span<const CloudPoint> points, std::optional<double> radius,
                              std::int64_t stamp_ns, std::int64_t sequence, std::uint64_t publisher);
  /// What was received and attached since `old` was loaded, for bodies that are in both scenes, known by their names.
  void take_over(const PoseStore& old);
  void check_stamp(std::int64_t stamp_ns) const;
  std::uint64_t stamps_out_of_range() const { return out_of_range_; }
  std::uint64_t stamps_late() const { return late_; }
  PoseUpdateResult attach(std::uint32_t child, std::uint32_t parent, const Pose* X_pc,
                          std::span<const std::uint32_t> allow);
  PoseUpdateResult allow(std::uint32_t a, std::uint32_t b, bool allow);

 private:
  static constexpr std::size_t kSpares = 2, kRemembered = 8;
  static constexpr std::size_t kWorthRemembering = 8;  // changes of at most one body in so many
  struct Spares {
    std::mutex mutex;
    std::vector<std::unique_ptr<PoseSnapshot>> snapshots;
  };
  std::shared_ptr<PoseSnapshot> copy();
  bool catch_up(PoseSnapshot& old, const PoseSnapshot& current);
  void remember(std::vector<std::uint32_t> changed);
  void enable_pairs(PoseSnapshot& snapshot) const;  // that follow from its parents
  void publish(std::shared_ptr<PoseSnapshot> next);
  void check_not_late(const StampMarks& marks, std::uint32_t id, const std::string& name, std::int64_t stamp_ns,
                      std::uint64_t publisher);
  void take_over_points(const PoseStore& old_store, PoseSnapshot& next);
  static void note_points(PoseSnapshot& next, ReceivedPoints received);
  void take_over_joints(const PoseStore& old_store, PoseSnapshot& next);

  const Scene& scene_;
  const std::chrono::nanoseconds max_stamp_lead_;
  mutable std::atomic<std::uint64_t> out_of_range_{0};  // stamps
  std::atomic<std::uint64_t> late_{0};
  mutable std::mutex writers_;  // of what follows
  StampMarks marks_, joint_marks_, points_marks_;
  std::shared_ptr<SceneHistory> history_ = std::make_shared<SceneHistory>();
  std::deque<std::vector<std::uint32_t>> changes_;  // bodies that the newest revisions have changed, the newest last
  std::uint64_t copied_bytes_ = 0;
  std::mutex points_writers_;  // taken before writers_, of what follows
  /// Scenes that jobs may still read: whoever brings points lets go of those that nobody does, so that freeing a cloud
  /// keeps nobody else.
  std::vector<std::shared_ptr<const Scene>> scenes_;
  mutable std::mutex current_mutex_;  // held for a pointer's copy only
  std::shared_ptr<const PoseSnapshot> current_;
  std::shared_ptr<Spares> spares_ = std::make_shared<Spares>();  // snapshots may outlive the store
};

/// Our monotonic clock, nanoseconds.
std::int64_t monotonic_ns();

}  // namespace clearance
