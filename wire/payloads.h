// Payloads of frames (protocol.h) other than queries, replies and errors.
#pragma once

#include <clearance/protocol.h>
#include <clearance/types.h>

#include <cstdint>
#include <type_traits>

namespace clearance::wire {

struct PosesHeader {
  std::uint64_t count = 0;
  std::int64_t stamp_ns = 0;  ///< publisher's clock
  std::int64_t sequence = 0;  ///< publisher's count of its updates, or 0
  std::uint64_t reserved[1] = {};
};

/// Replaces all points of a cloud. Three float32 for each point follow, metres, in the body's frame.
struct PointsHeader {
  std::uint64_t count = 0;
  std::int64_t stamp_ns = 0;  ///< publisher's clock, or 0
  std::int64_t sequence = 0;  ///< publisher's count of its updates, or 0
  double radius = 0;          ///< metres, growth of the points; valid if has_radius
  std::uint32_t body = 0;
  std::uint8_t has_radius = 0;  ///< 0 for the radius in the scene
  std::uint8_t padding[3] = {};
  std::uint64_t reserved[3] = {};
};

struct PoseRecord {
  std::uint32_t body = 0;
  std::uint32_t padding = 0;
  double pose[7] = {};  ///< x, y, z, qw, qx, qy, qz; metres
};

struct JointRecord {
  std::uint32_t joint = 0;
  std::uint32_t padding = 0;
  double position = 0;  ///< radians or metres
};

struct AttachRecord {
  std::uint32_t child = 0;
  std::uint32_t parent = 0;   ///< kNone to detach
  std::uint8_t has_pose = 0;  ///< 0 for the current relative pose
  std::uint8_t padding[7] = {};
  double pose[7] = {};  ///< X_parent_child
};

struct AllowRecord {
  std::uint32_t a = 0, b = 0;  ///< selectors
  std::uint8_t allow = 1;      ///< 0 to include their pairs again
  std::uint8_t padding[7] = {};
};

struct PosesResult {
  std::uint64_t revision = 0;
  std::uint64_t scene_revision = 0;  ///< an attachment changes it
  std::uint32_t applied = 0;
  std::uint32_t bad = 0;
  std::uint32_t unknown = 0;
  std::uint32_t fixed = 0;
};

struct SceneHeader {
  std::uint64_t scene_revision = 0;
  std::uint32_t body_count = 0;
  std::uint32_t group_count = 0;
  std::uint32_t member_count = 0;
  std::uint32_t padding = 0;
  std::uint64_t pair_count = 0;  ///< enabled pairs
  char backend[16] = {};
  std::uint64_t reserved[2] = {};
};

struct BodyRecord {
  char name[64] = {};  ///< NUL-terminated UTF-8
  std::uint32_t parent = kNone;
  std::uint8_t is_static = 0;
  std::uint8_t is_solid = 0;  ///< whether the triangles enclose the body, rather than being the body
  std::uint8_t is_cloud = 0;  ///< whether the body is a point cloud, which kSetPoints replaces
  std::uint8_t padding[1] = {};
  std::uint32_t piece_count = 0;
  std::uint32_t padding2 = 0;
  std::uint64_t vertex_count = 0;
  double model_error = 0;            ///< metres
  double extent = 0;                 ///< metres, farthest point from the body's origin
  double hull_excess = 0;            ///< metres, bound on the distance of its convex parts from its mesh
  double empty_share = 0;            ///< fraction of the parts' volume outside the mesh, or NaN if unknown
  std::uint64_t triangle_count = 0;  ///< triangles of a surface or solid; 0 if the convex parts are the body
};

struct GroupRecord {
  char name[64] = {};
  std::uint32_t first_member = 0;  ///< index into the member list
  std::uint32_t member_count = 0;
  std::uint64_t reserved = 0;
};

struct PairsHeader {
  std::uint64_t scene_revision = 0;
  std::uint64_t count = 0;
};

struct StatesHeader {
  std::uint64_t count = 0;
  std::uint64_t revision = 0;  ///< of the poses
  std::int64_t now_ns = 0;     ///< daemon's monotonic clock
  std::uint64_t reserved = 0;
};

struct BodyStateRecord {
  double pose[7] = {};  ///< X_wb
  std::int64_t stamp_ns = 0;
  std::int64_t receipt_ns = 0;
  std::uint32_t parent = kNone;
  std::uint8_t status = 0;  ///< Status: kOk, kNoPose, kBadPose
  std::uint8_t padding[3] = {};
  std::uint64_t reserved[2] = {};
};

struct JointsHeader {
  std::uint64_t scene_revision = 0;
  std::uint64_t revision = 0;  ///< of the poses
  std::int64_t now_ns = 0;     ///< daemon's monotonic clock
  std::uint32_t joint_count = 0;
  std::uint32_t group_count = 0;  ///< one group per robot with all its joints, and the groups of its SRDF
  std::uint32_t member_count = 0;
  std::uint32_t padding = 0;
  std::uint64_t reserved = 0;
};

struct JointStateRecord {
  char name[64] = {};  ///< "panda/panda_joint1"
  double lower = 0;    ///< radians or metres; infinite without a limit
  double upper = 0;
  double position = 0;  ///< valid if status is kOk
  std::int64_t stamp_ns = 0;
  std::int64_t receipt_ns = 0;
  std::uint8_t status = 0;  ///< Status: kOk, kNoPose (without a position), kBadPose
  std::uint8_t beyond_limits = 0;
  std::uint8_t padding[6] = {};
  std::uint64_t reserved[2] = {};
};

/// A query in device memory that the client maps (docs/service/wire_queries.md).
struct PlanHeader {
  std::uint64_t plan = 0;               ///< its number, never 0; valid for the client that opened it
  std::uint64_t memory_bytes = 0;       ///< size of the memory
  std::uint8_t memory_handle[64] = {};  ///< cudaIpcMemHandle_t
  std::uint8_t device_uuid[16] = {};    ///< of the memory's device
  std::uint64_t poses_offset = 0;       ///< into the memory: (K, M, 7) float64 as in kQuery
  std::uint64_t positions_offset = 0;   ///< into the memory: (K, J) float64, radians and metres
  std::uint64_t rows = 0;               ///< of each column
  std::uint64_t configurations = 0;     ///< K; 1 for the current poses
  std::uint64_t pairs = 0;              ///< P
  std::uint32_t body_count = 0;         ///< M; 0 without poses as input
  std::uint32_t joint_count = 0;        ///< J; 0 without positions as input
  std::uint32_t fields = 0;             ///< columns, Field bits
  std::uint32_t column_count = 0;       ///< number of columns
  std::uint64_t scene_revision = 0;     ///< of the scene, fixed when the plan is opened
  std::uint64_t snapshot_revision = 0;  ///< of the poses, fixed likewise
  std::uint64_t reserved[2] = {};
};

/// A column of a plan, in the order of Field.
struct PlanColumnRecord {
  std::uint32_t field = 0;      ///< one Field bit
  std::uint32_t row_bytes = 0;  ///< of one row
  std::uint64_t offset = 0;     ///< into the memory; a multiple of 64
};

struct PlanRecord {
  std::uint64_t plan = 0;  ///< PlanHeader::plan
  std::uint64_t reserved = 0;
};

struct PlanResult {
  std::uint64_t plan = 0;
  std::uint64_t snapshot_revision = 0;  ///< of the daemon's current poses, not necessarily the plan's
  std::uint64_t took_ns = 0;            ///< time of kRunPlan from its first launch to its complete rows
  std::uint64_t reserved[1] = {};
};

enum class BodyShape : std::uint8_t {
  kHull = 0,       ///< hull of the vertices that follow
  kBox = 1,        ///< size: full edge lengths
  kSphere = 2,     ///< size: radius
  kCapsule = 3,    ///< size: radius, length between the centres of its caps; along z
  kCylinder = 4,   ///< size: radius, length; along z
  kHalfSpace = 5,  ///< z <= 0 in its own frame; static, without a parent
  kCone = 6,       ///< size: radius, length; along z, with its apex at the positive end
  kEllipsoid = 7,  ///< size: half axes
  kCloud = 8,      ///< points, which kSetPoints replaces; size: edge of the boxes around them, or 0
};

struct NewBodyRecord {
  char name[64] = {};            ///< NUL-terminated UTF-8
  std::uint32_t parent = kNone;  ///< body that it follows
  std::uint8_t shape = 0;        ///< BodyShape
  std::uint8_t is_static = 0;
  std::uint8_t has_pose = 0;  ///< if 0, the identity with a parent or static, otherwise none until one arrives
  std::uint8_t padding = 0;
  double size[3] = {};  ///< metres
  double radius = 0;    ///< metres, grows the shape
  double pose[7] = {};  ///< X_wb, or X_parent_body with a parent
  std::uint64_t vertex_count = 0;
  std::uint64_t reserved[2] = {};
};

struct BodyUncertaintyRecord {
  double uncertainty_position = 0;  ///< metres: radius of a ball around its position that contains its origin
  double uncertainty_angle = 0;     ///< radians: bound on its rotation error about its origin
  double padding = 0;               ///< metres: growth
  double max_speed = 0;             ///< metres per second: bound on the speed of its points
};

struct VertexRecord {
  double xyz[3] = {};  ///< metres, in the body's frame
};

struct TriangleRecord {
  std::uint32_t vertices[3] = {};  ///< indices of the body's vertices
};

struct RemoveBodyRecord {
  char name[64] = {};  ///< of a body added by kAddBody
};

struct SceneChange {
  std::uint64_t scene_revision = 0;  ///< of the new scene
  std::uint32_t body_count = 0;
  std::uint32_t body = kNone;  ///< id of the new body, for kAddBody
  double seconds = 0;          ///< time to build the scene
  std::uint64_t reserved[1] = {};
};

struct CounterRecord {
  char name[56] = {};
  std::uint64_t value = 0;
};

#define CLEARANCE_WIRE(type, bytes) \
  static_assert(sizeof(type) == bytes && std::is_trivially_copyable_v<type> && std::is_standard_layout_v<type>)
CLEARANCE_WIRE(PosesHeader, 32);
CLEARANCE_WIRE(PointsHeader, 64);
CLEARANCE_WIRE(PoseRecord, 64);
CLEARANCE_WIRE(JointRecord, 16);
CLEARANCE_WIRE(AttachRecord, 72);
CLEARANCE_WIRE(AllowRecord, 16);
CLEARANCE_WIRE(PosesResult, 32);
CLEARANCE_WIRE(SceneHeader, 64);
CLEARANCE_WIRE(BodyRecord, 128);
CLEARANCE_WIRE(GroupRecord, 80);
CLEARANCE_WIRE(PairsHeader, 16);
CLEARANCE_WIRE(StatesHeader, 32);
CLEARANCE_WIRE(BodyStateRecord, 96);
CLEARANCE_WIRE(JointsHeader, 48);
CLEARANCE_WIRE(JointStateRecord, 128);
CLEARANCE_WIRE(PlanHeader, 184);
CLEARANCE_WIRE(PlanColumnRecord, 16);
CLEARANCE_WIRE(PlanRecord, 16);
CLEARANCE_WIRE(PlanResult, 32);
CLEARANCE_WIRE(NewBodyRecord, 184);
CLEARANCE_WIRE(BodyUncertaintyRecord, 32);
CLEARANCE_WIRE(VertexRecord, 24);
CLEARANCE_WIRE(TriangleRecord, 12);
CLEARANCE_WIRE(RemoveBodyRecord, 64);
CLEARANCE_WIRE(SceneChange, 32);
CLEARANCE_WIRE(CounterRecord, 64);
#undef CLEARANCE_WIRE

}  // namespace clearance::wire
