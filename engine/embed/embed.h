// The engine in a program of one's own, without a daemon: installed as <clearance/engine.h>, target Clearance::engine.
//
//   using namespace clearance::embed;
//   Engine engine(Scene::load("scene.yaml"));
//   engine.set_poses({{"gripper", {0.4, 0, 0.3, 1, 0, 0, 0}}});
//   const Answer answer = engine.distances({.max_distance = 0.5});
//   for (std::size_t i = 0; i < answer.rows(); ++i) use(answer.lower()[i], answer.upper()[i]);
//
// The queries are those of <clearance/client.h>, and the answers have the same columns with the same bits. Metres,
// nanoseconds, right-handed frames.
#pragma once

#include <clearance/convexify.h>
#include <clearance/query.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace clearance::embed {

/// Bad input at set-up: a scene file, a mesh or a body. The text names file, line, key and what was expected.
struct CLEARANCE_API SceneError : std::runtime_error {
  using std::runtime_error::runtime_error;
};
/// A query or a pose update that is refused as a whole. `code` is one of the first four of wire::ErrorCode
/// (protocol.h).
struct CLEARANCE_API QueryError : std::runtime_error {
  QueryError(std::uint16_t c, const std::string& what) : std::runtime_error(what), code(c) {}
  std::uint16_t code;
};

/// What a new body may have beside its shape.
struct BodyOptions {
  double radius = 0;                        ///< metres, grows the shape
  std::string parent = {};                  ///< name of a body already there, which this one follows; empty: none
  bool is_static = false;                   ///< never moves
  std::optional<Pose7> X_parent_body = {};  ///< X_world_body without a parent; none: no pose until one is set
};

/// A robot to be added. Paths are of this process; meshes lie beside the URDF, or in the folders of their packages.
struct RobotOptions {
  std::string urdf;
  std::string srdf = {};                                   ///< empty: none
  std::map<std::string, std::string> packages = {};        ///< folder by package, for package://NAME/...
  std::string parent = {};                                 ///< body that the base follows; empty: none
  Pose7 X_parent_base = {0, 0, 0, 1, 0, 0, 0};             ///< X_world_base without a parent
  bool is_static = false;                                  ///< the base never moves
  std::optional<std::map<std::string, double>> home = {};  ///< positions at load, by joint, others at 0; none: no poses
  double padding = 0;                                      ///< metres, grows the links
  Convexify convexify = Convexify::kAuto;                  ///< what the bodies of the links' meshes are
};

/// Bodies, groups, and pairs that are not asked about. Each add_* returns the body's id: its place in the order of
/// arrival. All throw SceneError for a bad or repeated name or bad geometry.
class CLEARANCE_API Scene {
 public:
  Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;
  ~Scene();

  /// Reads a scene file and the meshes that it names; they must lie in its folder, unless `allow_outside`.
  static Scene load(const std::string& path, bool allow_outside = false);

  /// The hull of vertices, in the body's frame.
  std::uint32_t add_hull(const std::string& name, std::span<const std::array<double, 3>> vertices,
                         const BodyOptions& options = {});
  /// A mesh file: what it is is found out (Convexify::kAuto). \param scale per axis. \param submeshes one hull for each
  /// submesh instead.
  std::uint32_t add_mesh(const std::string& name, const std::string& path, std::array<double, 3> scale = {1, 1, 1},
                         bool submeshes = false, const BodyOptions& options = {});
  /// The same where it is said what the mesh is.
  std::uint32_t add_mesh(const std::string& name, const std::string& path, std::array<double, 3> scale,
                         Convexify convexify, const BodyOptions& options = {});
  /// A mesh of the caller's. \param vertices in the body's frame. \param triangles of places among them.
  std::uint32_t add_mesh(const std::string& name, std::span<const std::array<double, 3>> vertices,
                         std::span<const std::array<std::uint32_t, 3>> triangles, Convexify convexify,
                         const BodyOptions& options = {});
  std::uint32_t add_box(const std::string& name, std::array<double, 3> size,
                        const BodyOptions& options = {});  ///< full edge lengths
  std::uint32_t add_sphere(const std::string& name, double radius, const BodyOptions& options = {});
  /// Along z; length between the centres of its caps.
  std::uint32_t add_capsule(const std::string& name, double radius, double length, const BodyOptions& options = {});
  /// Along z, from -length / 2 to length / 2.
  std::uint32_t add_cylinder(const std::string& name, double radius, double length, const BodyOptions& options = {});
  /// Along z: a disc at -length / 2, the apex at length / 2.
  std::uint32_t add_cone(const std::string& name, double radius, double length, const BodyOptions& options = {});
  std::uint32_t add_ellipsoid(const std::string& name, std::array<double, 3> radii,
                              const BodyOptions& options = {});  ///< half axes
  /// The half-space z <= 0 of its own frame, as a floor or a wall; static, whatever the options say.
  std::uint32_t add_half_space(const std::string& name, const BodyOptions& options = {});

  /// A robot: a frame NAME that places it, a body NAME/LINK for each link, groups NAME and NAME/GROUP (docs/robots.md).
  void add_robot(const std::string& name, const RobotOptions& options);

  void add_group(const std::string& name, std::span<const std::string> bodies);
  /// Leaves out every pair between two bodies or groups (a group with itself: its inner pairs).
  void ignore(const std::string& a, const std::string& b);

 private:
  friend class Engine;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// An answer, which owns its columns. A column that was not asked for is empty.
class CLEARANCE_API Answer {
 public:
  Answer(Answer&&) noexcept;
  Answer& operator=(Answer&&) noexcept;
  ~Answer();

  std::size_t rows() const;
  std::uint64_t total() const;           ///< Reduce::kWithin: pairs found, including those past max_results
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
  /// (rows * J,) metres a radian or metre: d distance / d position of each of the query's joints, in their order
  std::span<const double> gradient_joints() const;
  std::span<const IdPair> pair() const;
  std::span<const std::uint32_t> configuration() const;
  std::span<const CompactAnswer> compact() const;
  std::span<const IdPair> pair_lower() const;
  std::span<const double> time() const;           ///< of motions: 0 to 1
  std::span<const double> first_contact() const;  ///< (rows * 2,) of motions; kFieldFirstContact
  std::span<const std::uint32_t> steps() const;   ///< of motions: configurations that each asked for
  std::span<const double> free_scale() const;     ///< Engine::free_scale()

  std::uint64_t snapshot_revision() const;  ///< of the poses
  std::int64_t snapshot_stamp_ns() const;   ///< the newest stamp among them; 0: none
  std::string_view backend() const;         ///< that answered: "cpu", "cuda" or "reference"

 private:
  friend class Engine;
  struct Impl;
  explicit Answer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

struct EngineOptions {
  std::string backend = "auto";   ///< "auto", "cpu", "cuda", or "reference" (brute force)
  int threads = 0;                ///< of one query; 0: all cores
  std::vector<int> devices = {};  ///< GPUs by number, for the backends cuda and auto; none: the current one
};

/// What became of a batch of poses, which applies as a whole.
struct PosesSet {
  std::uint64_t revision = 0;  ///< of the poses that hold the update
  std::uint32_t applied = 0;
  std::uint32_t bad = 0;      ///< stored, and answered kBadPose until a good one comes
  std::uint32_t unknown = 0;  ///< ids outside the scene
  std::uint32_t fixed = 0;    ///< static bodies
};

/// A scene and the poses of its bodies. Thread-safe: several threads may ask and set poses at once; each answer is of
/// one moment's poses. Not to be used after a fork in the child.
class CLEARANCE_API Engine {
 public:
  /// Throws std::invalid_argument for an unknown backend, std::runtime_error for one that this machine has not, or that
  /// the self-test found wrong.
  explicit Engine(Scene scene, const EngineOptions& options = {});
  Engine(Engine&&) noexcept;
  Engine& operator=(Engine&&) noexcept;
  ~Engine();

  std::size_t body_count() const;
  const std::string& body_name(std::uint32_t body) const;  ///< throws std::out_of_range
  std::uint32_t body(std::string_view name) const;         ///< id; throws std::invalid_argument
  std::uint32_t group(std::string_view name) const;        ///< selector; "*": every body; throws std::invalid_argument
  std::string_view backend() const;

  /// \param stamp_ns the caller's clock, which answers then carry; 0: none. Throws QueryError, and applies nothing, for
  /// a stamp below 0, far ahead of this machine's clock, or older than the last for one of the bodies.
  PosesSet set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns = 0);
  PosesSet set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns = 0);
  /// The same of joints, by id, radians and metres: poses of links follow. Throws QueryError also for one named twice.
  PosesSet set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns = 0);
  /// Ids of the joints of a robot ("panda") or of a group of its SRDF ("panda/panda_arm"); throws
  /// std::invalid_argument.
  std::vector<std::uint32_t> joints(std::string_view group) const;
  std::uint32_t joint(std::string_view name) const;  ///< id of "panda/panda_joint1"; throws std::invalid_argument
  /// Makes `child` follow `parent` from where it is, or at `X_parent_child`; kNone as parent sets it free. Throws
  /// QueryError for a cycle, a static child, or a body without a pose.
  /// \param allow bodies and groups (selectors) that the child may touch while it is attached so.
  void attach(std::uint32_t child, std::uint32_t parent, const Pose7* X_parent_child = nullptr,
              std::span<const std::uint32_t> allow = {});
  /// Leaves the pairs of a body or group (selectors) with another out of the enabled ones, or brings them back, but for
  /// those of a parent and its child. Returns how many pairs have changed. Throws QueryError for an unknown selector.
  std::uint32_t allow(std::uint32_t a, std::uint32_t b);
  std::uint32_t forbid(std::uint32_t a, std::uint32_t b);

  /// Throws QueryError for a query that cannot be answered, std::invalid_argument for poses that are no whole number of
  /// configurations and for options that are a daemon's (min_pose_stamp_ns, deadline_ns, ...). A bad pose
  /// or an unknown id is a status of its rows.
  Answer distances(const Query& query = {}) const;
  /// Which configurations are free: Reduce::kAny with the query's margins. What is not proved is not free. Joint limits
  /// are looked at too (Check::ok()). Throws as distances().
  Check check(const Query& query = {}) const;
  /// How far joints may move from each configuration (of joints, no bodies): the largest s that is proved such that all
  /// pairs stay beyond the query's margins while no joint moves by more than s times its weight. 0: not even the
  /// configuration itself is proved free; inf: nothing that moves can come nearer. Joint limits are not looked at.
  /// \param weights (J,) radians and metres, >= 0. Returns (K,). Throws as distances().
  std::vector<double> free_scale(const Query& query, std::span<const double> weights) const;
  /// The pairs that a query answers, in order.
  std::vector<IdPair> pairs(const Query& query = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clearance::embed
