// A robot from its URDF and SRDF: links, joints, groups and disabled pairs.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/base/vec.h"
#include "engine/robot/xml_file.h"
#include "wire/types.h"

namespace clearance {

/// Pose of a frame in another: maps x to Rz(yaw) Ry(pitch) Rx(roll) x + xyz, in real arithmetic. Metres, radians.
struct Origin {
  Vec3d xyz{0, 0, 0}, rpy{0, 0, 0};
};

/// One shape of a link.
struct RobotShape {
  enum class Kind : std::uint8_t { kBox, kSphere, kCylinder, kCapsule, kMesh };
  Kind kind = Kind::kBox;
  Origin X_ls;                ///< pose of the shape in its link
  Vec3d size{0, 0, 0};        ///< full edge lengths of a box, metres
  double radius = 0;          ///< metres
  double length = 0;          ///< along z; for a capsule, between the centres of its caps
  std::string mesh;           ///< name in the file: "package://...", "file://..." or a path
  Vec3d mesh_scale{1, 1, 1};  ///< not 0; negative mirrors
  std::string place;          ///< "panda.urdf:12: link "hand": collision", for errors about its mesh
  std::string problem;        ///< error of an unusable `visual` shape, with its place, or empty
};

struct RobotLink {
  std::string name;
  std::vector<RobotShape> collision, visual;  ///< both empty for a frame
  std::uint32_t joint = kNone;                ///< joint to its parent; kNone for the robot's base
};

enum class JointKind : std::uint8_t { kFixed, kRevolute, kContinuous, kPrismatic, kPlanar, kFloating };

/// The joint's position is multiplier * position of `joint` + offset, in real arithmetic.
struct Mimic {
  std::uint32_t joint = kNone;
  double multiplier = 1, offset = 0;
};

struct RobotJoint {
  std::string name;
  JointKind kind = JointKind::kFixed;
  std::uint32_t parent = kNone, child = kNone;  ///< links
  Origin X_pj;                                  ///< pose of the joint's frame in its parent link
  Vec3d axis{1, 0, 0};                          ///< axis of a moving joint in its frame, of any length but 0
  std::optional<Mimic> mimic;                   ///< only for a moving joint
  std::uint32_t column = kNone;                 ///< its first column, or kNone
};

/// One number of a configuration. A planar joint has three: name/x, name/y, name/theta.
struct RobotColumn {
  std::string name;
  std::uint32_t joint = kNone;
  double lower = 0, upper = 0;  ///< radians or metres; infinite without a limit
};

/// A group of columns in an SRDF.
struct RobotGroup {
  std::string name;
  std::vector<std::uint32_t> columns;  ///< ascending
  std::vector<std::uint32_t> links;    ///< links that it names, or that its joints carry; ascending
};

struct GroupState {
  std::string name, group;
  std::vector<std::pair<std::uint32_t, double>> positions;  ///< (column, position)
};

/// Links whose pair an SRDF disables, by name or with all pairs of one of them; a < b.
struct DisabledPair {
  std::uint32_t a = kNone, b = kNone;
  std::string reason;
};

/// A tree, in which every link except the base has one joint to its parent.
struct RobotModel {
  std::string name;
  std::vector<RobotLink> links;      ///< in the file's order
  std::vector<RobotJoint> joints;    ///< each after its parent
  std::vector<RobotColumn> columns;  ///< in the order of `joints`
  std::uint32_t base = kNone;        ///< the link without a parent
  std::vector<RobotGroup> groups;
  std::vector<GroupState> states;
  std::vector<DisabledPair> disabled;  ///< ascending, no repeats
  /// Pairs (a < b) that an SRDF enables by name and does not disable by name; ascending.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> enabled;
  std::vector<std::string> warnings;  ///< texts about ignored and suspicious parts, with places

  /// Return ids by name, or kNone.
  std::uint32_t find_link(std::string_view link) const;
  std::uint32_t find_joint(std::string_view joint) const;
  std::uint32_t find_column(std::string_view column) const;
  const RobotGroup* find_group(std::string_view group) const;
  /// Returns the joints from the base to a link, in order.
  std::vector<std::uint32_t> chain_to(std::uint32_t link) const;
};

/// Reads a URDF. Throws RobotError. Ignores inertias, sensors, transmissions and everything else outside geometry.
RobotModel read_urdf(const std::string& path);
RobotModel parse_urdf(std::string_view text, const std::string& file);

/// Adds the contents of that robot's SRDF. Throws RobotError.
void read_srdf(const std::string& path, RobotModel* robot);
void parse_srdf(std::string_view text, const std::string& file, RobotModel* robot);

/// Adds the folders of the meshes' packages that are not in `packages`, if AMENT_PREFIX_PATH or ROS_PACKAGE_PATH lead
/// to them.
/// \param visual whether to use the visual shapes instead of those for collisions
void find_packages(const RobotModel& robot, bool visual, std::map<std::string, std::string>* packages);

/// Returns the file of a shape's mesh. Throws RobotError for an unknown package or a missing file.
/// \param folder the URDF's folder, at which plain paths start
/// \param packages folder of each package
std::string mesh_path(const RobotShape& shape, const std::string& folder,
                      const std::map<std::string, std::string>& packages);

}  // namespace clearance
