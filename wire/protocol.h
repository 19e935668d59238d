// Frames exchanged by clients and the daemon, the same over every transport.
//
//   frame      [ FrameHeader 64 B | payload_bytes ]
//   kQuery     [ QueryHeader 128 B | pairs P x 8 | bodies M x 4, padded to 8 | configurations K x M x 56 ]
//   kReply     [ ReplyHeader 128 B | columns in the order of Field, each from a 64-byte boundary of the payload ]
//   kSetPoses  [ PosesHeader 32 B  | count x PoseRecord 64 B ]
//   kScene     [ SceneHeader 64 B  | bodies x BodyRecord 128 B | groups x GroupRecord 80 B | members x 4 ]
//   kPairs     [ QueryHeader, pairs, bodies as in kQuery; without configurations ]
//   kPairTable [ PairsHeader 16 B  | P x 8 ]
//   kBodyStates[ StatesHeader 32 B | bodies x BodyStateRecord 96 B ]
//   kStats     [ count x CounterRecord 64 B ]
//   kError     [ ErrorHeader 16 B  | text, UTF-8 ]
//   kPlan      [ PlanHeader 184 B  | columns x PlanColumnRecord 16 B ]
//   records    at the end of any payload, each [ RecordHeader 8 B | its bytes, padded to 8 ]
//
// ZeroMQ carries a frame as two message parts (header, payload), shared memory as one contiguous block that starts on a
// 64-byte boundary, LCM in typed messages (lcmtypes/). Little-endian; metres, radians, nanoseconds.
// Later additions travel in records (docs/wire.md, "Versions").
// Data from a peer is copied once and validated (wire.h) before use.
#pragma once

#include <clearance/types.h>

#include <bit>
#include <cstdint>
#include <type_traits>

namespace clearance::wire {

static_assert(std::endian::native == std::endian::little, "the wire is little-endian");

inline constexpr std::uint32_t kMagic = 0x31524C43;  // "CLR1"
inline constexpr std::uint16_t kVersion = 1;
using clearance::kColumnAlignment;
/// Maximum size of a frame over every transport.
inline constexpr std::uint64_t kMaxFrameBytes = std::uint64_t{1} << 31;
/// Maximum size of a request. Clients check it before sending; ZeroMQ closes a connection that exceeds it.
inline constexpr std::uint64_t kMaxRequestBytes = std::uint64_t{1} << 28;

enum class FrameType : std::uint16_t {
  // client to daemon
  kPing = 1,         ///< any payload; answered by kPong with the same payload
  kDescribe = 2,     ///< no payload; answered by kScene
  kQuery = 3,        ///< answered by kReply
  kPairs = 4,        ///< answered by kPairTable
  kSetPoses = 5,     ///< answered by kPosesDone
  kAttach = 6,       ///< payload AttachRecord; answered by kPosesDone
  kGetStates = 7,    ///< no payload; answered by kBodyStates
  kGetStats = 8,     ///< no payload; answered by kStats
  kReload = 9,       ///< no payload; answered by kSceneChanged once the daemon has reloaded its scene
  kAddBody = 10,     ///< payload NewBodyRecord, vertices; answered by kSceneChanged once the scene contains it
  kRemoveBody = 11,  ///< payload RemoveBodyRecord; answered by kSceneChanged
  kAllow = 12,       ///< payload AllowRecord; answered by kPosesDone, whose `applied` counts pairs
  kSetJoints = 13,   ///< payload PosesHeader, JointRecords; answered by kPosesDone
  kGetJoints = 14,   ///< no payload; answered by kJoints
  kSetPoints = 15,   ///< payload PointsHeader, points of float32 x, y, z; answered by kPosesDone
  kCertify = 17,     ///< payload of kQuery, with an optional record kRows; answered by kCertificate
  kOpenPlan = 18,    ///< payload of kPairs, for configuration_count configurations; answered by kPlan
  kRunPlan = 19,     ///< payload PlanRecord; answered by kPlanDone once the rows are complete
  kClosePlan = 20,   ///< payload PlanRecord; answered by kPlanDone
  // daemon to client; the answer to any request can be kError
  kPong = 0x81,
  kScene = 0x82,
  kReply = 0x83,
  kPairTable = 0x84,
  kPosesDone = 0x85,  ///< payload PosesResult
  kBodyStates = 0x87,
  kStats = 0x88,
  kSceneChanged = 0x89,  ///< payload SceneChange
  kJoints = 0x8A,        ///< payload JointsHeader, JointStateRecords, GroupRecords, uint32 members
  kCertificate = 0x8C,   ///< payload: the document (JSON, UTF-8), docs/certificates.md
  kPlan = 0x8D,          ///< payload PlanHeader, PlanColumnRecords
  kPlanDone = 0x8E,      ///< payload PlanResult
  kError = 0xFF,
};

/// Bits of FrameHeader::flags, of requests only.
enum FrameFlag : std::uint64_t {
  kFramePlanning = 1,  ///< serve the request in the class `planning` even if the client has the class `control`
};
inline constexpr std::uint64_t kKnownFrameFlags = kFramePlanning;

/// Begins every frame.
struct FrameHeader {
  std::uint32_t magic = kMagic;
  std::uint16_t version = kVersion;
  std::uint16_t type = 0;            ///< FrameType
  std::uint64_t request_id = 0;      ///< chosen by the client, echoed by the daemon
  std::uint64_t payload_bytes = 0;   ///< bytes after this header
  std::uint64_t scene_revision = 0;  ///< the sender's; 0 in a request for any scene
  std::uint64_t client_id = 0;       ///< receiver of a reply over LCM, otherwise 0
  std::uint64_t records_bytes = 0;   ///< of the payload, at its end
  std::uint64_t flags = 0;           ///< FrameFlag bits; 0 in a reply
  std::uint64_t reserved[1] = {};    ///< 0
};

/// Begins a record. Its bytes follow, padded with zeros to a multiple of 8.
struct RecordHeader {
  std::uint16_t tag = 0;    ///< in a query, of query_options.h; in a reply, ReplyRecord
  std::uint16_t flags = 0;  ///< kRecordRequired
  std::uint32_t bytes = 0;
};
/// A receiver that does not know the tag must reject the frame; without this bit, it ignores the record.
inline constexpr std::uint16_t kRecordRequired = 1;

/// Records with the same meaning in every frame.
enum class CommonRecord : std::uint16_t {
  /// uint64, never 0. The run of the daemon, a number drawn at random when it starts. Ends every reply of the daemon's
  /// loop; in a request, the run it is for: any other rejects it with kNewEpoch.
  kEpoch = 0xFF00,
};
inline constexpr std::uint64_t kEpochRecordBytes = sizeof(RecordHeader) + sizeof(std::uint64_t);

/// Array records of a query, all required. Options (query_options.h) have other tags.
enum class QueryRecord : std::uint16_t {
  kMargins = 6,      ///< MarginEntry array
  kPairMargins = 7,  ///< (P,) float64, metres
  kJoints = 8,       ///< (J,) uint32, ids of joints
  kPositions = 9,    ///< (K, J) float64, radians and metres, K the configuration_count; not in kPairs, kOpenPlan
  kWeights = 11,     ///< (J,) float64, radians and metres, for the column free_scale
  kRows = 16,        ///< uint64 row numbers, k P + p; only in kCertify, by default all rows
};
/// Records of a kAttach.
enum class AttachTag : std::uint16_t {
  kAllow = 1,  ///< uint32 selectors of bodies that the child may touch during this attachment
};

/// Records of a kAddBody.
enum class NewBodyTag : std::uint16_t {
  kUncertainty = 20,  ///< BodyUncertaintyRecord
  kTriangles = 21,    ///< TriangleRecord array; makes the vertices of a kHull those of a mesh
  kMeshAs = 22,       ///< uint8 MeshAs of that mesh, by default kHull
  kPoints = 23,       ///< points of a cloud: three float32 each, metres, in the body's frame; by default none
  kReplace = 24,      ///< no payload; the shape and radius replace those of the body of this name, the rest is ignored
};

/// Records of a kReply.
enum class ReplyRecord : std::uint16_t {
  kIgnored = 1,  ///< uint16 tags of the query's records that the daemon ignored
  kJoints = 2,   ///< uint32 J, the entries per row of the column gradient_joints; present with that column
};

struct QueryHeader {
  double max_distance = 0;                ///< metres; +inf without a limit
  double abs_tol = 0;                     ///< metres
  double rel_tol = -1;                    ///< negative for the precision's default
  std::uint32_t pair_count = 0;           ///< P selectors; read only if all_pairs is 0
  std::uint32_t body_count = 0;           ///< M
  std::uint32_t configuration_count = 0;  ///< K; 0 for the current poses
  std::uint32_t fields = kDefaultFields;
  std::uint64_t max_results = 1u << 20;
  std::int64_t max_pose_age_ns = 0;
  std::uint8_t all_pairs = 1;
  std::uint8_t precision = 0;  ///< Precision
  std::uint8_t signed_distance = 0;
  std::uint8_t reduce = 0;  ///< Reduce
  std::uint8_t padding[4] = {};
  std::int64_t min_pose_stamp_ns = 0;  ///< waits for poses of wait_for with this stamp or a newer one; 0 to not wait
  std::int64_t pose_wait_ns = 0;       ///< maximum wait, 0 to 10 s; then kPosesLate
  std::uint32_t wait_for =
      kEveryBody;  ///< body or group selector; unstamped bodies are ignored, but at least one must have a stamp
  std::uint32_t padding2[1] = {};
  std::uint64_t reserved[5] = {};
};

struct ReplyHeader {
  std::uint64_t rows = 0;            ///< of each column
  std::uint64_t total = 0;           ///< pairs found by kWithin, including those past max_results
  std::uint64_t configurations = 0;  ///< K
  std::uint64_t pairs = 0;           ///< P
  std::uint32_t fields = 0;          ///< columns that follow
  std::uint8_t reduce = 0;
  std::uint8_t padding[3] = {};
  std::uint64_t scene_revision = 0;
  std::uint64_t snapshot_revision = 0;  ///< of the poses
  std::int64_t snapshot_stamp_ns = 0;   ///< newest publisher's stamp
  std::int64_t oldest_receipt_ns = 0;   ///< daemon's monotonic clock; 0 if no pose was received
  std::uint64_t pairs_evaluated = 0;
  std::uint64_t engine_ns = 0;         ///< inside the engine
  std::uint64_t server_ns = 0;         ///< from the request's receipt to the complete reply
  char backend[16] = {};               ///< NUL-terminated
  std::int64_t snapshot_sequence = 0;  ///< its publisher's count of the update with snapshot_stamp_ns; 0 if not counted
  std::int64_t pose_age_ns = 0;        ///< from oldest_receipt_ns to the query's start; -1 if no pose was received
};

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

/// A query in device memory that the client maps (docs/wire.md, "Plans").
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

enum class ErrorCode : std::uint16_t {
  kBadQuery = 1,  ///< the first four as in QueryErrorCode
  kWrongScene = 2,
  kTooLarge = 3,
  kNotSupported = 4,
  kBadFrame = 16,      ///< inconsistent magic, sizes or counts
  kWrongVersion = 17,  ///< the text names the supported version
  kUnknownType = 18,
  kBusy = 19,  ///< the queue of this client is full; retry later
  kInternal = 20,
  kReloadFailed = 21,  ///< the old scene stays; the text is the loader's
  kForbidden = 22,     ///< this client lacks the right that the text names
  kPosesLate = 23,     ///< the poses that the query waits for have not arrived in time
  kNewEpoch = 24,      ///< the daemon was restarted, or is another one, since the client's first contact
  kDeadline = 25,      ///< no answer by the query's deadline; the text states the time required or used
};

struct ErrorHeader {
  std::uint16_t code = 0;  ///< ErrorCode
  std::uint16_t padding = 0;
  std::uint32_t text_bytes = 0;
  std::uint64_t needed_bytes = 0;  ///< size of the reply for kTooLarge, otherwise 0
};

#define CLEARANCE_WIRE(type, bytes) \
  static_assert(sizeof(type) == bytes && std::is_trivially_copyable_v<type> && std::is_standard_layout_v<type>)
CLEARANCE_WIRE(FrameHeader, 64);
CLEARANCE_WIRE(RecordHeader, 8);
CLEARANCE_WIRE(QueryHeader, 128);
CLEARANCE_WIRE(ReplyHeader, 128);
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
CLEARANCE_WIRE(ErrorHeader, 16);
#undef CLEARANCE_WIRE

}  // namespace clearance::wire
