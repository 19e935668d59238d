// The scene: bodies, groups, and which pairs are asked about. Built once, then immutable and shared.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "engine/base/body_pair.h"
#include "engine/base/triangle.h"
#include "engine/bvh/cloud_point.h"
#include "engine/hull/piece.h"
#include "engine/pose/pose.h"
#include "engine/scene/scene_robot.h"
#include "wire/types.h"

namespace clearance {

struct Geometry;       // engine/scene/geometry.h
struct MeshRecipe;     // engine/scene/geometry.h
class MeshGeometries;  // engine/scene/mesh_geometry.h
struct Shape;          // engine/hull/shapes.h

/// Axis of a mesh file that points up. The body's is always z.
enum class UpAxis : std::uint8_t { kZ, kY };

/// Bad input at set-up. The text names cause and place: "scenes/a.yaml:12: bodies[3].radius: expected a number > 0, got
/// -1".
struct SceneError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Triangles of a body in its frame, for pictures and for the naive baseline; the engine's answers never use them.
struct DisplayMesh {
  std::vector<Vec3d> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// What a body of points has of them: its own, none (nothing is there), or none until they are received.
enum class CloudState : std::uint8_t { kNoCloud, kPoints, kEmpty, kAwaited };

struct Body {
  std::string name;
  std::vector<PiecePtr> pieces;  ///< none: a frame, which others follow and no pair has
  std::uint32_t parent = kNone;  ///< the body that this one follows at load
  bool is_static = false;        ///< never moves after load
  bool is_live = false;          ///< `pose` counts for nothing: no_pose until one is received
  std::uint32_t robot = kNone;   ///< whose joints place it, and nobody's pose; of Scene::robots()
  std::uint32_t link = kNone;    ///< which of its links it is
  std::optional<Pose> pose;      ///< initial X_wb, or X_pb with a parent; none: no_pose until one arrives
  /// metres: how far the pieces may stand out from the shape they were asked for; of a mesh, from the hulls that its
  /// file and scale mean: rounding
  double model_error = 0;
  double model_inner = 0;  ///< metres: how far that shape may stand out of the pieces
  double hull_excess = 0;  ///< metres: no point of a piece is farther from the mesh that it stands for (hull_excess.h)
  double empty_share = 0;  ///< of the pieces' volume that the mesh leaves empty; NaN for one that is not closed
  std::string source;      ///< "meshes/base.stl (hull)", "box", ...: where the geometry came from
  std::shared_ptr<const DisplayMesh> display;  ///< may be null
  Uncertainty uncertainty;
  double padding = 0;     ///< metres, that the pieces are grown by
  bool is_grown = false;  ///< the pieces hold `padding` and the free position already: Scene sees to it
  double max_speed = 0;   ///< metres a second: how fast a point of it, or of what follows it, may move at most
  double reach = 0;       ///< metres: no point of the pieces is farther from the origin; Scene says it
  /// Points may be replaced (Engine::set_points()). Where there are none the one piece stands for nothing.
  CloudState cloud = CloudState::kNoCloud;
  double cloud_radius = 0;  ///< metres: by which points are grown whose sender says nothing else
  float voxel = 0;          ///< metres: the edge of the boxes about the points; 0: points
  /// Of a body by the convex pieces that stand for its meshes (Scene::by_pieces()): what it is. How far they may miss
  /// that is in `model_inner` and `model_error`. Null: the pieces are what it is.
  std::shared_ptr<const Body> stands_for;
};

/// Whether the body's shape, or where it is, is known less well than its pieces and pose say.
bool has_uncertainty(const Body& body);
/// Whether it is a cloud of points or voxels, or would be one if there were any.
inline bool is_cloud(const Body& body) {
  return body.cloud != CloudState::kNoCloud;
}
/// Whether a piece of it is not the truth.
bool has_surface(const Body& body);
/// What a body is where it is more than its pieces say: the first of its surfaces and solids; null: the union of its
/// pieces.
const Surface* surface_of(const Body& body);
/// The triangles of all of them.
std::uint64_t triangle_count(const Body& body);
/// The points of a cloud.
std::uint64_t point_count(const Body& body);
/// Why a link's pose cannot be given.
std::string placed_by_joints(const Body& body);

struct Group {
  std::string name;
  std::vector<std::uint32_t> bodies;  ///< ids, ascending
};

/// Bodies by id (their order of arrival), groups, and the pairs that are not asked about.
class Scene {
 public:
  /// Options of the add_* calls. A body that is static or has a parent stays, without a pose, at the identity.
  struct BodyOptions {
    double radius = 0;        ///< grows every piece, metres
    std::string parent = {};  ///< name of a body already there; empty: none
    bool is_static = false;
    std::optional<Pose> pose = {};
    bool is_live = false;  ///< no_pose until a pose is received, whatever `pose` says
    Uncertainty uncertainty = {};
    double padding = 0;    ///< as in Body
    double max_speed = 0;  ///< as in Body
  };

  /// Reads a scene file (YAML) and the meshes it names, or a URDF: a scene of that robot, which has the URDF's name.
  /// Throws SceneError.
  /// \param allow_outside meshes may lie outside the scene file's folder.
  static Scene load(const std::string& path, bool allow_outside = false);
  /// Writes `scene.yaml` and all that it needs into a folder that is empty or not there yet. Loaded again it is the
  /// same scene: the same ids, the same pairs, answers of the same bits. Throws SceneError.
  void save(const std::string& folder) const;

  /// Each adds a body and returns its id. Bodies of the same vertices and radius share their pieces. All throw
  /// SceneError for a bad or repeated name or bad geometry.
  std::uint32_t add_hull(const std::string& name, std::span<const Vec3d> vertices, const BodyOptions& options);
  /// Bodies of the same file and options share their pieces. A solid's mesh is closed; a surface's and a solid's has
  /// triangles.
  /// \param scale per axis of the file, not 0; negative mirrors
  /// \param up axis of the file that becomes the body's z; kY turns (x, y, z) to (x, -z, y), exactly
  std::uint32_t add_mesh(const std::string& name, const std::string& path, Vec3d scale, Convexify convexify,
                         const BodyOptions& options, UpAxis up = UpAxis::kZ);
  /// The same of a mesh that the caller has. \param vertices metres, in the body's frame. \param triangles of indices
  /// among them; a solid's turn all the same way.
  std::uint32_t add_mesh(const std::string& name, std::span<const Vec3d> vertices, std::span<const Triangle> triangles,
                         Convexify convexify, const BodyOptions& options);
  /// A cloud: points (metres, the body's frame), grown by the radius, or boxes about them of an edge `voxel`, which
  /// counts as the float32 above it. Without points there is nothing; of a live body nothing is known until they come.
  std::uint32_t add_points(const std::string& name, std::span<const CloudPoint> points, double voxel,
                           const BodyOptions& options);
  /// The same scene with other points in a body of points. \param cloud of its voxels, not grown yet by what is doubted
  /// of the body (make_cloud_piece()); null: there are none
  Scene with_points(std::uint32_t body, const PiecePtr& cloud) const;
  std::uint32_t add_uv_sphere(const std::string& name, double radius, int resolution,
                              const BodyOptions& options);                                 ///< Open3D's create_sphere
  std::uint32_t add_box(const std::string& name, Vec3d size, const BodyOptions& options);  ///< full edge lengths
  std::uint32_t add_sphere(const std::string& name, double radius, const BodyOptions& options);
  std::uint32_t add_capsule(const std::string& name, double radius, double length,
                            const BodyOptions& options);  ///< along z; length between the centres of its caps
  std::uint32_t add_cylinder(const std::string& name, double radius, double length,
                             const BodyOptions& options);  ///< along z
  /// Along z and about the origin: a disc at -length / 2, the apex at length / 2.
  std::uint32_t add_cone(const std::string& name, double radius, double length, const BodyOptions& options);
  std::uint32_t add_ellipsoid(const std::string& name, Vec3d radii, const BodyOptions& options);  ///< half axes
  /// The half-space z <= 0 of its own frame: static, whatever the options say, and its child of nobody. Its place must
  /// be known but for a position: no uncertainty of angle.
  std::uint32_t add_half_space(const std::string& name, const BodyOptions& options);
  /// Ready-made pieces, that are grown by the body's padding and by the uncertainty of its position, unless they are
  /// already, as in a body of another scene.
  std::uint32_t add_body(Body body);
  /// Adds a robot: a frame NAME that places it, a body NAME/LINK for each link, a group NAME of all links and a group
  /// NAME/GROUP for each of the SRDF. Left out are pairs that the SRDF disables, those of links with no moving joint
  /// between them and, without an SRDF, those of links that a joint joins. Returns its place in robots(). Throws
  /// SceneError, which leaves the scene as it was.
  std::uint32_t add_robot(const std::string& name, const RobotOptions& options);
  /// Makes a body follow another from the start. Throws SceneError for an unknown body, a cycle, or a static child.
  void set_parent(const std::string& child, const std::string& parent);
  /// The body has no pose until one is received. Throws SceneError for an unknown or static body.
  void set_live(const std::string& body);

  void add_group(const std::string& name, std::span<const std::string> bodies);
  /// Leaves out every pair between two bodies or groups (a group with itself: its inner pairs).
  void ignore(const std::string& a, const std::string& b);

  const std::vector<Body>& bodies() const { return bodies_; }
  const std::vector<Group>& groups() const { return groups_; }
  /// Pairs (a < b) named by ignore(), sorted, without repeats.
  const std::vector<std::pair<std::uint32_t, std::uint32_t>>& ignored() const { return ignored_; }
  const std::vector<std::shared_ptr<const SceneRobot>>& robots() const { return robots_; }
  /// The joints of all robots: a joint's id is its place here.
  const std::vector<SceneJoint>& joints() const { return joints_; }
  const std::vector<JointGroup>& joint_groups() const { return joint_groups_; }
  /// Sentences about what is legal in the scene file but probably a mistake, with places.
  const std::vector<std::string>& warnings() const { return warnings_; }
  /// Adds one of them.
  void add_warning(std::string warning) { warnings_.push_back(std::move(warning)); }

  /// Whether a body's shape, or where it is, is known less well than its pieces and pose say.
  bool has_uncertainties() const { return has_uncertainties_; }
  /// Whether a body is not convex, nor the union of its pieces: surface_of().
  bool has_surfaces() const { return has_surfaces_; }

  /// The same scene with each body by the convex pieces that stand for its meshes, where it has any (Decomposition):
  /// what queries of the model `pieces` are answered from. Null before find_stand_ins(), or where no body has any.
  const Scene* by_pieces() const { return by_pieces_.get(); }
  /// Makes by_pieces(), once all bodies are there: whoever adds another one has to ask again.
  void find_stand_ins();
  /// Whether a body is by pieces that stand for it.
  bool has_stand_ins() const { return has_stand_ins_; }

  /// Id of a body; kNone if there is none.
  std::uint32_t find_body(std::string_view name) const;
  /// Index of a group; kNone if there is none.
  std::uint32_t find_group(std::string_view name) const;
  /// Id of a joint; kNone if there is none.
  std::uint32_t find_joint(std::string_view name) const;

  /// A digest of all geometry, names, groups and initial poses: the same scene gives the same number on any machine.
  /// Never 0.
  std::uint64_t revision() const;

 private:
  std::vector<std::uint32_t> resolve(const std::string& body_or_group) const;
  template <class F>
  std::uint32_t add_geometry(const std::string& name, const BodyOptions& options, F&& geometry_of);
  std::uint32_t add_shape(const std::string& name, const Shape& shape, const char* source, const BodyOptions& options);
  Body body_from(const std::string& name, const BodyOptions& options) const;
  PiecePtr shared_piece(const PiecePtr& piece);
  void check_free(const std::string& name, const char* what) const;
  const Geometry& mesh_geometry(const std::string& path, const MeshRecipe& recipe);
  void insert_group(Group group);
  std::uint32_t insert_body(Body body);
  void leave_out(std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs);
  friend class RobotAdder;

  void grow(Body& body, bool shares_pieces = true);
  Scene without_memory() const;

  std::vector<Body> bodies_;
  bool has_uncertainties_ = false, has_surfaces_ = false, has_stand_ins_ = false;
  std::vector<Group> groups_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> ignored_;
  std::vector<std::shared_ptr<const SceneRobot>> robots_;
  std::vector<SceneJoint> joints_;
  std::vector<JointGroup> joint_groups_;
  std::vector<std::string> warnings_;
  std::unordered_map<std::string, std::uint32_t> joint_ids_;
  std::unordered_map<std::string, std::uint32_t> body_ids_;
  std::unordered_map<std::string, std::uint32_t> group_ids_;
  std::unordered_multimap<std::uint64_t, PiecePtr> pieces_;  ///< by digest
  std::unordered_map<std::string, std::shared_ptr<const Geometry>>
      geometries_;  ///< that were made before: of meshes by file and options, of shapes by what they are made of
  std::shared_ptr<MeshGeometries> meshes_;  ///< null until there is a mesh
  std::shared_ptr<const Scene> by_pieces_;
};

/// Says which body of a pair is not convex, nor the union of its pieces: "'shelf' is a solid"; empty where none is, or
/// where there is no such body.
std::string no_convex_truth(const Scene& scene, BodyPair pair);

}  // namespace clearance
