// A scene of bodies to be loaded or built in a program; an Engine answers queries on it.
#pragma once

#include <clearance/errors.h>
#include <clearance/mesh_as.h>
#include <clearance/query.h>
#include <clearance/scene_info.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace clearance {

/// Options of a new body in addition to its shape.
struct BodyOptions {
  double radius = 0;                        ///< added to the shape, in metres
  std::string parent = {};                  ///< name of an existing body that this one follows, or empty
  bool is_static = false;                   ///< never moves
  std::optional<Pose7> X_parent_body = {};  ///< X_world_body without a parent; by default no pose
  bool requires_pose = false;               ///< ignores X_parent_body: without a pose until one is set
  double uncertainty_position = 0;          ///< metres: radius of a ball around its position that contains its origin
  double uncertainty_angle = 0;             ///< radians: bound on its rotation error about its origin
  double padding = 0;                       ///< metres of growth, in addition to `radius`
  double max_speed = 0;                     ///< metres per second: bound on the speed of its points
};

/// Bounds on the pose error of a link alone, not of its children.
struct LinkUncertainty {
  double position = 0, angle = 0;  ///< metres, radians
};

/// A new robot. Paths are of this process; meshes lie beneath the URDF's folder, or in the folders of their packages.
struct RobotOptions {
  std::string urdf;
  std::string srdf = {};                             ///< may be empty
  std::map<std::string, std::string> packages = {};  ///< folder by package, for package://NAME/...
  std::string parent = {};                           ///< body that the base follows, or empty
  Pose7 X_parent_base = {0, 0, 0, 1, 0, 0, 0};       ///< X_world_base without a parent
  bool is_static = false;                            ///< the base never moves
  bool visual = false;                               ///< uses the shapes of `visual` instead of `collision`
  /// Positions at load, by joint, others at 0; by default the links have no poses.
  std::optional<std::map<std::string, double>> home = {};
  std::string home_state = {};                      ///< state of the SRDF, instead of `home`, or empty
  double padding = 0;                               ///< added to the links, in metres
  std::map<std::string, double> link_padding = {};  ///< by link, instead of `padding`
  std::map<std::string, LinkUncertainty> link_uncertainty = {};
  MeshAs mesh_as = MeshAs::kAuto;                   ///< geometry of the links' meshes
  std::map<std::string, MeshAs> link_mesh_as = {};  ///< by link, instead of `mesh_as`
};

/// Bodies, groups and ignored pairs. Each add_* returns the body's id, its order of insertion. All throw SceneError for
/// a bad or repeated name or bad geometry.
class CLEARANCE_API Scene {
 public:
  Scene();
  Scene(const Scene&);
  Scene& operator=(const Scene&);
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;
  ~Scene();

  /// Reads a scene file and its meshes, which must lie in its folder unless `allow_outside`, or a URDF.
  static Scene load(const std::string& path, bool allow_outside = false);
  /// Writes the scene into an empty or new folder. Loaded again, it gives the same ids, pairs and answers, bit for bit.
  void save(const std::string& folder) const;

  /// The hull of vertices, in the body's frame.
  std::uint32_t add_hull(const std::string& name, std::span<const std::array<double, 3>> vertices,
                         const BodyOptions& options = {});
  /// Adds a mesh file.
  /// \param scale per axis
  std::uint32_t add_mesh(const std::string& name, const std::string& path, std::array<double, 3> scale = {1, 1, 1},
                         MeshAs mesh_as = MeshAs::kAuto, const BodyOptions& options = {});
  /// Adds a mesh from memory.
  /// \param vertices in the body's frame
  /// \param triangles indices of vertices
  std::uint32_t add_mesh(const std::string& name, std::span<const std::array<double, 3>> vertices,
                         std::span<const std::array<std::uint32_t, 3>> triangles, MeshAs mesh_as,
                         const BodyOptions& options = {});
  /// Adds a cloud, which Engine::set_points() replaces. No points make an empty body.
  /// \param voxel metres; above 0, boxes of this edge around the points are the body
  std::uint32_t add_points(const std::string& name, std::span<const std::array<float, 3>> points, double voxel = 0,
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

  /// A robot: a frame NAME that places it, a body NAME/LINK for each link, groups NAME and NAME/GROUP
  /// (docs/models/robots.md).
  void add_robot(const std::string& name, const RobotOptions& options);

  void add_group(const std::string& name, std::span<const std::string> bodies);
  /// Ignores every pair between two bodies or groups. A group with itself means its inner pairs.
  void ignore(const std::string& a, const std::string& b);

  std::vector<BodyInfo> bodies() const;  ///< by id
  std::vector<GroupInfo> groups() const;
  std::uint64_t revision() const;             ///< digest of the scene
  std::vector<std::string> warnings() const;  ///< probable mistakes in the scene file, each with its place

 private:
  friend class Engine;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace clearance
