// The engine in a program of one's own, without a daemon: target Clearance::engine.
//
//   clearance::Engine engine(clearance::Scene::load("scene.yaml"));
//   engine.set_poses({{"gripper", {0.4, 0, 0.3, 1, 0, 0, 0}}});
//   const clearance::Result result = engine.distances({.max_distance = 0.5});
//   for (std::size_t i = 0; i < result.rows(); ++i) use(result.lower()[i], result.upper()[i]);
//
// clearance::Client (client.h) has the same queries, whose results have the same columns with the same bits. Metres,
// nanoseconds, right-handed frames.
#pragma once

#include <clearance/check.h>
#include <clearance/errors.h>
#include <clearance/new_body.h>
#include <clearance/prepared.h>
#include <clearance/prepared_path.h>
#include <clearance/query.h>
#include <clearance/result.h>
#include <clearance/scene.h>
#include <clearance/scene_info.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace clearance {

struct EngineOptions {
  std::string backend = "auto";   ///< "auto", "cpu", "cuda", or "reference" (brute force)
  int threads = 0;                ///< of one query; 0 for all cores
  std::vector<int> devices = {};  ///< GPUs by number, for the backends cuda and auto; empty for the current one
  std::uint64_t max_rows = std::uint64_t{1} << 28;  ///< larger answers are rejected
  std::uint64_t device_memory = 0;                  ///< limit on each device's memory, in bytes; 0 for all of it
  bool device_fallback = true;  ///< whether the CPU answers a query that the device cannot; else it is rejected
  /// When covers are made, which make decisions about bodies that move faster: "background" (on a thread of lowest
  /// priority, after the engine is ready) or "off". Answers do not depend on it.
  std::string covers = "background";
};

/// A scene and the poses of its bodies. Thread-safe: threads may query and set poses at once, and each result uses one
/// snapshot. Not usable in the child after a fork.
class CLEARANCE_API Engine {
 public:
  /// Throws std::invalid_argument for an unknown backend, and std::runtime_error for one that is absent or failed the
  /// self-test.
  explicit Engine(Scene scene, const EngineOptions& options = {});
  Engine(Engine&&) noexcept;
  Engine& operator=(Engine&&) noexcept;
  ~Engine();

  static std::vector<std::string> backends();  ///< available on this machine
  std::string_view backend() const;
  std::string device_error() const;  ///< last error of the device, or empty

  /// Answers a query. Throws QueryError for an invalid query. Throws std::invalid_argument for a fractional number of
  /// configurations, and for options of daemons (min_pose_stamp_ns, deadline_ns, ...). A bad pose or an unknown id is a
  /// status of its rows.
  Result distances(const Query& query = {}) const;
  /// Returns the free configurations: Reduce::kAny with the query's margins. Unproved configurations are not free. Also
  /// checks joint limits (Check::ok()). Throws as distances().
  Check check(const Query& query = {}) const;
  /// Returns the least distances along whole continuous motions, with certified bounds. Configurations 2k and 2k + 1 of
  /// the query are the ends of motion k; as_motions() has the defaults. Throws as distances().
  Result motions(const Query& query) const;
  /// Returns whether a path is free: every pair is proved farther than its margin along the whole path. The query's
  /// configurations are its waypoints, in order; with `control_points` above 2, the control points of its segments,
  /// Bezier curves of joints, each with its own ends. Stops at the first motion that is not proved free. Throws as
  /// distances(), and std::invalid_argument for fewer than two waypoints or an incomplete segment.
  PathCheck check_path(const Query& query) const;
  /// Returns (K,) sizes of proved free regions around configurations (of joints, no bodies): the largest s for which
  /// all pairs are proved to stay beyond the query's margins while no joint moves by more than s times its weight. The
  /// value is 0 if the configuration itself is not proved free, and inf if no motion can reduce a distance. Ignores
  /// joint limits. Throws as distances().
  /// \param weights (J,) radians and metres, >= 0
  std::vector<double> free_scale(const Query& query, std::span<const double> weights) const;
  /// Starts a query on the present poses and returns immediately. Its arrays are copied.
  Pending submit(const Query& query = {}, WhenDone when_done = {}) const;
  /// Prepares a query without configurations and positions, which each run gives. Queries of check(), motions() and
  /// free_scale() are those of as_check(), as_motions() and as_free_scale(). Throws QueryError for a query that no
  /// inputs make valid.
  Prepared prepare(const Query& query = {}) const;
  /// Prepares a query of check_path() without its path, which each run gives. Throws as prepare().
  PreparedPath prepare_path(const Query& query) const;
  std::vector<IdPair> pairs(const Query& query = {}) const;  ///< the pairs of a query, in row order
  /// Evaluates rows of a query without reduction again, and returns them with proofs of their bounds, as a JSON
  /// document for tools/check_certificate.py (docs/trust/certificates.md). Throws QueryError.
  /// \param rows row numbers, k P + p for pair p in configuration k; by default all
  std::string certificate(const Query& query = {}, std::optional<std::span<const std::uint64_t>> rows = {}) const;

  SceneInfo scene() const;
  std::uint32_t body(std::string_view name) const;   ///< id; throws std::invalid_argument with similar names
  std::uint32_t group(std::string_view name) const;  ///< selector; "*" is every body
  /// Returns the joints of a robot ("panda"), of a group of its SRDF ("panda/panda_arm"), a single joint, or all ("*").
  /// Throws std::invalid_argument with similar names.
  Joints joints(std::string_view group) const;
  /// Returns all joints of the scene's robots with their current positions, and their groups.
  JointsInfo joint_states() const;
  std::vector<BodyStateInfo> body_states() const;  ///< by id; poses are X_wb
  std::vector<std::pair<std::string, std::uint64_t>> stats() const;
  /// Waits until all covers are made (EngineOptions::covers), and returns whether they are. Works on them meanwhile, and
  /// so may take about a second longer than the timeout.
  bool wait_covers(std::chrono::nanoseconds timeout = std::chrono::minutes(1)) const;

  /// Applies poses as one snapshot. Throws QueryError, and applies nothing, for a stamp below 0, far ahead of this
  /// machine's clock, or older than the last one of a body.
  /// \param stamp_ns, sequence the caller's clock and its count of updates, returned with results; 0 for none
  /// \param velocities of the bodies at these poses, for the columns of kRateFields; NaN, or none at all, if unknown
  UpdateResult set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns = 0,
                         std::int64_t sequence = 0, std::span<const Twist6> velocities = {});
  UpdateResult set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns = 0,
                         std::int64_t sequence = 0);
  /// Sets joint positions by id, radians and metres, and with them the poses of links. Throws QueryError also for a
  /// repeated joint.
  /// \param velocities of the joints, rad/s and m/s, as in set_poses()
  UpdateResult set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns = 0,
                          std::int64_t sequence = 0, std::span<const double> velocities = {});
  /// Replaces the points of a cloud atomically, for all queries that start after it returns. `applied` counts points.
  /// Throws QueryError, and replaces nothing, for a body that is no cloud, a coordinate that is not finite, and stamps
  /// as set_poses() does.
  /// \param xyz (N,) metres, in the body's frame; empty for an empty body
  /// \param radius metres, growth of the points; by default the radius in the scene
  UpdateResult set_points(std::uint32_t body, std::span<const std::array<float, 3>> xyz,
                          std::optional<double> radius = {}, std::int64_t stamp_ns = 0, std::int64_t sequence = 0);
  /// Attaches `child` to `parent`, at its current relative pose or at X_parent_child; with kNone, detaches it. Throws
  /// QueryError for a cycle, a static child, or a body without a pose.
  /// \param allow bodies and groups (selectors) that the child may touch during this attachment: their pairs with it
  /// are disabled until the next attach() of the child
  UpdateResult attach(std::uint32_t child, std::uint32_t parent, const Pose7* X_parent_child = nullptr,
                      std::span<const std::uint32_t> allow = {});
  /// Disables the pairs of a body or group (selectors) with another, or enables them again, except those of a parent
  /// and its child. `applied` counts the pairs that have changed. Throws QueryError.
  UpdateResult allow(std::uint32_t a, std::uint32_t b);
  UpdateResult forbid(std::uint32_t a, std::uint32_t b);

  /// Adds a body (for example a grasped object). It gets the next id; the other bodies keep their ids and poses. Running
  /// queries finish on the scene that they started with. Throws QueryError for a name in use or an invalid shape;
  /// std::invalid_argument unless there is exactly one shape.
  SceneChanged add_body(const NewBody& body);
  /// Removes a body that add_body() added. The ids of bodies added after it change. Throws QueryError for any other
  /// body, and for the parent of another body.
  SceneChanged remove_body(std::string_view name);
  /// Replaces the shape and radius of the body of this name, which keeps its id, pose, attachments and allowed pairs.
  /// Throws QueryError for frames and links of robots, and as add_body().
  SceneChanged replace(const NewBody& shape);

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace clearance
