// Frames exchanged by clients and the daemon, the same over every transport: their types, records, queries and errors.
// payloads.h has the other payloads.
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
// Later additions travel in records (docs/service/wire.md, "Versions").
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
  kCertificate = 0x8C,   ///< payload: the document (JSON, UTF-8), docs/trust/certificates.md
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
  kMargins = 6,       ///< MarginEntry array
  kPairMargins = 7,   ///< (P,) float64, metres
  kJoints = 8,        ///< (J,) uint32, ids of joints
  kPositions = 9,     ///< (K, J) float64, radians and metres, K the configuration_count; not in kPairs, kOpenPlan
  kWeights = 11,      ///< (J,) float64, radians and metres, for the column free_scale
  kGrowths = 13,      ///< (K, M) float64, metres, of motions; not in kPairs, kOpenPlan
  kRows = 16,         ///< uint64 row numbers, k P + p; only in kCertify, by default all rows
  kVelocities = 18,   ///< (K, J) float64, rad/s and m/s; where kPositions may be
  kTwists = 19,       ///< (K, M, 6) float64, rad/s and m/s of each moved body's origin, world axes; likewise
  kSpeedErrors = 20,  ///< (J + 2 M,) float64, for the column rate_bounds
};
/// Records of a kSetPoses and a kSetJoints.
enum class UpdateRecord : std::uint16_t {
  kVelocities = 1,  ///< (count, 6) or (count,) float64, as kTwists and kVelocities of a query; NaN where unknown
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
  kJoints = 2,   ///< uint32 J; present with the columns gradient_joints and hessian_joints
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
  std::int64_t deadline_ns = 0;        ///< maximum time from receipt to answer, the wait included; 0 for no limit
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
CLEARANCE_WIRE(ErrorHeader, 16);
#undef CLEARANCE_WIRE

}  // namespace clearance::wire
