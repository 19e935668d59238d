// A scene, its joints and its present state, as an engine and a client describe them.
#pragma once

#include <clearance/check.h>
#include <clearance/query.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace clearance {

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
  std::int64_t age_ns = -1;  ///< since it was received; -1 if never
};
/// A joint of one of the scene's robots; its id is its index in JointsInfo::joints.
struct JointInfo {
  std::string name;                 ///< "panda/panda_joint1"
  double lower = 0, upper = 0;      ///< radians or metres; infinite without a limit
  double position = 0;              ///< valid if status is kOk
  Status status = Status::kNoPose;  ///< kOk, kNoPose (without a position) or kBadPose
  bool beyond_limits = false;
  std::int64_t stamp_ns = 0;
  std::int64_t age_ns = -1;  ///< since it was received; -1 if never
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
/// Joints in the order of the columns of positions.
struct Joints {
  std::vector<std::string> names;
  std::vector<std::uint32_t> ids;   ///< for Query::joints
  std::vector<JointLimits> limits;  ///< radians or metres; infinite without a limit
  std::size_t size() const { return ids.size(); }
};
/// Result of a batch of updates, which applies as a whole.
struct UpdateResult {
  std::uint64_t revision = 0;  ///< pose revision that contains the update
  std::uint64_t scene_revision = 0;
  std::uint32_t applied = 0;  ///< poses, positions, points or pairs
  std::uint32_t bad = 0;      ///< stored as kBadPose until a good one is received
  std::uint32_t unknown = 0;  ///< ids outside the scene
  std::uint32_t fixed = 0;    ///< static bodies
};

/// The scene after a change.
struct SceneChanged {
  std::uint64_t scene_revision = 0;
  std::uint32_t body_count = 0;
  std::uint32_t body = kNone;  ///< id of the body, after add_body() and replace()
  double seconds = 0;          ///< time to build the scene
};

}  // namespace clearance
