// Builds and checks frames of the wire contract (protocol.h): one routine for each, used by the daemon and by clients.
//
// Nothing here trusts a byte: every size is computed without overflow and compared with what arrived before anything is
// read, every enumeration is checked for its range, and records are read by copy, so that no alignment is asked for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "convexify.h"
#include "protocol.h"
#include "query_options.h"

namespace clearance::wire {

/// A frame that cannot be accepted; the text names the part and what was expected there.
struct WireError : std::runtime_error {
  WireError(ErrorCode c, const std::string& what) : std::runtime_error(what), code(c) {}
  ErrorCode code;
};

/// `count` records of T, one after another in somebody's bytes.
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

/// Throws WireError (kBadFrame, kWrongVersion) unless the header fits this version and the payload that came with it.
void check_header(const FrameHeader& header, std::uint64_t payload_bytes);

/// Copies the header of a contiguous frame, checks it and returns its payload. Throws WireError.
std::span<const std::byte> split_frame(std::span<const std::byte> frame, FrameHeader& header);

/// A payload without its records, and these.
struct PayloadParts {
  std::span<const std::byte> body, records;
};
/// Throws WireError for a header that speaks of more records than there are bytes.
PayloadParts split_payload(const FrameHeader& header, std::span<const std::byte> payload);

/// The header of a frame of `type`.
FrameHeader make_header(FrameType type, std::uint64_t request_id, std::uint64_t payload_bytes,
                        std::uint64_t scene_revision = 0, std::uint64_t client_id = 0);

/// The header of what answers `request`: in its version, for whoever sent it.
FrameHeader make_reply_header(const FrameHeader& request, FrameType type, std::uint64_t payload_bytes,
                              std::uint64_t scene_revision);

/// The type's name for messages: "kQuery"; of an unknown one its number.
std::string type_name(std::uint16_t type);
/// The code's name for messages and counters: "bad_query".
std::string_view error_name(ErrorCode code);

/// Appends to a payload under construction.
void append_bytes(std::vector<std::byte>& bytes, const void* data, std::size_t size);
template <class T>
void append(std::vector<std::byte>& bytes, const T& record) {
  static_assert(std::is_trivially_copyable_v<T>);
  append_bytes(bytes, &record, sizeof record);
}

/// Appends to a frame under construction; the payload's size is written into the header at the end.
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
  /// The whole frame.
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
/// Tags of records that were passed over.
using PassedOver = std::vector<std::uint16_t>;

void append_record(std::vector<std::byte>& records, std::uint16_t tag, std::uint16_t flags,
                   std::span<const std::byte> bytes);
/// The same before the first record whose tag is higher, as tags have to rise.
/// \param records as append_record() made them
void insert_record(std::vector<std::byte>& records, std::uint16_t tag, std::uint16_t flags,
                   std::span<const std::byte> bytes);
/// Appends CommonRecord::kEpoch. \param flags kRecordRequired in a request
void append_epoch(std::vector<std::byte>& records, std::uint64_t epoch, std::uint16_t flags = 0);
/// The epoch that a reply names; 0: none. Throws WireError for records that make no sense.
std::uint64_t epoch_of(const FrameHeader& header, std::span<const std::byte> payload);
/// The header of a frame whose payload ends in so many bytes of records; unchanged if there are none.
FrameHeader with_records(FrameHeader header, std::uint64_t records_bytes);
/// Calls know(record), which returns whether the tag is known to it. One that is not is noted in `passed_over`, or, if
/// it is required, refused. Throws WireError (kBadFrame for sizes, flags and tags that do not rise; kNotSupported).
/// \param what names the frame in errors.
/// \return the epoch among them, which know() is not asked about; 0: there is none
template <class Know>
std::uint64_t read_records(const char* what, std::span<const std::byte> records, PassedOver& passed_over, Know know);

// --- kQuery, kPairs, kCertify, kOpenPlan

/// Whether a request of this type has configurations in it, beside how many they are.
constexpr bool has_configurations(FrameType query) {
  return query != FrameType::kPairs && query != FrameType::kOpenPlan;
}

struct QueryParts {
  QueryHeader header;
  QueryOptions options;  ///< whether they came in the header or in records
  PassedOver passed_over;
  std::uint64_t epoch = 0;                      ///< that it is for; 0: it names none
  Records<PairRecord> pairs;                    ///< (P,)
  Records<std::uint32_t> bodies;                ///< (M,)
  Records<ConfigurationRecord> configurations;  ///< (K, M); empty where has_configurations() is false
  Records<MarginEntry> margins;                 ///< of pairs of selectors; not looked at
  Records<double> pair_margins;                 ///< one of each pair; not looked at
  Records<std::uint32_t> joints;                ///< (J,)
  Records<double> positions;                    ///< (K, J); likewise
  Records<double> weights;                      ///< of the joints; not looked at
  Records<std::uint64_t> rows;                  ///< of kCertify; not looked at
  bool has_rows = false;                        ///< there is such a record
};

/// Bytes of a query's payload. Throws WireError (kTooLarge) if a frame cannot be so large.
std::uint64_t query_payload_bytes(std::uint64_t pairs, std::uint64_t bodies, std::uint64_t configurations);

/// Writes a whole kQuery, kPairs, kCertify or kOpenPlan frame of sizeof(FrameHeader) + query_payload_bytes(...) +
/// records at `frame`. The counts are those of `query`; where has_configurations() is false they are left out (and
/// counted as 0 in query_payload_bytes).
void write_query(std::byte* frame, const FrameHeader& header, const QueryHeader& query, const void* pairs,
                 const void* bodies, const void* configurations, std::span<const std::byte> records = {});

/// The records of those options that have no place in QueryHeader and differ from their defaults, each required.
/// \param options QueryOptions, or what has members of the same names.
template <class Options>
std::vector<std::byte> option_records(const Options& options);
/// Inserts the records of a query's joints, if it has any. \param positions of kPairs: none
void insert_joint_records(std::vector<std::byte>& records, std::span<const std::uint32_t> joints,
                          std::span<const double> positions);

/// Throws WireError (kBadFrame for sizes, kBadQuery for values, kNotSupported for a record that it may not pass over).
/// \param with_configurations has_configurations() of its type.
QueryParts parse_query(std::span<const std::byte> payload, bool with_configurations = true,
                       std::span<const std::byte> records = {});
/// The payload of a kQuery, kPairs, kCertify or kOpenPlan frame, with its records.
QueryParts parse_query(const FrameHeader& header, std::span<const std::byte> payload);

// --- kReply

/// Bytes of the columns of a reply. Throws WireError (kTooLarge) if a frame cannot be so large.
/// \param joints of the query: J, read only with kFieldGradientJoints
std::uint64_t columns_bytes(std::uint64_t rows, std::uint32_t fields, std::uint64_t joints = 0);
/// Where the column of `field` begins, from the end of the ReplyHeader. The column must be among `fields`.
std::uint64_t column_offset(std::uint64_t rows, std::uint32_t fields, Field field, std::uint64_t joints = 0);
/// Throws WireError unless the columns that the header speaks of are all there, and nothing else but records that it
/// may pass over. \param joints receives J of a reply with kFieldGradientJoints, else 0; may be null
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
  std::span<const std::byte> xyz;  ///< twelve bytes for each point
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
/// Also checks that names end, members exist and are bodies.
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
/// Also checks that names end, and members exist and are joints.
JointsParts parse_joints(std::span<const std::byte> payload);

struct NewBodyParts {
  NewBodyRecord record;
  Records<VertexRecord> vertices;
  Records<TriangleRecord> triangles;  ///< empty: the vertices are those of a hull
  Convexify convexify = Convexify::kHull;
  Records<std::array<float, 3>> points;  ///< of a cloud
  BodyDoubts doubts;
  PassedOver passed_over;
  std::uint64_t epoch = 0;  ///< as QueryParts::epoch
};
/// Also checks that the name ends, that there is such a shape, that only clouds have points, and such a `convexify` of
/// triangles; not which vertices these name.
NewBodyParts parse_new_body(std::span<const std::byte> payload, std::span<const std::byte> records = {});
RemoveBodyRecord parse_remove_body(std::span<const std::byte> payload);
SceneChange parse_scene_changed(std::span<const std::byte> payload);

struct PlanParts {
  PlanHeader header;
  Records<PlanColumnRecord> columns;
};
/// Also checks that poses, positions and columns lie in the memory, one after another, and that the columns are those
/// that the header speaks of.
PlanParts parse_plan(std::span<const std::byte> payload);
/// Of kRunPlan and kClosePlan.
PlanRecord parse_plan_request(std::span<const std::byte> payload);
PlanResult parse_plan_done(std::span<const std::byte> payload);

/// Also checks that names end.
Records<CounterRecord> parse_stats(std::span<const std::byte> payload);

struct ErrorParts {
  ErrorHeader header;
  std::string text;
};
ErrorParts parse_error(std::span<const std::byte> payload);

/// The payload of a frame without one: throws WireError if there are bytes.
void parse_empty(std::span<const std::byte> payload, std::uint16_t type);

// --- templates of the above

/// The record at the front of `records`, which it is taken from. \param last tag before it, 0 at first, and then its
/// own. Throws WireError (kBadFrame).
RecordView take_record(const char* what, std::span<const std::byte>& records, std::uint16_t& last);
/// Throws WireError (kNotSupported) if the record is required.
void pass_over(const char* what, const RecordView& record, PassedOver& passed_over);

/// The epoch that a record names. Throws WireError (kBadFrame).
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

/// The name in a fixed field, up to its NUL.
template <std::size_t N>
std::string name_of(const char (&field)[N]) {
  return {field, strnlen(field, N)};
}
/// Writes a name into a fixed field, cut to fit and NUL-terminated.
template <std::size_t N>
void set_name(char (&field)[N], std::string_view name) {
  const std::size_t size = name.size() < N ? name.size() : N - 1;
  std::memset(field, 0, N);
  std::memcpy(field, name.data(), size);
}

}  // namespace clearance::wire
