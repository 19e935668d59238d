// Builds and validates the payloads of frames (frames.h), with the same routines in the daemon and in clients.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "wire/frames.h"
#include "wire/mesh_as.h"
#include "wire/payloads.h"
#include "wire/query_options.h"

namespace clearance::wire {

struct PairRecord {
  std::uint32_t a = 0;  ///< selector
  std::uint32_t b = 0;
};
struct ConfigurationRecord {
  double pose[7] = {};
};
static_assert(sizeof(PairRecord) == 8 && sizeof(ConfigurationRecord) == 56);

// --- kQuery, kPairs, kCertify, kOpenPlan

/// Whether a request of this type contains configurations, not only their number.
constexpr bool has_configurations(FrameType query) {
  return query != FrameType::kPairs && query != FrameType::kOpenPlan;
}

struct QueryParts {
  QueryHeader header;
  QueryOptions options;  ///< from the header and from records
  PassedOver passed_over;
  std::uint64_t epoch = 0;                      ///< intended run of the daemon, or 0
  Records<PairRecord> pairs;                    ///< (P,)
  Records<std::uint32_t> bodies;                ///< (M,)
  Records<ConfigurationRecord> configurations;  ///< (K, M); empty if has_configurations() is false
  Records<MarginEntry> margins;                 ///< margins of pairs of selectors; not validated
  Records<double> pair_margins;                 ///< a margin of each pair; not validated
  Records<std::uint32_t> joints;                ///< (J,)
  Records<double> positions;                    ///< (K, J); empty if has_configurations() is false
  Records<double> weights;                      ///< weights of the joints; not validated
  Records<double> growths;                      ///< (K, M) growths of the bodies; empty for none
  Records<double> velocities;                   ///< (K, J), or empty
  Records<double> twists;                       ///< (K, M, 6), or empty
  Records<double> speed_errors;                 ///< (J + 2 M,), or empty; not validated
  Records<std::uint64_t> rows;                  ///< rows of kCertify; not validated
  bool has_rows = false;                        ///< whether the record of `rows` is present
};

/// Bytes of a query's payload. Throws WireError (kTooLarge) beyond the maximum size of a frame.
std::uint64_t query_payload_bytes(std::uint64_t pairs, std::uint64_t bodies, std::uint64_t configurations);

/// Writes a complete kQuery, kPairs, kCertify or kOpenPlan frame of sizeof(FrameHeader) + query_payload_bytes(...) +
/// records to `frame`, with the counts of `query`. If has_configurations() is false, there are no configurations, and
/// query_payload_bytes() counts 0.
void write_query(std::byte* frame, const FrameHeader& header, const QueryHeader& query, const void* pairs,
                 const void* bodies, const void* configurations, std::span<const std::byte> records = {});

/// Returns required records of the options outside QueryHeader that differ from their defaults.
/// \param options QueryOptions, or a type with members of the same names.
template <class Options>
std::vector<std::byte> option_records(const Options& options);
/// The arrays of a query's joints and of its configurations, which are empty for kPairs except `joints`.
struct QueryInputs {
  std::span<const std::uint32_t> joints = {};  ///< (J,)
  std::span<const double> positions = {};      ///< (K, J)
  std::span<const double> growths = {};        ///< (K, M)
  std::span<const double> velocities = {};     ///< (K, J)
  std::span<const double> twists = {};         ///< (K, M, 6)
};
/// Calls add(tag, bytes) for each input that is not empty, in the order of tags.
template <class Add>
void for_each_input(const QueryInputs& inputs, Add&& add) {
  const auto one = [&add](QueryRecord tag, auto array) {
    if (!array.empty()) add(tag, std::as_bytes(array));
  };
  one(QueryRecord::kJoints, inputs.joints);
  one(QueryRecord::kPositions, inputs.positions);
  one(QueryRecord::kGrowths, inputs.growths);
  one(QueryRecord::kVelocities, inputs.velocities);
  one(QueryRecord::kTwists, inputs.twists);
}
/// Inserts the records of a query's inputs.
void insert_inputs(std::vector<std::byte>& records, const QueryInputs& inputs);

/// Throws WireError (kBadFrame for sizes, kBadQuery for values, kNotSupported for an unknown required record).
/// \param with_configurations has_configurations() of the query's type.
QueryParts parse_query(std::span<const std::byte> payload, bool with_configurations = true,
                       std::span<const std::byte> records = {});
/// Parses the payload of a kQuery, kPairs, kCertify or kOpenPlan frame, with its records.
QueryParts parse_query(const FrameHeader& header, std::span<const std::byte> payload);

// --- kReply

/// Bytes of the columns of a reply. Throws WireError (kTooLarge) beyond the maximum size of a frame.
/// \param joints number of the query's joints, read only with kJointFields
std::uint64_t columns_bytes(std::uint64_t rows, std::uint32_t fields, std::uint64_t joints = 0);
/// Offset of the column of `field` from the end of the ReplyHeader. The column must be among `fields`.
std::uint64_t column_offset(std::uint64_t rows, std::uint32_t fields, Field field, std::uint64_t joints = 0);
/// Throws WireError unless the payload contains exactly the columns in the header and no unknown required record.
/// \param joints receives J of a reply with kJointFields, otherwise 0; can be null
ReplyHeader parse_reply(std::span<const std::byte> payload, std::span<const std::byte> records = {},
                        std::uint32_t* joints = nullptr);

// --- the others

/// Records of an update of poses or joints.
struct UpdateExtras {
  Records<double> velocities;  ///< (count, 6) or (count,), or empty
  PassedOver passed_over;
  std::uint64_t epoch = 0;  ///< as QueryParts::epoch
};
/// Returns the record of an update's velocities, or nothing if there are none.
std::vector<std::byte> velocity_records(std::span<const std::byte> velocities);
struct PosesParts {
  PosesHeader header;
  Records<PoseRecord> poses;
  UpdateExtras extras;
};
PosesParts parse_poses(std::span<const std::byte> payload, std::span<const std::byte> records = {});
struct JointUpdateParts {
  PosesHeader header;
  Records<JointRecord> joints;
  UpdateExtras extras;
};
JointUpdateParts parse_joint_update(std::span<const std::byte> payload, std::span<const std::byte> records = {});
struct PointsParts {
  PointsHeader header;
  std::span<const std::byte> xyz;  ///< twelve bytes per point
};
PointsParts parse_points(std::span<const std::byte> payload);
struct AttachParts {
  AttachRecord record;
  std::vector<std::uint32_t> allow;  ///< selectors
  PassedOver passed_over;
  std::uint64_t epoch = 0;  ///< as QueryParts::epoch
};
AttachParts parse_attach(std::span<const std::byte> payload, std::span<const std::byte> records = {});
AllowRecord parse_allow(std::span<const std::byte> payload);
PosesResult parse_poses_done(std::span<const std::byte> payload);

struct SceneParts {
  SceneHeader header;
  Records<BodyRecord> bodies;
  Records<GroupRecord> groups;
  Records<std::uint32_t> members;
};
/// Also checks that names are terminated, and that members are bodies.
SceneParts parse_scene(std::span<const std::byte> payload);

struct PairTableParts {
  PairsHeader header;
  Records<PairRecord> pairs;
};
PairTableParts parse_pair_table(std::span<const std::byte> payload);

struct StatesParts {
  StatesHeader header;
  Records<BodyStateRecord> states;
};
StatesParts parse_states(std::span<const std::byte> payload);

struct JointsParts {
  JointsHeader header;
  Records<JointStateRecord> joints;
  Records<GroupRecord> groups;
  Records<std::uint32_t> members;
};
/// Also checks that names are terminated, and that members are joints.
JointsParts parse_joints(std::span<const std::byte> payload);

struct NewBodyParts {
  NewBodyRecord record;
  Records<VertexRecord> vertices;
  Records<TriangleRecord> triangles;  ///< empty for the vertices of a hull
  MeshAs mesh_as = MeshAs::kHull;
  Records<std::array<float, 3>> points;  ///< points of a cloud
  BodyUncertaintyRecord uncertainties;
  bool replaces = false;  ///< whether this is the new shape of an existing body
  PassedOver passed_over;
  std::uint64_t epoch = 0;  ///< as QueryParts::epoch
};
/// Also checks that the name is terminated, that shape and `mesh_as` are valid, and that only clouds have points.
/// Does not check the indices of triangles.
NewBodyParts parse_new_body(std::span<const std::byte> payload, std::span<const std::byte> records = {});
RemoveBodyRecord parse_remove_body(std::span<const std::byte> payload);
SceneChange parse_scene_changed(std::span<const std::byte> payload);

struct PlanParts {
  PlanHeader header;
  Records<PlanColumnRecord> columns;
};
/// Also checks that poses, positions and columns are consecutive within the memory, and that the columns match the
/// header.
PlanParts parse_plan(std::span<const std::byte> payload);
/// Parses the payload of kRunPlan and kClosePlan.
PlanRecord parse_plan_request(std::span<const std::byte> payload);
PlanResult parse_plan_done(std::span<const std::byte> payload);

/// Also checks that names are terminated.
Records<CounterRecord> parse_stats(std::span<const std::byte> payload);

struct ErrorParts {
  ErrorHeader header;
  std::string text;
};
ErrorParts parse_error(std::span<const std::byte> payload);

/// Throws WireError if the payload is not empty.
void parse_empty(std::span<const std::byte> payload, std::uint16_t type);

template <class Options>
std::vector<std::byte> option_records(const Options& options) {
  std::vector<std::byte> records;
  for_each_query_option([&](const QueryOption& option, auto member) {
    if constexpr (!requires(QueryHeader& header) { member(header); })
      if (const auto& value = member(options); value != member(kDefaultOptions)) {
        const auto sent = static_cast<OptionOnWire<std::remove_cvref_t<decltype(value)>>>(value);
        append_record(records, option.tag, kRecordRequired, std::as_bytes(std::span(&sent, 1)));
      }
  });
  return records;
}

}  // namespace clearance::wire
