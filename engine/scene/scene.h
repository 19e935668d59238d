// The scene: bodies, groups and enabled pairs. Built once, then immutable and shared.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "engine/base/body_pair.h"
#include "engine/base/triangle.h"
#include "engine/bvh/cloud_point.h"
#include "engine/geometry/geometry.h"
#include "engine/geometry/scene_error.h"
#include "engine/pose/pose.h"
#include "engine/scene/scene_robot.h"
#include "wire/types.h"

namespace clearance {

class MeshGeometries;  // engine/geometry/mesh_geometry.h
class RobotAdder;      // engine/scene/scene_robot.cpp
struct MeshRecipe;     // engine/geometry/make_geometry.h
struct Shape;          // engine/hull/shapes.h

/// A body of the scene. The points of a cloud may be replaced (Engine::set_points()).
struct Body : Geometry {
  std::string name;
  std::uint32_t parent = kNone;  ///< body that this one follows at load
  bool is_static = false;        ///< never moves after load
  bool requires_pose = false;    ///< ignores `pose`: no_pose until a pose is received
  std::uint32_t robot = kNone;   ///< index into Scene::robots() of the robot whose joints place it
  std::uint32_t link = kNone;    ///< index of its link in that robot
  std::optional<Pose> pose;      ///< initial X_wb, or X_pb with a parent; without one no_pose until a pose is received
  Uncertainty uncertainty;
  double padding = 0;     ///< added to the parts' radius, in metres
  bool is_grown = false;  ///< the parts include `padding` and the uncertainty of position already; set by Scene
  double max_speed = 0;   ///< bound on the speed of its points and of bodies that follow it, in metres per second
  double reach = 0;       ///< bound on the distance of the parts from the origin, in metres; set by Scene
};

/// Whether the body's shape or place is uncertain.
bool has_uncertainty(const Body& body);
/// Whether it is a cloud of points or voxels, also if it has no points.
inline bool is_cloud(const Body& body) {
  return body.cloud != CloudState::kNoCloud;
}
/// Whether the body is a cloud, or a part of it is a surface or solid.
bool has_surface(const Body& body);
/// The first surface or solid of a body, or null if the body is the union of its convex parts.
const Surface* surface_of(const Body& body);
/// Triangles of all its surfaces and solids.
std::uint64_t triangle_count(const Body& body);
/// Points of a cloud.
std::uint64_t point_count(const Body& body);
/// Error text for a pose given to a link that joints place.
std::string placed_by_joints(const Body& body);

struct Group {
  std::string name;
  std::vector<std::uint32_t> bodies;  ///< ids, ascending
};

namespace engine {

/// Content of a scene, without caches for adding bodies.
class SceneContent {
 protected:
  std::vector<Body> bodies_;
  bool has_uncertainties_ = false, has_surfaces_ = false;
  std::vector<Group> groups_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> ignored_;
  std::vector<std::shared_ptr<const SceneRobot>> robots_;
  std::vector<SceneJoint> joints_;
  std::vector<JointGroup> joint_groups_;
  std::unordered_map<std::string, std::uint32_t> joint_ids_;
  std::unordered_map<std::string, std::uint32_t> body_ids_;
  std::unordered_map<std::string, std::uint32_t> group_ids_;
};

/// Bodies, whose ids are their order of insertion, groups, and ignored pairs.
class Scene : SceneContent {
 public:
  /// Options of the add_* functions. Without a pose, a body that is static or has a parent is placed at the identity.
  struct BodyOptions {
    double radius = 0;        ///< added to the radius of every part, in metres
    std::string parent = {};  ///< name of an existing body, or empty
    bool is_static = false;
    std::optional<Pose> pose = {};
    bool requires_pose = false;  ///< ignores `pose`: no_pose until a pose is received
    Uncertainty uncertainty = {};
    double padding = 0;    ///< as in Body
    double max_speed = 0;  ///< as in Body
  };

  /// Reads a scene file (YAML) and its meshes, or a URDF, whose robot becomes the scene. Throws SceneError.
  /// \param allow_outside permits meshes outside the scene file's folder
  static Scene load(const std::string& path, bool allow_outside = false);
  /// Writes `scene.yaml` and its geometry into an empty or new folder. Loaded again, it gives the same ids, pairs and
  /// answers, bit for bit. Throws SceneError.
  void save(const std::string& folder) const;

  /// Each of these adds a body and returns its id. Bodies of the same vertices and radius share their parts. All throw
  /// SceneError for a bad or repeated name or bad geometry.
  std::uint32_t add_hull(const std::string& name, std::span<const Vec3d> vertices, const BodyOptions& options);
  /// Bodies of the same file and options share their parts. A surface needs triangles, a solid a closed mesh.
  /// \param scale per axis of the file, not 0; negative mirrors
  /// \param up axis of the file that becomes the body's z; kY turns (x, y, z) to (x, -z, y), exactly
  std::uint32_t add_mesh(const std::string& name, const std::string& path, Vec3d scale, MeshAs mesh_as,
                         const BodyOptions& options, UpAxis up = UpAxis::kZ);
  /// Adds a mesh from memory.
  /// \param vertices metres, in the body's frame
  /// \param triangles indices of vertices; those of a solid are oriented consistently
  std::uint32_t add_mesh(const std::string& name, std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                         MeshAs mesh_as, const BodyOptions& options);
  /// Adds a cloud of points (metres, in the body's frame), grown by the radius, or of boxes around them with the edge
  /// `voxel`, rounded up to float32. Without points it is empty, or awaits points if it requires a pose.
  std::uint32_t add_points(const std::string& name, std::span<const CloudPoint> points, double voxel,
                           const BodyOptions& options);
  /// Returns the same scene with other points in a cloud.
  /// \param cloud from make_cloud_part(), not yet grown by the body's uncertainty; null for no points
  Scene with_points(std::uint32_t body, const ConvexPartPtr& cloud) const;
  std::uint32_t add_uv_sphere(const std::string& name, double radius, int resolution,
                              const BodyOptions& options);                                 ///< Open3D's create_sphere
  std::uint32_t add_box(const std::string& name, Vec3d size, const BodyOptions& options);  ///< full edge lengths
  std::uint32_t add_sphere(const std::string& name, double radius, const BodyOptions& options);
  std::uint32_t add_capsule(const std::string& name, double radius, double length,
                            const BodyOptions& options);  ///< along z; length between the centres of its caps
  std::uint32_t add_cylinder(const std::string& name, double radius, double length,
                             const BodyOptions& options);  ///< along z
  /// Along z and about the origin, with its disc at -length / 2 and its apex at length / 2.
  std::uint32_t add_cone(const std::string& name, double radius, double length, const BodyOptions& options);
  std::uint32_t add_ellipsoid(const std::string& name, Vec3d radii, const BodyOptions& options);  ///< half axes
  /// The half-space z <= 0 of its own frame. It is always static, and has no parent and no uncertainty of angle.
  std::uint32_t add_half_space(const std::string& name, const BodyOptions& options);
  /// Adds a body with its parts. Grows them by padding and uncertainty of position unless `is_grown`.
  std::uint32_t add_body(Body body);
  /// Gives a body the geometry of another one, which is not yet grown by padding or uncertainty, and keeps the rest.
  /// Throws SceneError for an unknown body, a frame, a link of a robot, and for the half-space of a movable body.
  void replace_shape(const std::string& name, const Geometry& shape);
  /// Adds a robot: a frame NAME that places it, a body NAME/LINK for each link, a group NAME of all links and a group
  /// NAME/GROUP for each group of the SRDF. Ignores pairs that the SRDF disables, pairs of links without a moving joint
  /// between them and, without an SRDF, pairs that a joint connects. Returns its index in robots(). If it throws
  /// SceneError, the scene is unchanged.
  std::uint32_t add_robot(const std::string& name, const RobotOptions& options);
  /// Makes a body follow another from the start. Throws SceneError for an unknown body, a cycle, or a static child.
  void set_parent(const std::string& child, const std::string& parent);
  /// Sets Body::requires_pose. Throws SceneError for an unknown or static body.
  void set_requires_pose(const std::string& body);

  void add_group(const std::string& name, std::span<const std::string> bodies);
  /// Ignores every pair between two bodies or groups. A group with itself means its inner pairs.
  void ignore(const std::string& a, const std::string& b);

  const std::vector<Body>& bodies() const { return bodies_; }
  const std::vector<Group>& groups() const { return groups_; }
  /// Pairs (a < b) named by ignore(), sorted, without repeats.
  const std::vector<std::pair<std::uint32_t, std::uint32_t>>& ignored() const { return ignored_; }
  const std::vector<std::shared_ptr<const SceneRobot>>& robots() const { return robots_; }
  /// The joints of all robots, by id.
  const std::vector<SceneJoint>& joints() const { return joints_; }
  const std::vector<JointGroup>& joint_groups() const { return joint_groups_; }
  /// Probable mistakes in the scene file, each with its place.
  const std::vector<std::string>& warnings() const { return warnings_; }
  void add_warning(std::string warning) { warnings_.push_back(std::move(warning)); }

  /// Whether the shape or place of any body is uncertain.
  bool has_uncertainties() const { return has_uncertainties_; }
  /// Whether any body is a cloud, surface or solid: has_surface().
  bool has_surfaces() const { return has_surfaces_; }

  /// Id of a body, or kNone.
  std::uint32_t find_body(std::string_view name) const;
  /// Index of a group, or kNone.
  std::uint32_t find_group(std::string_view name) const;
  /// Id of a joint, or kNone.
  std::uint32_t find_joint(std::string_view name) const;

  /// A digest of all geometry, names, groups and initial poses, equal for the same scene on any machine. Never 0.
  std::uint64_t revision() const;

 private:
  std::vector<std::uint32_t> resolve(const std::string& body_or_group) const;
  template <class F>
  std::uint32_t add_geometry(const std::string& name, const BodyOptions& options, F&& geometry_of);
  std::uint32_t add_shape(const std::string& name, const Shape& shape, const char* source, const BodyOptions& options);
  Body body_from(const std::string& name, const BodyOptions& options) const;
  ConvexPartPtr shared_part(const ConvexPartPtr& part);
  void check_free(const std::string& name, const char* what) const;
  const Geometry& mesh_geometry(const std::string& path, const MeshRecipe& recipe);
  void insert_group(Group group);
  std::uint32_t insert_body(Body body);
  void leave_out(std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs);
  friend class clearance::RobotAdder;

  void grow(Body& body, bool shares_parts = true);
  Scene without_memory() const {
    Scene next;
    static_cast<SceneContent&>(next) = *this;
    return next;
  }

  std::vector<std::string> warnings_;
  std::unordered_multimap<std::uint64_t, ConvexPartPtr> parts_;  ///< by digest
  /// Geometries made before: meshes by file and options, shapes by their vertices.
  std::unordered_map<std::string, std::shared_ptr<const Geometry>> geometries_;
  std::shared_ptr<MeshGeometries> meshes_;  ///< null until there is a mesh
};

}  // namespace engine

}  // namespace clearance
