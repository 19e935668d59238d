// Builds and validates frames (protocol.h), with the same routines in the daemon and in clients.
//
// Input is untrusted: sizes are computed without overflow and compared with the received bytes before any read,
// enumerations are checked for their range, and records are copied, so that alignment does not matter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "wire/mesh_as.h"
#include "wire/protocol.h"
#include "wire/query_options.h"

namespace clearance::wire {

/// Error for an invalid frame; the text names the part and the expected value.
struct WireError : std::runtime_error {
  WireError(ErrorCode c, const std::string& what) : std::runtime_error(what), code(c) {}
  ErrorCode code;
};

/// View of `count` consecutive records of T in a buffer.
template <class T>
class Records {
 public:
  Records() = default;
  Records(const std::byte* begin, std::uint64_t count) : begin_(begin), count_(count) {}
  std::uint64_t size() const { return count_; }
  /// Record i by value. i < size().
  T operator[](std::uint64_t i) const {
    T record;
    std::memcpy(&record, begin_ + i * sizeof(T), sizeof(T));
    return record;
  }
  const std::byte* data() const { return begin_; }
  std::uint64_t size_bytes() const { return count_ * sizeof(T); }

 private:
  const std::byte* begin_ = nullptr;
  std::uint64_t count_ = 0;
};

struct PairRecord {
  std::uint32_t a = 0;  ///< selector
  std::uint32_t b = 0;
};
struct ConfigurationRecord {
  double pose[7] = {};
};
static_assert(sizeof(PairRecord) == 8 && sizeof(ConfigurationRecord) == 56);

// --- frames

/// Throws WireError (kBadFrame, kWrongVersion) unless the header matches this version and the payload.
void check_header(const FrameHeader& header, std::uint64_t payload_bytes);

/// Copies the header of a contiguous frame, checks it and returns its payload. Throws WireError.
std::span<const std::byte> split_frame(std::span<const std::byte> frame, FrameHeader& header);

/// A payload, split into body and records.
struct PayloadParts {
  std::span<const std::byte> body, records;
};
/// Throws WireError if the header announces more bytes of records than the payload has.
PayloadParts split_payload(const FrameHeader& header, std::span<const std::byte> payload);

/// Creates the header of a frame of `type`.
FrameHeader make_header(FrameType type, std::uint64_t request_id, std::uint64_t payload_bytes,
                        std::uint64_t scene_revision = 0, std::uint64_t client_id = 0);

/// Header of the reply to `request`.
FrameHeader make_reply_header(const FrameHeader& request, FrameType type, std::uint64_t payload_bytes,
                              std::uint64_t scene_revision);

/// Returns the type's name for messages, such as "kQuery", or the number of an unknown type.
std::string type_name(std::uint16_t type);
/// Returns the code's name for messages and counters, such as "bad_query".
std::string_view error_name(ErrorCode code);

/// Appends to a payload under construction.
void append_bytes(std::vector<std::byte>& bytes, const void* data, std::size_t size);
template <class T>
void append(std::vector<std::byte>& bytes, const T& record) {
  static_assert(std::is_trivially_copyable_v<T>);
  append_bytes(bytes, &record, sizeof record);
}

/// Builds a frame; take() writes the payload's size into the header.
class FrameBuilder {
 public:
  explicit FrameBuilder(const FrameHeader& header) { add(header); }

  template <class T>
  FrameBuilder& add(const T& record) {
    append(bytes_, record);
    return *this;
  }
  FrameBuilder& add_bytes(const void* data, std::size_t size) {
    append_bytes(bytes_, data, size);
    return *this;
  }
  /// Returns the complete frame.
  std::vector<std::byte> take();

 private:
  std::vector<std::byte> bytes_;
};

// --- records

struct RecordView {
  std::uint16_t tag;
  bool required;
  std::span<const std::byte> bytes;
};
/// Tags of ignored records.
using PassedOver = std::vector<std::uint16_t>;

void append_record(std::vector<std::byte>& records, std::uint16_t tag, std::uint16_t flags,
                   std::span<const std::byte> bytes);
/// Inserts a record before the first one with a higher tag, since tags must ascend.
/// \param records output of append_record()
void insert_record(std::vector<std::byte>& records, std::uint16_t tag, std::uint16_t flags,
                   std::span<const std::byte> bytes);
/// Appends CommonRecord::kEpoch.
/// \param flags kRecordRequired in a request
void append_epoch(std::vector<std::byte>& records, std::uint64_t epoch, std::uint16_t flags = 0);
/// Returns the epoch in a reply, or 0. Throws WireError for invalid records.
std::uint64_t epoch_of(const FrameHeader& header, std::span<const std::byte> payload);
/// Returns `header` for a payload that ends in `records_bytes` of records.
FrameHeader with_records(FrameHeader header, std::uint64_t records_bytes);
/// Calls know(record), which returns whether it knows the tag, for each record except the epoch. Adds unknown tags to
/// `passed_over` or, if required, rejects them. Throws WireError (kBadFrame for sizes, flags and tags that do not
/// ascend; kNotSupported).
/// \param what names the frame in errors.
/// \return the epoch among them, or 0
template <class Know>
std::uint64_t read_records(const char* what, std::span<const std::byte> records, PassedOver& passed_over, Know know);

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
/// Inserts the records of a query's joints, if it has any.
/// \param positions empty for kPairs
void insert_joint_records(std::vector<std::byte>& records, std::span<const std::uint32_t> joints,
                          std::span<const double> positions);

/// Throws WireError (kBadFrame for sizes, kBadQuery for values, kNotSupported for an unknown required record).
/// \param with_configurations has_configurations() of the query's type.
QueryParts parse_query(std::span<const std::byte> payload, bool with_configurations = true,
                       std::span<const std::byte> records = {});
/// Parses the payload of a kQuery, kPairs, kCertify or kOpenPlan frame, with its records.
QueryParts parse_query(const FrameHeader& header, std::span<const std::byte> payload);

// --- kReply

/// Bytes of the columns of a reply. Throws WireError (kTooLarge) beyond the maximum size of a frame.
/// \param joints number of the query's joints, read only with kFieldGradientJoints
std::uint64_t columns_bytes(std::uint64_t rows, std::uint32_t fields, std::uint64_t joints = 0);
/// Offset of the column of `field` from the end of the ReplyHeader. The column must be among `fields`.
std::uint64_t column_offset(std::uint64_t rows, std::uint32_t fields, Field field, std::uint64_t joints = 0);
/// Throws WireError unless the payload contains exactly the columns in the header and no unknown required record.
/// \param joints receives J of a reply with kFieldGradientJoints, otherwise 0; can be null
ReplyHeader parse_reply(std::span<const std::byte> payload, std::span<const std::byte> records = {},
                        std::uint32_t* joints = nullptr);

// --- the others

struct PosesParts {
  PosesHeader header;
  Records<PoseRecord> poses;
};
PosesParts parse_poses(std::span<const std::byte> payload);
struct JointUpdateParts {
  PosesHeader header;
  Records<JointRecord> joints;
};
JointUpdateParts parse_joint_update(std::span<const std::byte> payload);
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

// --- templates of the above

/// Removes the first of `records` and returns it. Throws WireError (kBadFrame).
/// \param last the previous tag, initially 0; set to the record's tag
RecordView take_record(const char* what, std::span<const std::byte>& records, std::uint16_t& last);
/// Throws WireError (kNotSupported) if the record is required.
void pass_over(const char* what, const RecordView& record, PassedOver& passed_over);

/// Returns the epoch in a record. Throws WireError (kBadFrame).
std::uint64_t epoch_in(const char* what, const RecordView& record);

template <class Know>
std::uint64_t read_records(const char* what, std::span<const std::byte> records, PassedOver& passed_over, Know know) {
  std::uint64_t epoch = 0;
  for (std::uint16_t last = 0; !records.empty();) {
    const RecordView record = take_record(what, records, last);
    if (record.tag == static_cast<std::uint16_t>(CommonRecord::kEpoch))
      epoch = epoch_in(what, record);
    else if (!know(record))
      pass_over(what, record, passed_over);
  }
  return epoch;
}

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

/// Returns the name in a fixed field, up to its NUL.
template <std::size_t N>
std::string name_of(const char (&field)[N]) {
  return {field, strnlen(field, N)};
}
/// Writes a name into a fixed field, truncated to fit and NUL-terminated.
template <std::size_t N>
void set_name(char (&field)[N], std::string_view name) {
  const std::size_t size = name.size() < N ? name.size() : N - 1;
  std::memset(field, 0, N);
  std::memcpy(field, name.data(), size);
}

}  // namespace clearance::wire
