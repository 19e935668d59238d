// The C++ client, with the same calls over shared memory, ZeroMQ and LCM.
//
//   auto client = clearance::connect("shm:///run/user/1000/clearance.sock");
//   client.set_poses({{"base", {0, 0, 0, 1, 0, 0, 0}}});
//   auto reply = client.distances({.max_distance = 0.5});
//   for (std::size_t i = 0; i < reply.rows(); ++i) use(reply.lower()[i], reply.upper()[i]);
#pragma once

#include <clearance/mesh_as.h>
#include <clearance/query.h>

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

/// The daemon is unreachable or lost.
struct CLEARANCE_API ConnectionError : std::runtime_error {
  using std::runtime_error::runtime_error;
};
struct CLEARANCE_API TimeoutError : ConnectionError {
  using ConnectionError::ConnectionError;
};
/// The daemon rejected a request; `code` is a wire::ErrorCode.
struct CLEARANCE_API RequestError : std::runtime_error {
  RequestError(std::uint16_t c, const std::string& what) : std::runtime_error(what), code(c) {}
  std::uint16_t code;
};

/// The daemon was restarted, or is another one, since this client's first contact, and has lost the poses, attachments
/// and bodies that clients had sent. Requests are rejected with this error until Client::acknowledge_epoch().
struct CLEARANCE_API NewEpoch : RequestError {
  using RequestError::RequestError;
};
/// The daemon exists, but its loop stood still for ConnectOptions::hang during a request.
struct CLEARANCE_API DaemonHung : ConnectionError {
  using ConnectionError::ConnectionError;
};

class Frame;

/// An answer. Columns are views of the received frame (over shared memory, of a slot that the destructor returns). A
/// column that was not requested is empty.
class CLEARANCE_API Reply {
 public:
  explicit Reply(std::unique_ptr<Frame> frame);  ///< of type kReply; throws ConnectionError if malformed
  Reply(Reply&&) noexcept;
  Reply& operator=(Reply&&) noexcept;
  ~Reply();

  std::size_t rows() const;
  std::uint64_t total() const;           ///< pairs found by kWithin, including those past max_results
  std::uint64_t configurations() const;  ///< K
  std::uint64_t pairs() const;           ///< P
  std::uint32_t fields() const;
  std::span<const double> distance() const;  ///< (rows,) metres
  std::span<const double> lower() const;
  std::span<const double> upper() const;
  std::span<const Status> status() const;
  std::span<const std::uint16_t> flags() const;
  std::span<const double> point_a() const;  ///< (rows * 3,) world frame
  std::span<const double> point_b() const;
  std::span<const double> normal() const;
  std::span<const std::uint32_t> pieces() const;  ///< (rows * 2,)
  std::span<const double> gradient() const;       ///< (rows * 12,); order and frame as in kFieldGradient
  std::span<const IdPair> pair() const;
  std::span<const std::uint32_t> configuration() const;
  std::span<const float> points32() const;
  /// (rows * joints(),) metres per radian or metre: d distance / d position of each of the query's joints, in their
  /// order. 0 for overlapping bodies without a requested depth, NaN without witness points; one of several gradients
  /// with the flag kFlagNonsmooth.
  std::span<const double> gradient_joints() const;
  std::uint32_t joints() const;  ///< J with gradient_joints, otherwise 0
  std::span<const IdPair> pair_lower() const;
  std::span<const double> time() const;           ///< of motions, 0 to 1
  std::span<const double> first_contact() const;  ///< (rows * 2,) of motions; kFieldFirstContact
  std::span<const float> bounds() const;          ///< (rows, 2) lower and upper, metres, rounded outward
  std::span<const double> free_scale() const;     ///< Client::free_scale()
  std::span<const std::uint32_t> steps() const;   ///< of motions: evaluations of each

  std::uint64_t epoch() const;  ///< run of the daemon that answered, or 0
  std::uint64_t scene_revision() const;
  std::uint64_t snapshot_revision() const;
  std::int64_t snapshot_stamp_ns() const;  ///< newest stamp among the poses, publisher's clock
  std::int64_t snapshot_sequence() const;  ///< its publisher's count of the update with that stamp; 0 if not counted
  /// Age of the oldest pose at the query's start, since its receipt by the daemon; -1 if none was received.
  std::int64_t pose_age_ns() const;
  std::uint64_t engine_ns() const;
  std::uint64_t server_ns() const;
  std::string_view backend() const;

 private:
  template <class T>
  std::span<const T> column(Field field, std::size_t width) const;
  std::unique_ptr<Frame> frame_;
  std::uint64_t epoch_ = 0;
  std::uint64_t rows_ = 0;  // copies, so that the checked values are used
  std::uint32_t fields_ = 0, joints_ = 0;
};

struct BodyInfo {
  std::string name;
  std::uint32_t parent = kNone;
  bool is_static = false;
  std::uint32_t piece_count = 0;
  std::uint64_t vertex_count = 0;
  double model_error = 0;            ///< metres: bound on how far the convex parts reach outside the specified shape
  double extent = 0;                 ///< metres: distance of the farthest point from the body's origin
  double hull_excess = 0;            ///< metres: bound on the distance of the convex parts from their mesh; 0 if convex
  double empty_share = 0;            ///< fraction of the parts' volume outside the mesh; NaN for an open mesh
  std::uint64_t triangle_count = 0;  ///< triangles of a surface or solid; 0 if the convex parts are exact
  bool is_solid = false;             ///< whether the triangles enclose the body, rather than being the body
  bool is_cloud = false;             ///< whether the body is a point cloud, which set_points() replaces
};
struct GroupInfo {
  std::string name;
  std::vector<std::uint32_t> bodies;
};
struct SceneInfo {
  std::uint64_t revision = 0;
  std::vector<BodyInfo> bodies;
  std::vector<GroupInfo> groups;
  std::uint64_t pair_count = 0;
  std::string backend;
};
struct BodyStateInfo {
  Pose7 pose{};  ///< X_wb
  Status status = Status::kNoPose;
  std::uint32_t parent = kNone;
  std::int64_t stamp_ns = 0;
  std::int64_t age_ns = -1;  ///< since the daemon received it; -1 if never
};
/// A joint of one of the scene's robots; its id is its index in JointsInfo::joints.
struct JointInfo {
  std::string name;                 ///< "panda/panda_joint1"
  double lower = 0, upper = 0;      ///< radians or metres; infinite without a limit
  double position = 0;              ///< valid if status is kOk
  Status status = Status::kNoPose;  ///< kOk, kNoPose (without a position) or kBadPose
  bool beyond_limits = false;
  std::int64_t stamp_ns = 0;
  std::int64_t age_ns = -1;  ///< since the daemon received it; -1 if never
};
/// The joints of a robot, under its name, or of a group of its SRDF, such as "panda/panda_arm".
struct JointGroupInfo {
  std::string name;
  std::vector<std::uint32_t> joints;  ///< ids, ascending
};
struct JointsInfo {
  std::uint64_t scene_revision = 0;
  std::vector<JointInfo> joints;
  std::vector<JointGroupInfo> groups;
};
struct UpdateResult {
  std::uint64_t revision = 0;  ///< pose revision that contains the update
  std::uint64_t scene_revision = 0;
  std::uint32_t applied = 0, bad = 0, unknown = 0, fixed = 0;
};

/// A body to add at run time, with exactly one shape: the hull of `vertices` (body frame), a mesh of `vertices` and
/// `triangles`, a primitive, or a cloud of `points`.
struct NewBody {
  std::string name;
  std::span<const std::array<double, 3>> vertices = {};  ///< metres
  std::optional<std::array<double, 3>> box = {};         ///< full edge lengths, metres
  std::optional<double> sphere = {};                     ///< radius, metres
  std::optional<std::array<double, 2>> capsule = {};     ///< radius, length between the centres of its caps; along z
  std::optional<std::array<double, 2>> cylinder = {};    ///< radius, length; along z
  std::optional<std::array<double, 2>> cone = {};        ///< radius, length; along z, with its apex at the positive end
  std::optional<std::array<double, 3>> ellipsoid = {};   ///< half axes, metres
  bool half_space = false;                               ///< z <= 0 in its own frame; static, without a parent
  double radius = 0;                                     ///< metres, grows the shape
  std::uint32_t parent = kNone;                          ///< body that it follows
  std::optional<Pose7> pose = {};                        ///< X_world_body, or X_parent_body with a parent
  bool is_static = false;
  // Uncertainty, as in a scene file. Rejected by older daemons.
  double uncertainty_position = 0;  ///< metres: radius of a ball around its position that contains its origin
  double uncertainty_angle = 0;     ///< radians: bound on its rotation error about its origin
  double padding = 0;               ///< metres of growth, in addition to `radius`
  double max_speed = 0;             ///< metres per second: bound on the speed of its points
  // A mesh. Rejected by older daemons.
  std::span<const std::array<std::uint32_t, 3>> triangles = {};  ///< indices into `vertices`; closed for a solid
  MeshAs mesh_as = MeshAs::kAuto;  ///< body made from the mesh; kParts is the same as kHull
  /// Points of a cloud in metres, which set_points() replaces. No points make an empty body.
  std::optional<std::span<const std::array<float, 3>>> points = {};
  double voxel = 0;  ///< metres, for a cloud; above 0, boxes of this edge around the points are the body
};

/// The scene after a change.
struct SceneChanged {
  std::uint64_t scene_revision = 0;
  std::uint32_t body_count = 0;
  std::uint32_t body = kNone;  ///< id of the new body, after add_body()
  double seconds = 0;          ///< time to build the scene
};

/// A column in a plan's memory.
struct PlanColumn {
  Field field{};
  std::uint32_t row_bytes = 0;
  std::uint64_t offset = 0;  ///< a multiple of 64
};

/// A plan in the memory of a daemon's GPU. Another process maps the memory with cudaIpcOpenMemHandle() on the device of
/// that UUID, whose number can differ there. Offsets are into that memory.
struct PlanInfo {
  std::uint64_t number = 0;                   ///< for direct use of the wire protocol
  std::array<std::byte, 64> memory_handle{};  ///< cudaIpcMemHandle_t
  std::array<std::byte, 16> device_uuid{};    ///< cudaUUID_t
  std::uint64_t memory_bytes = 0;
  std::uint64_t poses_offset = 0;               ///< (K, M) Pose7 of the query's bodies; valid if bodies > 0
  std::uint64_t positions_offset = 0;           ///< (K, J) float64, radians and metres; valid if joints > 0
  std::uint32_t bodies = 0, joints = 0;         ///< M, J
  std::uint64_t rows = 0;                       ///< of each column: K P, or K for a reduction
  std::uint64_t configurations = 0, pairs = 0;  ///< K (1 for the current poses), P
  std::vector<PlanColumn> columns;              ///< in the order of Field
  std::uint64_t scene_revision = 0;             ///< of the scene, fixed when the plan is opened
  std::uint64_t snapshot_revision = 0;          ///< of the other bodies' poses, fixed likewise

  /// Throws std::invalid_argument for an absent column.
  const PlanColumn& column(Field field) const;
};

/// Result of a run of a plan.
struct PlanRun {
  std::uint64_t snapshot_revision = 0;  ///< of the daemon's current poses, not necessarily the plan's
  std::chrono::nanoseconds took{0};     ///< time in the daemon, from the first launch to the complete rows
};

/// An open plan of this client, closed by the destructor, by close(), and with the client's connection. Not
/// thread-safe, also with respect to its client.
class CLEARANCE_API RemotePlan {
 public:
  RemotePlan(RemotePlan&&) noexcept;
  RemotePlan& operator=(RemotePlan&&) noexcept;
  ~RemotePlan();  ///< closes the plan without waiting

  const PlanInfo& info() const { return info_; }
  /// Runs the query on the poses and positions in the memory, and returns when the rows are complete. Synchronise the
  /// stream that writes the input first. Throws as Client::distances(); RequestError (kWrongScene) if the daemon's
  /// scene differs from the plan's, and (kBusy) while an earlier run that timed out here is still running.
  /// \param timeout of this call, by default the client's
  /// \param check_scene whether to check the daemon's scene; if false, the answer is for the plan's scene
  PlanRun run(std::optional<std::chrono::nanoseconds> timeout = {}, bool check_scene = true);
  /// Closes the plan and frees its memory, which must be unmapped before. Throws as run().
  void close();

 private:
  friend class Client;
  struct Connection;
  explicit RemotePlan(std::shared_ptr<Connection> connection, PlanInfo info);
  std::shared_ptr<Connection> connection_;
  PlanInfo info_;
};

/// A pending request. The destructor discards an unread reply.
class Pending;

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
  Reply distances(const Query& query = {});
  /// Returns the free configurations: Reduce::kAny with the query's margins. Unproved configurations are not free. Also
  /// checks joint limits (Check::ok()), which are fetched once or, without configurations, after each change of poses.
  Check check(const Query& query = {});
  /// Returns (K,) sizes of proved free regions around configurations (of joints, no bodies): the largest s for which
  /// all pairs are proved to stay beyond the query's margins while no joint moves by more than s times its weight. The
  /// value is 0 if the configuration itself is not proved free, and inf if no motion can reduce a distance. Ignores
  /// joint limits. Throws as distances().
  /// \param weights (J,) radians and metres, >= 0
  std::vector<double> free_scale(const Query& query, std::span<const double> weights);
  /// Sends a query and returns immediately.
  Pending submit(const Query& query = {});

  /// Applies poses as one snapshot. Throws RequestError, and applies nothing, for a stamp below 0, far ahead of the
  /// daemon's clock, or older than this client's last for one of the bodies.
  /// \param stamp_ns, sequence the caller's clock and its count of updates, returned with replies; 0 for none
  UpdateResult set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns = 0,
                         std::int64_t sequence = 0);
  UpdateResult set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns = 0,
                         std::int64_t sequence = 0);
  /// Sets joint positions by id, radians and metres, and with them the poses of links. Throws RequestError also for a
  /// repeated joint.
  UpdateResult set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns = 0,
                          std::int64_t sequence = 0);
  /// Replaces the points of a cloud atomically, for all queries that start after it returns. `applied` counts points.
  /// Throws RequestError, and replaces nothing, for a body that is no cloud, a coordinate that is not finite, too many
  /// points, and stamps as set_poses() does.
  /// \param xyz (N,) metres, in the body's frame; empty for an empty body
  /// \param radius metres, growth of the points; by default the radius in the scene
  UpdateResult set_points(std::uint32_t body, std::span<const std::array<float, 3>> xyz,
                          std::optional<double> radius = {}, std::int64_t stamp_ns = 0, std::int64_t sequence = 0);
  /// Returns the joints of the scene's robots with their current positions.
  JointsInfo joints();
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
  /// document for tools/check_certificate.py (docs/certificates.md). Throws RequestError, also for a document of more
  /// than 64 MiB.
  /// \param rows row numbers, k P + p for pair p in configuration k; by default all
  std::string certificate(const Query& query = {}, std::optional<std::span<const std::uint64_t>> rows = {});
  /// Opens a query with input and columns in the memory of the daemon's GPU, which this process maps (docs/cuda.md,
  /// "Through the daemon"), over shm:// and ipc://. This library does not need CUDA for it. Throws RequestError, also
  /// without a GPU in the daemon, and beyond its limits on plans and memory.
  /// \param query as for Engine::plan_on_device(), without configurations and positions, which go into that memory
  /// \param configurations K, the number of configurations of each run; 0 for one configuration, the current poses
  RemotePlan plan_on_device(const Query& query, std::uint32_t configurations);
  std::vector<BodyStateInfo> body_states();
  std::vector<std::pair<std::string, std::uint64_t>> stats();
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
  friend class Pending;
  friend class RemotePlan;
  struct Impl;
  explicit Client(std::shared_ptr<Impl> impl);
  Impl& impl() const;
  std::shared_ptr<Impl> impl_;
};

class CLEARANCE_API Pending {
 public:
  Pending(Pending&&) noexcept;
  Pending& operator=(Pending&&) noexcept;
  ~Pending();
  bool ready();                                     ///< polls once; get() throws any error
  bool wait_for(std::chrono::nanoseconds timeout);  ///< as ready(), but waits for at most `timeout`
  Reply get();  ///< waits up to the client's timeout; throws as Client::distances(); call it once

 private:
  friend class Client;
  Pending(std::shared_ptr<Client::Impl> client, std::uint64_t request_id);
  std::shared_ptr<Client::Impl> client_;  // keeps the connection open
  std::uint64_t request_id_ = 0;
  std::unique_ptr<Frame> frame_;  // arrived, not yet fetched
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
