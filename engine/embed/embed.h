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

#include <clearance/mesh_as.h>
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

/// Bad input at set-up, such as a scene file, a mesh or a body. The text names file, line, key and expected value.
struct CLEARANCE_API SceneError : std::runtime_error {
  using std::runtime_error::runtime_error;
};
/// A rejected query or pose update. `code` is one of the first four of wire::ErrorCode (protocol.h).
struct CLEARANCE_API QueryError : std::runtime_error {
  QueryError(std::uint16_t c, const std::string& what) : std::runtime_error(what), code(c) {}
  std::uint16_t code;
};

/// Options of a new body in addition to its shape.
struct BodyOptions {
  double radius = 0;                        ///< added to the shape, in metres
  std::string parent = {};                  ///< name of an existing body that this one follows, or empty
  bool is_static = false;                   ///< never moves
  std::optional<Pose7> X_parent_body = {};  ///< X_world_body without a parent; by default no pose
};

/// A new robot. Paths are of this process; meshes lie beneath the URDF's folder, or in the folders of their packages.
struct RobotOptions {
  std::string urdf;
  std::string srdf = {};                             ///< may be empty
  std::map<std::string, std::string> packages = {};  ///< folder by package, for package://NAME/...
  std::string parent = {};                           ///< body that the base follows, or empty
  Pose7 X_parent_base = {0, 0, 0, 1, 0, 0, 0};       ///< X_world_base without a parent
  bool is_static = false;                            ///< the base never moves
  std::optional<std::map<std::string, double>> home =
      {};                          ///< positions at load, by joint, others at 0; by default no poses
  double padding = 0;              ///< added to the links, in metres
  MeshAs mesh_as = MeshAs::kAuto;  ///< geometry of the links' meshes
};

/// Bodies, groups and ignored pairs. Each add_* returns the body's id, its order of insertion. All throw SceneError for
/// a bad or repeated name or bad geometry.
class CLEARANCE_API Scene {
 public:
  Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;
  ~Scene();

  /// Reads a scene file and its meshes, which must lie in its folder unless `allow_outside`.
  static Scene load(const std::string& path, bool allow_outside = false);

  /// The hull of vertices, in the body's frame.
  std::uint32_t add_hull(const std::string& name, std::span<const std::array<double, 3>> vertices,
                         const BodyOptions& options = {});
  /// Adds a mesh file with MeshAs::kAuto.
  /// \param scale per axis
  /// \param submeshes makes one hull per submesh instead
  std::uint32_t add_mesh(const std::string& name, const std::string& path, std::array<double, 3> scale = {1, 1, 1},
                         bool submeshes = false, const BodyOptions& options = {});
  /// Adds a mesh file with a given kind of geometry.
  std::uint32_t add_mesh(const std::string& name, const std::string& path, std::array<double, 3> scale, MeshAs mesh_as,
                         const BodyOptions& options = {});
  /// Adds a mesh from memory.
  /// \param vertices in the body's frame
  /// \param triangles indices of vertices
  std::uint32_t add_mesh(const std::string& name, std::span<const std::array<double, 3>> vertices,
                         std::span<const std::array<std::uint32_t, 3>> triangles, MeshAs mesh_as,
                         const BodyOptions& options = {});
  std::uint32_t add_box(const std::string& name, std::array<double, 3> size,
                        const BodyOptions& options = {});  ///< full edge lengths
  std::uint32_t add_sphere(const std::string& name, double radius, const BodyOptions& options = {});
  /// Along z; length between the centres of its caps.
  std::uint32_t add_capsule(const std::string& name, double radius, double length, const BodyOptions& options = {});
  /// Along z, from -length / 2 to length / 2.
  std::uint32_t add_cylinder(const std::string& name, double radius, double length, const BodyOptions& options = {});
  /// Along z, with its disc at -length / 2 and its apex at length / 2.
  std::uint32_t add_cone(const std::string& name, double radius, double length, const BodyOptions& options = {});
  std::uint32_t add_ellipsoid(const std::string& name, std::array<double, 3> radii,
                              const BodyOptions& options = {});  ///< half axes
  /// The half-space z <= 0 of its own frame, such as a floor or a wall; always static.
  std::uint32_t add_half_space(const std::string& name, const BodyOptions& options = {});

  /// A robot: a frame NAME that places it, a body NAME/LINK for each link, groups NAME and NAME/GROUP (docs/robots.md).
  void add_robot(const std::string& name, const RobotOptions& options);

  void add_group(const std::string& name, std::span<const std::string> bodies);
  /// Ignores every pair between two bodies or groups. A group with itself means its inner pairs.
  void ignore(const std::string& a, const std::string& b);

 private:
  friend class Engine;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// An answer that owns its columns. Columns not requested are empty.
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
  /// (rows * J,) metres per radian or metre: d distance / d position of each of the query's joints, in their order
  std::span<const double> gradient_joints() const;
  std::span<const IdPair> pair() const;
  std::span<const std::uint32_t> configuration() const;
  std::span<const float> points32() const;
  std::span<const IdPair> pair_lower() const;
  std::span<const double> time() const;           ///< of motions: 0 to 1
  std::span<const double> first_contact() const;  ///< (rows * 2,) of motions; kFieldFirstContact
  std::span<const std::uint32_t> steps() const;   ///< of motions: evaluations of each
  std::span<const double> free_scale() const;     ///< Engine::free_scale()

  std::uint64_t snapshot_revision() const;  ///< of the poses
  std::int64_t snapshot_stamp_ns() const;   ///< newest stamp of the poses, or 0
  std::string_view backend() const;         ///< "cpu", "cuda" or "reference"

 private:
  friend class Engine;
  struct Impl;
  explicit Answer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

struct EngineOptions {
  std::string backend = "auto";   ///< "auto", "cpu", "cuda", or "reference" (brute force)
  int threads = 0;                ///< of one query; 0 for all cores
  std::vector<int> devices = {};  ///< GPUs by number, for the backends cuda and auto; empty for the current one
};

/// Result of a batch of poses, which applies as a whole.
struct PosesSet {
  std::uint64_t revision = 0;  ///< revision of the poses with the update
  std::uint32_t applied = 0;
  std::uint32_t bad = 0;      ///< stored as kBadPose until a good one is received
  std::uint32_t unknown = 0;  ///< ids outside the scene
  std::uint32_t fixed = 0;    ///< static bodies
};

/// A scene and the poses of its bodies. Thread-safe: threads may query and set poses at once, and each answer uses one
/// snapshot. Not usable in the child after a fork.
class CLEARANCE_API Engine {
 public:
  /// Throws std::invalid_argument for an unknown backend, and std::runtime_error for one that is absent or failed the
  /// self-test.
  explicit Engine(Scene scene, const EngineOptions& options = {});
  Engine(Engine&&) noexcept;
  Engine& operator=(Engine&&) noexcept;
  ~Engine();

  std::size_t body_count() const;
  const std::string& body_name(std::uint32_t body) const;  ///< throws std::out_of_range
  std::uint32_t body(std::string_view name) const;         ///< id; throws std::invalid_argument
  std::uint32_t group(std::string_view name) const;  ///< selector; "*" for every body; throws std::invalid_argument
  std::string_view backend() const;

  /// Throws QueryError, and applies nothing, for a stamp below 0, far ahead of this machine's clock, or older than the
  /// last one of a body.
  /// \param stamp_ns the caller's clock, which answers return; 0 for none
  PosesSet set_poses(std::span<const std::pair<std::uint32_t, Pose7>> poses, std::int64_t stamp_ns = 0);
  PosesSet set_poses(std::initializer_list<std::pair<std::string_view, Pose7>> poses, std::int64_t stamp_ns = 0);
  /// Sets joint positions by id, in radians and metres, and so the poses of links. Throws QueryError also for a
  /// repeated joint.
  PosesSet set_joints(std::span<const std::pair<std::uint32_t, double>> positions, std::int64_t stamp_ns = 0);
  /// Ids of the joints of a robot ("panda") or of a group of its SRDF ("panda/panda_arm"); throws
  /// std::invalid_argument.
  std::vector<std::uint32_t> joints(std::string_view group) const;
  std::uint32_t joint(std::string_view name) const;  ///< id of "panda/panda_joint1"; throws std::invalid_argument
  /// Makes `child` follow `parent` from its present pose, or at `X_parent_child`; kNone as parent sets it free. Throws
  /// QueryError for a cycle, a static child, or a body without a pose.
  /// \param allow bodies and groups (selectors) whose pairs with the child are ignored while it is attached
  void attach(std::uint32_t child, std::uint32_t parent, const Pose7* X_parent_child = nullptr,
              std::span<const std::uint32_t> allow = {});
  /// Ignores the pairs of two bodies or groups (selectors), or enables them again, except those of a parent and its
  /// child. Returns the number of changed pairs. Throws QueryError for an unknown selector.
  std::uint32_t allow(std::uint32_t a, std::uint32_t b);
  std::uint32_t forbid(std::uint32_t a, std::uint32_t b);

  /// Throws QueryError for an invalid query. Throws std::invalid_argument for a fractional number of configurations,
  /// and for options of daemons (min_pose_stamp_ns, deadline_ns, ...). A bad pose or an unknown id is a status of its
  /// rows.
  Answer distances(const Query& query = {}) const;
  /// Tests which configurations are free: Reduce::kAny with the query's margins. A configuration that is not proved
  /// free counts as not free. Joint limits are tested as well (Check::ok()). Throws as distances().
  Check check(const Query& query = {}) const;
  /// For each configuration (of joints, without bodies), returns the largest s proved to keep all pairs beyond the
  /// query's margins while no joint moves by more than s times its weight: (K,). It is 0 if the configuration itself is
  /// not proved free, and inf if no pair can come nearer. Joint limits are ignored. Throws as distances().
  /// \param weights (J,) radians and metres, >= 0
  std::vector<double> free_scale(const Query& query, std::span<const double> weights) const;
  /// The pairs of a query, in order.
  std::vector<IdPair> pairs(const Query& query = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clearance::embed
