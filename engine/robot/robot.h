// A robot as its URDF and SRDF say it: links, joints, groups, and which links are not asked about.
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

/// Where a frame is in another: x in the frame means Rz(yaw) Ry(pitch) Rx(roll) x + xyz, in reals. Metres, radians.
struct Origin {
  Vec3d xyz{0, 0, 0}, rpy{0, 0, 0};
};

/// One shape of a link.
struct RobotShape {
  enum class Kind : std::uint8_t { kBox, kSphere, kCylinder, kCapsule, kMesh };
  Kind kind = Kind::kBox;
  Origin X_ls;                ///< of the shape in its link
  Vec3d size{0, 0, 0};        ///< of a box: full edge lengths, metres
  double radius = 0;          ///< metres
  double length = 0;          ///< along z; of a capsule between the centres of its caps
  std::string mesh;           ///< as the file names it: "package://...", "file://..." or a path
  Vec3d mesh_scale{1, 1, 1};  ///< not 0; negative mirrors
  std::string place;          ///< "panda.urdf:12: link "hand": collision", for errors about its mesh
  std::string problem;        ///< why a `visual` shape cannot be used, with its place; empty: it can
};

struct RobotLink {
  std::string name;
  std::vector<RobotShape> collision, visual;  ///< empty: a frame
  std::uint32_t joint = kNone;                ///< that it hangs on; kNone: the robot's base
};

enum class JointKind : std::uint8_t { kFixed, kRevolute, kContinuous, kPrismatic, kPlanar, kFloating };

/// The joint's position is multiplier * position of `joint` + offset, in reals.
struct Mimic {
  std::uint32_t joint = kNone;
  double multiplier = 1, offset = 0;
};

struct RobotJoint {
  std::string name;
  JointKind kind = JointKind::kFixed;
  std::uint32_t parent = kNone, child = kNone;  ///< links
  Origin X_pj;                                  ///< of the joint's frame in its parent link
  Vec3d axis{1, 0, 0};                          ///< in the joint's frame, any length but 0; of a joint that moves
  std::optional<Mimic> mimic;                   ///< of a joint that moves
  std::uint32_t column = kNone;                 ///< its first column; kNone: it has none
};

/// One number of a configuration. A planar joint has three: name/x, name/y, name/theta.
struct RobotColumn {
  std::string name;
  std::uint32_t joint = kNone;
  double lower = 0, upper = 0;  ///< radians or metres; infinite: no limit
};

/// Columns that an SRDF names together.
struct RobotGroup {
  std::string name;
  std::vector<std::uint32_t> columns;  ///< ascending
  std::vector<std::uint32_t> links;    ///< that it names, or that its joints carry; ascending
};

struct GroupState {
  std::string name, group;
  std::vector<std::pair<std::uint32_t, double>> positions;  ///< (column, position)
};

/// Links whose pair an SRDF leaves out: by name, or with all pairs of one of them; a < b.
struct DisabledPair {
  std::uint32_t a = kNone, b = kNone;
  std::string reason;
};

/// A tree: every link but the base hangs on one joint.
struct RobotModel {
  std::string name;
  std::vector<RobotLink> links;      ///< in the file's order
  std::vector<RobotJoint> joints;    ///< each after the one that carries it
  std::vector<RobotColumn> columns;  ///< in the order of `joints`
  std::uint32_t base = kNone;        ///< the link that nothing carries
  std::vector<RobotGroup> groups;
  std::vector<GroupState> states;
  std::vector<DisabledPair> disabled;  ///< ascending, no repeats
  /// Pairs (a < b) that an SRDF enables by name and does not disable by name; ascending.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> enabled;
  std::vector<std::string> warnings;  ///< sentences about what was left out or is suspicious, with places

  /// Ids by name; kNone if there is none.
  std::uint32_t find_link(std::string_view link) const;
  std::uint32_t find_joint(std::string_view joint) const;
  std::uint32_t find_column(std::string_view column) const;
  const RobotGroup* find_group(std::string_view group) const;
  /// Joints from the base to a link, in this order.
  std::vector<std::uint32_t> chain_to(std::uint32_t link) const;
};

/// Reads a URDF. Throws RobotError. Nothing is read of inertias, sensors, transmissions and what else is not geometry.
RobotModel read_urdf(const std::string& path);
RobotModel parse_urdf(std::string_view text, const std::string& file);

/// Adds what an SRDF says of that robot. Throws RobotError.
void read_srdf(const std::string& path, RobotModel* robot);
void parse_srdf(std::string_view text, const std::string& file, RobotModel* robot);

/// Adds the folders of packages that meshes name and `packages` lacks, as far as AMENT_PREFIX_PATH or
/// ROS_PACKAGE_PATH lead to them. \param visual of the visual shapes, not of those for collisions
void find_packages(const RobotModel& robot, bool visual, std::map<std::string, std::string>* packages);

/// The file of a shape's mesh. Throws RobotError where its package has no folder here or the file is not there.
/// \param folder of the URDF, which plain paths start from. \param packages folder by package
std::string mesh_path(const RobotShape& shape, const std::string& folder,
                      const std::map<std::string, std::string>& packages);

}  // namespace clearance
