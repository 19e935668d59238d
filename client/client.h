// The C++ client, with the same calls over shared memory, ZeroMQ and LCM.
//
//   auto client = clearance::connect("shm:///run/user/1000/clearance.sock");
//   client.set_poses({{"base", {0, 0, 0, 1, 0, 0, 0}}});
//   const clearance::Result result = client.distances({.max_distance = 0.5});
//   for (std::size_t i = 0; i < result.rows(); ++i) use(result.lower()[i], result.upper()[i]);
//
// clearance::Engine (engine.h) answers the same queries in process.
#pragma once

#include <clearance/check.h>
#include <clearance/connection_errors.h>
#include <clearance/new_body.h>
#include <clearance/prepared.h>
#include <clearance/prepared_path.h>
#include <clearance/query.h>
#include <clearance/result.h>
#include <clearance/scene_info.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace clearance {

struct ConnectOptions;

/// A connection to a daemon. Not thread-safe; use one client per thread. After a fork, the child must connect again
/// (calls throw).
///
/// The loss of a daemon makes at least one of the running calls and pending replies throw ConnectionError (over LCM,
/// TimeoutError or DaemonHung). The next call connects to the daemon then at that url, or to the next url of the list,
/// or throws ConnectionError at once if there is none. Since that is another daemon, each call throws NewEpoch until
/// acknowledge_epoch(). Poses, attachments and bodies that clients had sent are lost with the old daemon.
class CLEARANCE_API Client {
 public:
  using Duration = std::chrono::nanoseconds;

  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;
  ~Client();

  /// Answers a query. Throws TimeoutError, ConnectionError, RequestError.
  Result distances(const Query& query = {});
  /// Returns the free configurations: Reduce::kAny with the query's margins. Unproved configurations are not free. Also
  /// checks joint limits (Check::ok()), which are fetched once or, without configurations, after each change of poses.
  Check check(const Query& query = {});
  /// Returns the least distances along whole continuous motions, with certified bounds. Configurations 2k and 2k + 1 of
  /// the query are the ends of motion k; as_motions() has the defaults. Throws as distances().
  Result motions(const Query& query);
  /// Returns whether a path is free: every pair is proved farther than its margin along the whole path. The query's
  /// configurations are its waypoints, in order; with `control_points` above 2, the control points of its segments,
  /// Bezier curves of joints, each with its own ends. Stops at the first motion that is not proved free. Throws as
  /// distances(), and std::invalid_argument for fewer than two waypoints or an incomplete segment.
  PathCheck check_path(const Query& query);
  /// Returns (K,) sizes of proved free regions around configurations (of joints, no bodies): the largest s for which
  /// all pairs are proved to stay beyond the query's margins while no joint moves by more than s times its weight. The
  /// value is 0 if the configuration itself is not proved free, and inf if no motion can reduce a distance. Ignores
  /// joint limits. Throws as distances().
  /// \param weights (J,) radians and metres, >= 0
  std::vector<double> free_scale(const Query& query, std::span<const double> weights);
  /// Sends a query and returns immediately.
  Pending submit(const Query& query = {}, WhenDone when_done = {});
  /// Prepares a query without configurations and positions, which each run gives. Queries of check(), motions() and
  /// free_scale() are those of as_check(), as_motions() and as_free_scale().
  Prepared prepare(const Query& query = {});
  /// Prepares a query of check_path() without its path, which each run gives. Throws as prepare().
  PreparedPath prepare_path(const Query& query);

  /// Applies poses as one snapshot. Throws RequestError, and applies nothing, for a stamp below 0, far ahead of the
  /// daemon's clock, or older than this client's last for one of the bodies.
  /// \param stamp_ns, sequence the caller's clock and its count of updates, returned with replies; 0 for none
  /// \param velocities of the bodies at these poses, for the columns of kRateFields; NaN, or none at all, if unknown
  UpdateResult set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns = 0,
                         std::int64_t sequence = 0, std::span<const Twist6> velocities = {});
  UpdateResult set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns = 0,
                         std::int64_t sequence = 0);
  /// Sets joint positions by id, radians and metres, and with them the poses of links. Throws RequestError also for a
  /// repeated joint.
  /// \param velocities of the joints, rad/s and m/s, as in set_poses()
  UpdateResult set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns = 0,
                          std::int64_t sequence = 0, std::span<const double> velocities = {});
  /// Replaces the points of a cloud atomically, for all queries that start after it returns. `applied` counts points.
  /// Throws RequestError, and replaces nothing, for a body that is no cloud, a coordinate that is not finite, too many
  /// points, and stamps as set_poses() does.
  /// \param xyz (N,) metres, in the body's frame; empty for an empty body
  /// \param radius metres, growth of the points; by default the radius in the scene
  UpdateResult set_points(std::uint32_t body, std::span<const std::array<float, 3>> xyz,
                          std::optional<double> radius = {}, std::int64_t stamp_ns = 0, std::int64_t sequence = 0);
  /// Returns the joints of a robot ("panda"), of a group of its SRDF ("panda/panda_arm"), a single joint, or all ("*").
  /// Throws std::invalid_argument with similar names.
  Joints joints(std::string_view group);
  /// Returns all joints of the scene's robots with their current positions, and their groups.
  JointsInfo joint_states();
  /// Waits until the daemon has poses with this stamp or a newer one, so that the next query uses them. Costs one round
  /// trip if the poses are there. Throws RequestError with kPosesLate after `timeout` (above 0, at most 10 s).
  /// \param stamp_ns publisher's clock, as in set_poses(); above 0
  /// \param of body or group (selector). Unstamped bodies are ignored, but at least one must have a stamp.
  void wait_for_poses(std::int64_t stamp_ns, std::uint32_t of = kEveryBody,
                      Duration timeout = std::chrono::seconds(10));
  /// Attaches `child` to `parent`, at its current relative pose or at X_parent_child; with kNone, detaches it.
  /// \param allow bodies and groups (selectors) that the child may touch during this attachment: their pairs with it
  /// are disabled until the next attach() of the child
  UpdateResult attach(std::uint32_t child, std::uint32_t parent, const Pose7* X_parent_child = nullptr,
                      std::span<const std::uint32_t> allow = {});
  /// Disables the pairs of a body or group (selectors) with another, or enables them again, except those of a parent
  /// and its child. `applied` counts the pairs that have changed. Throws RequestError.
  UpdateResult allow(std::uint32_t a, std::uint32_t b);
  UpdateResult forbid(std::uint32_t a, std::uint32_t b);

  /// Makes the daemon reload its scene file, and waits for the new scene. Queries of other clients continue, and bodies
  /// keep their poses and attachments by name. If loading fails, the old scene stays, and this throws RequestError with
  /// the loader's message.
  /// \param timeout of this call only
  SceneChanged reload(Duration timeout = std::chrono::minutes(10));

  /// Adds a body (for example a grasped object), and waits until the scene contains it. It gets the next id; the other
  /// bodies keep their ids and poses. Running queries finish on the scene that they started with. Throws RequestError
  /// for a name in use, an invalid shape or too many bodies; std::invalid_argument unless there is exactly one shape.
  SceneChanged add_body(const NewBody& body);
  /// Replaces the shape of a body by that of `shape`, grown by its `radius`, and waits until the scene contains it. The
  /// body of this name keeps its id, pose, attachments, allowed pairs, padding and uncertainty; the other members of
  /// `shape` are ignored. Received points of a cloud are dropped. Throws as add_body(), for links of robots, and for bodies
  /// of the scene file without the right "admin".
  SceneChanged replace(const NewBody& shape);
  /// Removes a body that add_body() added. The ids of bodies added after it change. Throws RequestError for any other
  /// body, and for the parent of another body.
  SceneChanged remove_body(std::string_view name);

  /// Returns the scene of this client's ids. It is fetched once, and again after kWrongScene or a change by this
  /// client; the reference is valid until then. Requests with ids are then for that scene. After a change by another
  /// client or a reload, they are rejected with kWrongScene until scene(), refresh(), body() or group() is called.
  /// After a change by this client, they are accepted if every old id still refers to the same body.
  const SceneInfo& scene();
  void refresh();                                      ///< fetches the scene again
  std::uint32_t body(std::string_view name);           ///< id; throws std::invalid_argument with similar names
  std::uint32_t group(std::string_view name);          ///< selector; "*" is every body
  std::vector<IdPair> pairs(const Query& query = {});  ///< the pairs of a query, in row order
  /// Evaluates rows of a query without reduction again, and returns them with proofs of their bounds, as a JSON
  /// document for tools/check_certificate.py (docs/trust/certificates.md). Throws RequestError, also for a document of
  /// more than 64 MiB.
  /// \param rows row numbers, k P + p for pair p in configuration k; by default all
  std::string certificate(const Query& query = {}, std::optional<std::span<const std::uint64_t>> rows = {});
  std::vector<BodyStateInfo> body_states();  ///< by id; poses are X_wb
  std::vector<std::pair<std::string, std::uint64_t>> stats();
  /// Waits until the daemon has made all covers, which make decisions faster, and returns whether it has.
  bool wait_covers(Duration timeout = std::chrono::minutes(1));
  Duration ping(std::span<const std::byte> payload = {});  ///< echo through the daemon; returns the round-trip time

  /// Returns the run of the daemon that this client's requests are for: the one at its connection, or the last one
  /// acknowledged; 0 for a daemon without epochs.
  std::uint64_t epoch() const;
  /// Accepts the current daemon after NewEpoch, and returns its epoch. Poses, attachments and bodies must then be sent
  /// again. Throws ConnectionError, also if this client's daemon is lost and several others respond (LCM).
  std::uint64_t acknowledge_epoch();

  void set_timeout(Duration timeout);  ///< of every call; default 5 s
  std::string url() const;

 private:
  friend CLEARANCE_API Client connect(std::span<const std::string> urls, const ConnectOptions& options);
  struct Impl;
  explicit Client(std::shared_ptr<Impl> impl);
  Impl& impl() const;
  std::shared_ptr<Impl> impl_;
};

struct ConnectOptions {
  std::chrono::nanoseconds timeout = std::chrono::seconds(5);
  /// For a daemon that listens on TCP with keys: the files of its public key and of this client's own key pair, as
  /// written by `clearance keygen`. If empty, those of the url ("?server_key=FILE&key=FILE"), then of the environment
  /// (CLEARANCE_SERVER_KEY, CLEARANCE_KEY), otherwise no keys.
  std::string server_key = {}, key = {};
  /// Time that the daemon's loop may stand still during a request, 10 ms or more; then calls throw DaemonHung, at most
  /// a quarter later. 0 disables this test. Default: 1 s, or a fifth of `timeout` if that is more.
  std::optional<std::chrono::nanoseconds> hang = {};
  bool as_planning = false;  ///< requests have the class `planning` even if the client has the class `control`
};

/// Connects to "shm:///run/user/0/clearance.sock", "ipc:///path", "tcp://host:port" or
/// "udpm://239.255.76.67:7667?ttl=0" (an LCM url; "&prefix=NAME_" sets the channels' prefix).
/// Throws ConnectionError naming url and cause, over LCM also if several daemons respond; std::invalid_argument for a
/// url of an unknown kind.
CLEARANCE_API Client connect(const std::string& url, std::chrono::nanoseconds timeout = std::chrono::seconds(5));
CLEARANCE_API Client connect(const std::string& url, const ConnectOptions& options);
/// Connects to the first of these that responds, and moves to the next when a daemon is lost or hung, cyclically. The
/// next daemon has none of the client's state (NewEpoch). Each url but the last has ConnectOptions::hang to respond.
CLEARANCE_API Client connect(std::span<const std::string> urls, const ConnectOptions& options);

}  // namespace clearance
