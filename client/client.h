// The C++ client: the same calls over shared memory, ZeroMQ and LCM.
//
//   auto client = clearance::connect("shm:///run/user/1000/clearance.sock");
//   client.set_poses({{"base", {0, 0, 0, 1, 0, 0, 0}}});
//   auto reply = client.distances({.max_distance = 0.5});
//   for (std::size_t i = 0; i < reply.rows(); ++i) use(reply.lower()[i], reply.upper()[i]);
#pragma once

#include <clearance/convexify.h>
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

/// The daemon cannot be reached, is gone, or did not answer in time.
struct CLEARANCE_API ConnectionError : std::runtime_error {
  using std::runtime_error::runtime_error;
};
struct CLEARANCE_API TimeoutError : ConnectionError {
  using ConnectionError::ConnectionError;
};
/// The daemon refused a request; `code` is a wire::ErrorCode.
struct CLEARANCE_API RequestError : std::runtime_error {
  RequestError(std::uint16_t c, const std::string& what) : std::runtime_error(what), code(c) {}
  std::uint16_t code;
};

/// The daemon was started anew, or is another one, since this client's first contact: what clients had sent it (poses,
/// attachments, bodies) is gone. Requests are refused so until Client::acknowledge_epoch().
struct CLEARANCE_API NewEpoch : RequestError {
  using RequestError::RequestError;
};
/// The daemon is there, but its loop stood still for ConnectOptions::hang while a request was under way.
struct CLEARANCE_API DaemonHung : ConnectionError {
  using ConnectionError::ConnectionError;
};

class Frame;

/// An answer. Columns are views into the frame that arrived (over shared memory: a slot, given back on destruction). A
/// column that was not asked for is empty.
class CLEARANCE_API Reply {
 public:
  explicit Reply(std::unique_ptr<Frame> frame);  ///< of type kReply; throws ConnectionError if it is malformed
  Reply(Reply&&) noexcept;
  Reply& operator=(Reply&&) noexcept;
  ~Reply();

  std::size_t rows() const;
  std::uint64_t total() const;           ///< kWithin: pairs found, including those past max_results
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
  std::span<const double> gradient() const;       ///< (rows * 12,); order and frame: kFieldGradient
  std::span<const IdPair> pair() const;
  std::span<const std::uint32_t> configuration() const;
  std::span<const CompactAnswer> compact() const;
  /// (rows * joints(),) metres a radian or metre: d distance / d position of each of the query's joints, in their
  /// order; 0 where the bodies overlap without a depth being asked for, NaN without witness points. Flag nonsmooth: one
  /// of several.
  std::span<const double> gradient_joints() const;
  std::uint32_t joints() const;  ///< J with gradient_joints, else 0
  std::span<const IdPair> pair_lower() const;
  std::span<const double> time() const;           ///< of motions: 0 to 1
  std::span<const double> first_contact() const;  ///< (rows * 2,) of motions; kFieldFirstContact
  std::span<const float> bounds() const;          ///< (rows, 2) lower and upper, metres, rounded outward
  std::span<const double> free_scale() const;     ///< Client::free_scale()
  std::span<const std::uint32_t> steps() const;   ///< of motions: configurations that each asked for

  std::uint64_t epoch() const;  ///< of the daemon that answered; 0: the reply names none
  std::uint64_t scene_revision() const;
  std::uint64_t snapshot_revision() const;
  std::int64_t snapshot_stamp_ns() const;  ///< publisher's clock: the newest stamp among the poses
  std::int64_t snapshot_sequence() const;  ///< its publisher's count of the update with that stamp; 0: not counted
  /// Age of the oldest of all poses when the query began, from its receipt by the daemon; -1: none was received.
  std::int64_t pose_age_ns() const;
  std::uint64_t engine_ns() const;
  std::uint64_t server_ns() const;
  std::string_view backend() const;

 private:
  template <class T>
  std::span<const T> column(Field field, std::size_t width) const;
  std::unique_ptr<Frame> frame_;
  std::uint64_t epoch_ = 0;
  std::uint64_t rows_ = 0;  // copies: what was checked is what is used
  std::uint32_t fields_ = 0, joints_ = 0;
};

struct BodyInfo {
  std::string name;
  std::uint32_t parent = kNone;
  bool is_static = false;
  std::uint32_t piece_count = 0;
  std::uint64_t vertex_count = 0;
  double model_error = 0;  ///< metres: how far the pieces may stand out from the shape they were asked for
  double extent = 0;       ///< metres: farthest point from the body's origin
  double hull_excess = 0;  ///< metres: no point of a piece is farther from its mesh; 0: a convex body
  double empty_share = 0;  ///< of the pieces' volume that the mesh leaves empty; NaN for one that is not closed
  std::uint64_t triangle_count = 0;  ///< of a surface or solid, which its pieces only surround; 0: it is its pieces
  bool is_solid = false;             ///< with triangles: it is what they enclose, and not they alone
  bool is_cloud = false;             ///< it is points, which set_points() replaces
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
  std::int64_t age_ns = -1;  ///< since the daemon received it; -1: never received
};
/// A joint of one of the scene's robots; its id is its place in JointsInfo::joints.
struct JointInfo {
  std::string name;                 ///< "panda/panda_joint1"
  double lower = 0, upper = 0;      ///< radians or metres; infinite: no limit
  double position = 0;              ///< meaningful if status is kOk
  Status status = Status::kNoPose;  ///< kOk, kNoPose (it has no position) or kBadPose
  bool beyond_limits = false;
  std::int64_t stamp_ns = 0;
  std::int64_t age_ns = -1;  ///< since the daemon received it; -1: never received
};
/// A robot's joints by its name, or those of a group of its SRDF, "panda/panda_arm".
struct JointGroupInfo {
  std::string name;
  std::vector<std::uint32_t> joints;  ///< ids, ascending
};
struct JointsInfo {
  std::uint64_t scene_revision = 0;
  std::vector<JointInfo> joints;
  std::vector<JointGroupInfo> groups;
};
struct PosesDone {
  std::uint64_t revision = 0;  ///< pose revision that holds the update
  std::uint64_t scene_revision = 0;
  std::uint32_t applied = 0, bad = 0, unknown = 0, fixed = 0;
};

/// A body to add while the daemon runs. Exactly one shape: the hull of `vertices` (body frame), with `triangles` a mesh
/// of them, a primitive, or a cloud of `points`.
struct NewBody {
  std::string name;
  std::span<const std::array<double, 3>> vertices = {};  ///< metres
  std::optional<std::array<double, 3>> box = {};         ///< full edge lengths, metres
  std::optional<double> sphere = {};                     ///< radius, metres
  std::optional<std::array<double, 2>> capsule = {};     ///< radius, length between the centres of its caps; along z
  std::optional<std::array<double, 2>> cylinder = {};    ///< radius, length; along z
  std::optional<std::array<double, 2>> cone = {};        ///< radius, length; along z, its apex ahead
  std::optional<std::array<double, 3>> ellipsoid = {};   ///< half axes, metres
  bool half_space = false;                               ///< all of z <= 0; static, without a parent
  double radius = 0;                                     ///< metres, grows the shape
  std::uint32_t parent = kNone;                          ///< body that it follows
  std::optional<Pose7> pose = {};                        ///< X_world_body, with a parent X_parent_body
  bool is_static = false;
  // What is not known of it, as a scene file says it; a daemon that does not know of these refuses them.
  double uncertainty_position = 0;  ///< metres: its origin lies within a ball of this radius about its place
  double uncertainty_angle = 0;     ///< radians: it may be turned by up to this about its origin
  double padding = 0;               ///< metres that it is grown by, beside `radius`
  double max_speed = 0;             ///< metres a second that no point of it exceeds
  // A mesh, which a daemon that does not know of it refuses.
  std::span<const std::array<std::uint32_t, 3>> triangles = {};  ///< of places in `vertices`; a solid's are closed
  Convexify convexify = Convexify::kAuto;  ///< what the mesh is; kAuto: found out. kSubmeshes is the same as kHull
  /// Metres: a cloud, which set_points() replaces. None in it: nothing is there yet.
  std::optional<std::span<const std::array<float, 3>>> points = {};
  double voxel = 0;  ///< metres, of a cloud: above 0 it is the boxes of this edge about the points
};

/// The scene that replaced another.
struct SceneChanged {
  std::uint64_t scene_revision = 0;
  std::uint32_t body_count = 0;
  std::uint32_t body = kNone;  ///< after add_body(): the new body
  double seconds = 0;          ///< time that making the scene took
};

/// Where a plan's column lies in its memory.
struct PlanColumn {
  Field field{};
  std::uint32_t row_bytes = 0;
  std::uint64_t offset = 0;  ///< a multiple of 64
};

/// A plan in the memory of a daemon's GPU, as another process maps it: by cudaIpcOpenMemHandle(), on the device of that
/// UUID, whose number may be another one here. Offsets are into that memory, which is the daemon's.
struct PlanInfo {
  std::uint64_t number = 0;                   ///< for who speaks the wire himself
  std::array<std::byte, 64> memory_handle{};  ///< cudaIpcMemHandle_t
  std::array<std::byte, 16> device_uuid{};    ///< cudaUUID_t
  std::uint64_t memory_bytes = 0;
  std::uint64_t poses_offset = 0;               ///< (K, M) Pose7 of the query's bodies; meaningful if bodies > 0
  std::uint64_t positions_offset = 0;           ///< (K, J) float64, radians and metres; meaningful if joints > 0
  std::uint32_t bodies = 0, joints = 0;         ///< M, J
  std::uint64_t rows = 0;                       ///< of each column: K P, of a reduction K
  std::uint64_t configurations = 0, pairs = 0;  ///< K (1 of the current poses), P
  std::vector<PlanColumn> columns;              ///< in the order of Field
  std::uint64_t scene_revision = 0;             ///< of the scene that it keeps, with the poses of then of what
  std::uint64_t snapshot_revision = 0;          ///< it does not move, of this revision

  /// Throws std::invalid_argument for a column that it does not have.
  const PlanColumn& column(Field field) const;
};

/// What a run came to.
struct PlanRun {
  std::uint64_t snapshot_revision = 0;  ///< of the poses that the daemon has now, which need not be the plan's
  std::chrono::nanoseconds took{0};     ///< on the daemon's side, from the first launch until its rows were there
};

/// A plan that this client has open; it ends with this, with the client's connection, and by close(). Not thread-safe,
/// as its client, of which it is one user.
class CLEARANCE_API RemotePlan {
 public:
  RemotePlan(RemotePlan&&) noexcept;
  RemotePlan& operator=(RemotePlan&&) noexcept;
  ~RemotePlan();  ///< close(), without waiting for it

  const PlanInfo& info() const { return info_; }
  /// Has the daemon answer from the poses and positions that are in the memory, and returns once the rows are there:
  /// whoever writes them must have waited for his stream. Throws as Client::distances(), RequestError (kWrongScene) if
  /// the daemon has another scene than the plan's, and (kBusy) while an earlier run, which timed out here, is under
  /// way.
  /// \param timeout for this call; none: the client's. \param check_scene false: answers for the plan's scene,
  /// whichever the daemon has
  PlanRun run(std::optional<std::chrono::nanoseconds> timeout = {}, bool check_scene = true);
  /// Unmap the memory first: it goes. Throws as run().
  void close();

 private:
  friend class Client;
  struct Connection;
  explicit RemotePlan(std::shared_ptr<Connection> connection, PlanInfo info);
  std::shared_ptr<Connection> connection_;
  PlanInfo info_;
};

/// A request that is under way. Destroying it unread forgets the reply.
class Pending;

struct ConnectOptions;

/// Not thread-safe: one client per thread. After a fork the child must connect again (calls throw).
///
/// When a daemon goes away the caller learns it: calls and replies under way throw ConnectionError (over LCM
/// TimeoutError or DaemonHung), at least one of them. The next call connects again to whoever serves the url then, or
/// the next url of the list, or throws ConnectionError at once if nobody does. Whoever serves there is not the daemon
/// that this client knew: each call throws NewEpoch, until acknowledge_epoch(). Poses, attachments and bodies that
/// clients had sent are lost with the old daemon.
class CLEARANCE_API Client {
 public:
  using Duration = std::chrono::nanoseconds;

  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;
  ~Client();

  /// Answers a query. Throws TimeoutError, ConnectionError, RequestError.
  Reply distances(const Query& query = {});
  /// Which configurations are free: Reduce::kAny with the query's margins. What is not proved is not free. Joint limits
  /// are looked at too (Check::ok()); they are fetched once, without configurations after each change of poses.
  Check check(const Query& query = {});
  /// How far joints may move from each configuration (of joints, no bodies): the largest s that is proved such that all
  /// pairs stay beyond the query's margins while no joint moves by more than s times its weight. 0: not even the
  /// configuration itself is proved free; inf: nothing that moves can come nearer. Joint limits are not looked at.
  /// \param weights (J,) radians and metres, >= 0. Returns (K,). Throws as distances().
  std::vector<double> free_scale(const Query& query, std::span<const double> weights);
  /// Sends a query and returns at once.
  Pending submit(const Query& query = {});

  /// \param stamp_ns, sequence the caller's clock and its count of updates, which replies then carry; 0: none. Throws
  /// RequestError, and applies nothing, for a stamp below 0, far ahead of the daemon's clock, or older than this
  /// client's last for one of the bodies.
  PosesDone set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns = 0,
                      std::int64_t sequence = 0);
  PosesDone set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns = 0,
                      std::int64_t sequence = 0);
  /// The same of joints, by id, radians and metres: poses of links follow from them. Throws RequestError also for a
  /// joint that is named twice.
  PosesDone set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns = 0,
                       std::int64_t sequence = 0);
  /// Replaces the points of a body of points, all at once: queries that begin when this has returned see them all.
  /// \param xyz (N,) metres, the body's frame; none: there is nothing. \param radius metres, that they are grown by;
  /// none: as the scene has it. `applied` counts points. Throws RequestError, and nothing is replaced, for another
  /// body, a coordinate that is not finite, more points than may be, and stamps as set_poses() does.
  PosesDone set_points(std::uint32_t body, std::span<const std::array<float, 3>> xyz, std::optional<double> radius = {},
                       std::int64_t stamp_ns = 0, std::int64_t sequence = 0);
  /// The joints of the scene's robots, and where they are now.
  JointsInfo joints();
  /// \param allow bodies and groups (selectors) that the child may touch while it is attached so: their pairs with it
  /// are not among the enabled ones until it is attached anew or set free.
  PosesDone attach(std::uint32_t child, std::uint32_t parent, const Pose7* X_parent_child = nullptr,
                   std::span<const std::uint32_t> allow = {});
  /// Leaves the pairs of a body or group (selectors) with another out of the enabled ones, or brings them back, but for
  /// those of a parent and its child. `applied` counts the pairs that have changed. Throws RequestError.
  PosesDone allow(std::uint32_t a, std::uint32_t b);
  PosesDone forbid(std::uint32_t a, std::uint32_t b);

  /// Makes the daemon load its scene file again and waits until the new scene is in. Queries go on meanwhile; poses and
  /// attachments stay with the bodies of the same names. If loading fails the old scene stays, and this throws
  /// RequestError with the loader's message. \param timeout for this call alone.
  SceneChanged reload(Duration timeout = std::chrono::minutes(10));

  /// Adds a body (a grasped object, say), and waits until the scene has it. Its id comes after those of the other
  /// bodies, which keep their ids and poses. Queries under way are answered for the scene they began with. Throws
  /// RequestError for a name that is taken, a shape that cannot be made, or too many bodies; std::invalid_argument
  /// unless there is exactly one shape.
  SceneChanged add_body(const NewBody& body);
  /// Removes a body that add_body() added; bodies added after it get other ids. Throws RequestError for any other body,
  /// and for one that another follows.
  SceneChanged remove_body(std::string_view name);

  /// The scene that this client's ids belong to. It is fetched once, and again after a refusal with kWrongScene or a
  /// change that this client made; the reference is valid until then. Once fetched, requests with ids are for that
  /// scene: if another client or reload changes it, they are refused with kWrongScene until scene(), refresh(), body()
  /// or group() is called. After a change that this client made they go on, if every old id still means the same body.
  const SceneInfo& scene();
  void refresh();                                      ///< fetches the scene again
  std::uint32_t body(std::string_view name);           ///< id; throws std::invalid_argument naming near misses
  std::uint32_t group(std::string_view name);          ///< selector; "*": every body
  std::vector<IdPair> pairs(const Query& query = {});  ///< the pairs a query answers, in order
  /// Has rows of a query (k P + p for pair p in configuration k; of reduce none) answered anew, each with what proves
  /// its bounds: a document (JSON) that tools/check_certificate.py checks (docs/certificates.md). Throws RequestError,
  /// also for a document of more than 64 MiB. \param rows none: all
  std::string certificate(const Query& query = {}, std::optional<std::span<const std::uint64_t>> rows = {});
  /// A query that the daemon's GPU answers from poses and joint positions in its memory to columns in its memory, as
  /// often as it is asked, and that this process maps (docs/cuda.md, "Through the daemon"): over shm:// and ipc://.
  /// This library needs no CUDA for that. The query is as Engine::plan_on_device() takes it. Throws RequestError, also
  /// where the daemon has no GPU, and for more plans and memory than it gives.
  /// \param query without configurations and positions, which go into that memory. \param configurations K, that each
  /// run has; 0: the current poses, answered as one
  RemotePlan plan_on_device(const Query& query, std::uint32_t configurations);
  std::vector<BodyStateInfo> body_states();
  std::vector<std::pair<std::string, std::uint64_t>> stats();
  Duration ping(std::span<const std::byte> payload = {});  ///< a bare echo through the daemon

  /// Which run of the daemon this client's requests are for: the one that it met when it connected, or that was
  /// acknowledged last. 0: that daemon names none.
  std::uint64_t epoch() const;
  /// Goes on with the daemon that serves now, whichever it is, and returns its epoch. After NewEpoch: then send poses,
  /// attachments and bodies again. Throws ConnectionError, also if this client's daemon is gone and several others
  /// answer (LCM).
  std::uint64_t acknowledge_epoch();

  void set_timeout(Duration timeout);  ///< for every call; default 5 s
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
  bool ready();                                     ///< polls once; errors are thrown by get()
  bool wait_for(std::chrono::nanoseconds timeout);  ///< as ready(), but waits for at most so long
  Reply get();  ///< call it once: waits up to the client's timeout; throws as Client::distances()

 private:
  friend class Client;
  Pending(std::shared_ptr<Client::Impl> client, std::uint64_t request_id);
  std::shared_ptr<Client::Impl> client_;  // the connection lasts as long as its requests
  std::uint64_t request_id_ = 0;
  std::unique_ptr<Frame> frame_;  // arrived, not yet fetched
};

struct ConnectOptions {
  std::chrono::nanoseconds timeout = std::chrono::seconds(5);
  /// For a daemon that listens on TCP with keys: the files of its public key and of this client's own key pair, as
  /// `clearance keygen` writes them. Empty: those of the url ("?server_key=FILE&key=FILE"), else of the environment
  /// (CLEARANCE_SERVER_KEY, CLEARANCE_KEY), else no keys.
  std::string server_key = {}, key = {};
  /// How long the daemon's loop may stand still while a request is under way: calls then throw DaemonHung, after a
  /// quarter more at most. 10 ms or more; 0: only the timeout ends a call. None: 1 s, or a fifth of `timeout` if that
  /// is more.
  std::optional<std::chrono::nanoseconds> hang = {};
};

/// Connects. "shm:///run/user/0/clearance.sock", "ipc:///path", "tcp://host:port",
/// "udpm://239.255.76.67:7667?ttl=0" (an LCM url; "&prefix=NAME_" sets the channels' prefix).
/// Throws ConnectionError naming url and cause, over LCM also if several daemons answer; std::invalid_argument for a
/// url of no known kind.
CLEARANCE_API Client connect(const std::string& url, std::chrono::nanoseconds timeout = std::chrono::seconds(5));
CLEARANCE_API Client connect(const std::string& url, const ConnectOptions& options);
/// Connects to the first of these that answers, and goes on to the next, round and round, when one is gone or hung.
/// Nothing is carried over: the next one is another daemon (NewEpoch). Each but the last is given as long as
/// ConnectOptions::hang.
CLEARANCE_API Client connect(std::span<const std::string> urls, const ConnectOptions& options);

}  // namespace clearance
