#include "wire.h"

#include <concepts>
#include <limits>

namespace clearance::wire {
namespace {

constexpr std::uint64_t kMaxPayloadBytes = kMaxFrameBytes - sizeof(FrameHeader);
constexpr std::uint32_t kAllFields = (1u << kFieldCount) - 1;
constexpr std::uint64_t kRecordAlignment = 8;

// Sizes are summed in 128 bits: three counts of 32 bits and a record size cannot overflow it.
using Wide = unsigned __int128;

constexpr std::uint64_t align(std::uint64_t bytes, std::uint64_t to) {
  return (bytes + to - 1) / to * to;
}

template <std::integral T>
std::string str(T value) {
  return std::to_string(value);
}

std::string str(Wide value) {
  if (value > std::numeric_limits<std::uint64_t>::max()) return "more than 2^64";
  return std::to_string(static_cast<std::uint64_t>(value));
}

std::string str(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

[[noreturn]] void bad_frame(const std::string& text) {
  throw WireError(ErrorCode::kBadFrame, text);
}
[[noreturn]] void bad_query(const std::string& text) {
  throw WireError(ErrorCode::kBadQuery, text);
}

/// The fixed struct that a payload begins with.
template <class T>
T head(std::span<const std::byte> payload, const char* what) {
  if (payload.size() < sizeof(T))
    bad_frame(std::string(what) + ": the payload has " + str(payload.size()) + " bytes, fewer than its header of " +
              str(sizeof(T)));
  T header;
  std::memcpy(&header, payload.data(), sizeof(T));
  return header;
}

/// \param contents says what a payload of the expected size holds: a text made where it is wrong, not for every frame.
template <class Contents>
void expect_size(const char* what, const Contents& contents, Wide expected, std::uint64_t got) {
  if (expected != got)
    bad_frame(std::string(what) + ": " + contents() + " need a payload of " + str(expected) + " bytes, got " +
              str(got));
}
std::string its_contents() {
  return "its contents";
}

template <class T, std::size_t N>
void expect_zero(const T (&reserved)[N], const char* what) {
  for (const T& word : reserved)
    if (word != 0) bad_frame(std::string(what) + ": reserved words must be 0");
}

template <std::size_t N>
void expect_name(const char (&name)[N], const char* what, std::uint64_t index) {
  if (strnlen(name, N) == N) bad_frame(std::string(what) + "[" + str(index) + "]: the name does not end");
}

/// Sections that follow one another in a payload whose size has been checked.
class Cursor {
 public:
  explicit Cursor(const std::byte* at) : at_(at) {}
  template <class T>
  Records<T> take(std::uint64_t count) {
    Records<T> records(at_, count);
    at_ += records.size_bytes();
    return records;
  }
  void skip(std::uint64_t bytes) { at_ += bytes; }

 private:
  const std::byte* at_;
};

Wide query_bytes(std::uint64_t pairs, std::uint64_t bodies, std::uint64_t configurations) {
  return Wide(sizeof(QueryHeader)) + Wide(pairs) * sizeof(PairRecord) + (Wide(bodies) * 4 + 7) / 8 * 8 +
         Wide(configurations) * bodies * sizeof(ConfigurationRecord);
}

Wide columns_wide(std::uint64_t rows, std::uint32_t fields) {
  Wide bytes = 0;
  for (int f = 0; f < kFieldCount; ++f)
    if (fields >> f & 1)
      bytes = (bytes + Wide(rows) * kFieldBytes[f] + kColumnAlignment - 1) / kColumnAlignment * kColumnAlignment;
  return bytes;
}

/// An option's value as it came: a word as its number.
template <class T>
void check_option(const QueryOption& option, T value) {
  const std::string name = std::string("query: ") + option.name;
  const Legal& legal = option.legal;
  switch (legal.kind) {
    case Legal::Kind::kAnything:
      return;
    case Legal::Kind::kWord:
      if (double(value) > legal.most) bad_query(name + " " + str(value) + " is none of 0 to " + str(legal.most));
      return;
    case Legal::Kind::kBits:
      if (const auto unknown = static_cast<std::uint64_t>(value) & ~legal.mask)
        bad_query(name + " has unknown bits: " + str(unknown));
      return;
    case Legal::Kind::kRange:
      if (double(value) >= legal.least && double(value) <= legal.most) return;
      bad_query(name + " must be " +
                (legal.text ? legal.text : str(std::int64_t(legal.least)) + " to " + str(std::int64_t(legal.most))) +
                ", got " + str(value));
  }
}

void check_query_header(const QueryHeader& q) {
  if (q.all_pairs > 1) bad_query("query: all_pairs " + str(q.all_pairs) + " is none of 0 to 1");
  if (q.all_pairs && q.pair_count) bad_query("query: all_pairs is set, yet " + str(q.pair_count) + " pairs are named");
  if (q.configuration_count && !q.body_count)
    bad_query("query: " + str(q.configuration_count) + " configurations of no bodies");
  expect_zero(q.padding, "query");
  expect_zero(q.padding2, "query");
  expect_zero(q.reserved, "query");
}

QueryOptions read_options(const QueryHeader& header, std::span<const std::byte> records, PassedOver& passed_over) {
  QueryOptions options;
  for_each_query_option([&](const QueryOption& option, auto member) {
    if constexpr (requires { member(header); }) {
      check_option(option, member(header));
      member(options) = static_cast<std::remove_reference_t<decltype(member(options))>>(member(header));
    }
  });
  read_records("query", records, passed_over, [&](const RecordView& record) {
    bool known = false;
    for_each_query_option([&](const QueryOption& option, auto member) {
      using T = std::remove_reference_t<decltype(member(options))>;
      if (option.tag == 0 || option.tag != record.tag) return;
      known = true;
      OptionOnWire<T> value;
      if (record.bytes.size() != sizeof value)
        bad_frame("query: " + std::string(option.name) + " (record " + str(option.tag) + ") has " +
                  str(record.bytes.size()) + " bytes, expected " + str(sizeof value));
      std::memcpy(&value, record.bytes.data(), sizeof value);
      check_option(option, value);
      member(options) = static_cast<T>(value);
    });
    return known;
  });
  if (options.pose_wait_ns && !options.min_pose_stamp_ns)
    bad_query("query: pose_wait_ns is for a query with min_pose_stamp_ns");
  return options;
}

}  // namespace

void check_header(const FrameHeader& h, std::uint64_t payload_bytes) {
  if (h.magic != kMagic) {
    char text[80];
    std::snprintf(text, sizeof text, "frame: magic is 0x%08x, expected 0x%08x", h.magic, kMagic);
    bad_frame(text);
  }
  if (h.version != kVersion && h.version != kRecordsVersion)
    throw WireError(ErrorCode::kWrongVersion,
                    "frame: version " + str(h.version) + ", this side speaks versions 1 and " + str(kRecordsVersion));
  if (h.payload_bytes > kMaxPayloadBytes)
    bad_frame("frame: a payload of " + str(h.payload_bytes) + " bytes is more than the " + str(kMaxPayloadBytes) +
              " allowed");
  if (h.payload_bytes != payload_bytes)
    bad_frame("frame: the header speaks of a payload of " + str(h.payload_bytes) + " bytes, " + str(payload_bytes) +
              " came");
  if (h.version == kVersion && h.records_bytes) bad_frame("frame: reserved words must be 0");
  expect_zero(h.reserved, "frame");
}

std::span<const std::byte> split_frame(std::span<const std::byte> frame, FrameHeader& header) {
  if (frame.size() < sizeof header)
    bad_frame("frame: " + str(frame.size()) + " bytes, fewer than a header of " + str(sizeof header));
  std::memcpy(&header, frame.data(), sizeof header);
  const auto payload = frame.subspan(sizeof header);
  check_header(header, payload.size());
  return payload;
}

PayloadParts split_payload(const FrameHeader& h, std::span<const std::byte> payload) {
  if (h.version == kVersion) return {payload, {}};
  if (h.records_bytes > payload.size() || h.records_bytes % kRecordAlignment)
    bad_frame("frame: " + str(h.records_bytes) + " bytes are no whole records at the end of a payload of " +
              str(payload.size()));
  const std::size_t body = payload.size() - static_cast<std::size_t>(h.records_bytes);
  return {payload.first(body), payload.subspan(body)};
}

FrameHeader make_header(FrameType type, std::uint64_t request_id, std::uint64_t payload_bytes,
                        std::uint64_t scene_revision, std::uint64_t client_id) {
  FrameHeader header;
  header.type = static_cast<std::uint16_t>(type);
  header.request_id = request_id;
  header.payload_bytes = payload_bytes;
  header.scene_revision = scene_revision;
  header.client_id = client_id;
  return header;
}

FrameHeader make_reply_header(const FrameHeader& request, FrameType type, std::uint64_t payload_bytes,
                              std::uint64_t scene_revision) {
  FrameHeader header = make_header(type, request.request_id, payload_bytes, scene_revision, request.client_id);
  if (request.version == kRecordsVersion) header.version = kRecordsVersion;
  return header;
}

std::string type_name(std::uint16_t type) {
  switch (static_cast<FrameType>(type)) {
    case FrameType::kPing:
      return "kPing";
    case FrameType::kDescribe:
      return "kDescribe";
    case FrameType::kQuery:
      return "kQuery";
    case FrameType::kPairs:
      return "kPairs";
    case FrameType::kSetPoses:
      return "kSetPoses";
    case FrameType::kAttach:
      return "kAttach";
    case FrameType::kGetStates:
      return "kGetStates";
    case FrameType::kGetStats:
      return "kGetStats";
    case FrameType::kReload:
      return "kReload";
    case FrameType::kAddBody:
      return "kAddBody";
    case FrameType::kRemoveBody:
      return "kRemoveBody";
    case FrameType::kPong:
      return "kPong";
    case FrameType::kScene:
      return "kScene";
    case FrameType::kReply:
      return "kReply";
    case FrameType::kPairTable:
      return "kPairTable";
    case FrameType::kPosesDone:
      return "kPosesDone";
    case FrameType::kBodyStates:
      return "kBodyStates";
    case FrameType::kStats:
      return "kStats";
    case FrameType::kSceneChanged:
      return "kSceneChanged";
    case FrameType::kError:
      return "kError";
  }
  return std::to_string(type);
}

std::string_view error_name(ErrorCode code) {
  switch (code) {
    case ErrorCode::kBadQuery:
      return "bad_query";
    case ErrorCode::kWrongScene:
      return "wrong_scene";
    case ErrorCode::kTooLarge:
      return "too_large";
    case ErrorCode::kNotSupported:
      return "not_supported";
    case ErrorCode::kBadFrame:
      return "bad_frame";
    case ErrorCode::kWrongVersion:
      return "wrong_version";
    case ErrorCode::kUnknownType:
      return "unknown_type";
    case ErrorCode::kBusy:
      return "busy";
    case ErrorCode::kInternal:
      return "internal";
    case ErrorCode::kPosesLate:
      return "poses_late";
    case ErrorCode::kReloadFailed:
      return "reload_failed";
    case ErrorCode::kForbidden:
      return "forbidden";
  }
  return "unknown";
}

void append_bytes(std::vector<std::byte>& bytes, const void* data, std::size_t size) {
  const std::size_t at = bytes.size();
  bytes.resize(at + size);
  if (size) std::memcpy(bytes.data() + at, data, size);
}

std::vector<std::byte> FrameBuilder::take() {
  const std::uint64_t payload_bytes = bytes_.size() - sizeof(FrameHeader);
  std::memcpy(bytes_.data() + offsetof(FrameHeader, payload_bytes), &payload_bytes, sizeof payload_bytes);
  return std::move(bytes_);
}

void append_record(std::vector<std::byte>& records, std::uint16_t tag, std::uint16_t flags,
                   std::span<const std::byte> bytes) {
  append(records, RecordHeader{tag, flags, static_cast<std::uint32_t>(bytes.size())});
  append_bytes(records, bytes.data(), bytes.size());
  records.resize(align(records.size(), kRecordAlignment));
}

FrameHeader with_records(FrameHeader header, std::uint64_t records_bytes) {
  if (records_bytes == 0) return header;
  header.version = kRecordsVersion;
  header.records_bytes = records_bytes;
  header.payload_bytes += records_bytes;
  return header;
}

RecordView take_record(const char* what, std::span<const std::byte>& records, std::uint16_t& last) {
  const auto header = head<RecordHeader>(records, (what + std::string(": a record")).c_str());
  const std::string name = std::string(what) + ": record " + str(header.tag);
  if (header.flags & ~kRecordRequired) bad_frame(name + " has unknown flags");
  if (header.tag <= last) bad_frame(name + " comes after record " + str(last) + ": tags must rise, from 1 on");
  last = header.tag;
  const std::uint64_t whole = align(sizeof header + std::uint64_t{header.bytes}, kRecordAlignment);
  if (whole > records.size()) bad_frame(name + " goes past the end of the frame");
  const RecordView record{header.tag, (header.flags & kRecordRequired) != 0,
                          records.subspan(sizeof header, header.bytes)};
  records = records.subspan(static_cast<std::size_t>(whole));
  return record;
}

void pass_over(const char* what, const RecordView& record, PassedOver& passed_over) {
  if (record.required)
    throw WireError(ErrorCode::kNotSupported,
                    std::string(what) + ": record " + str(record.tag) + " is required, and this side does not know it");
  passed_over.push_back(record.tag);
}

std::uint64_t query_payload_bytes(std::uint64_t pairs, std::uint64_t bodies, std::uint64_t configurations) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (pairs > kMost || bodies > kMost || configurations > kMost ||
      query_bytes(pairs, bodies, configurations) > kMaxPayloadBytes)
    throw WireError(ErrorCode::kTooLarge, "query: " + str(pairs) + " pairs and " + str(configurations) +
                                              " configurations of " + str(bodies) + " bodies do not fit into a frame");
  return static_cast<std::uint64_t>(query_bytes(pairs, bodies, configurations));
}

void write_query(std::byte* frame, const FrameHeader& header, const QueryHeader& query, const void* pairs,
                 const void* bodies, const void* configurations, std::span<const std::byte> records) {
  const auto append = [&frame](const void* data, std::size_t size) {
    if (size) std::memcpy(frame, data, size);
    frame += size;
  };
  append(&header, sizeof header);
  append(&query, sizeof query);
  append(pairs, std::size_t{query.pair_count} * sizeof(PairRecord));
  append(bodies, std::size_t{query.body_count} * 4);
  const std::uint32_t zero = 0;
  append(&zero, query.body_count % 2 * 4);
  if (header.type == static_cast<std::uint16_t>(FrameType::kQuery))
    append(configurations, std::size_t{query.configuration_count} * query.body_count * sizeof(ConfigurationRecord));
  append(records.data(), records.size());
}

QueryParts parse_query(std::span<const std::byte> payload, bool with_configurations,
                       std::span<const std::byte> records) {
  QueryParts parts;
  parts.header = head<QueryHeader>(payload, "query");
  const QueryHeader& q = parts.header;
  const std::uint64_t configurations = with_configurations ? q.configuration_count : 0;
  expect_size(
      "query",
      [&] {
        return str(q.pair_count) + " pairs, " + str(q.body_count) + " bodies and " + str(configurations) +
               " configurations";
      },
      query_bytes(q.pair_count, q.body_count, configurations), payload.size());
  check_query_header(q);
  parts.options = read_options(q, records, parts.passed_over);
  Cursor cursor(payload.data() + sizeof(QueryHeader));
  parts.pairs = cursor.take<PairRecord>(q.pair_count);
  parts.bodies = cursor.take<std::uint32_t>(q.body_count);
  cursor.skip(q.body_count % 2 * 4);
  parts.configurations = cursor.take<ConfigurationRecord>(configurations * q.body_count);
  return parts;
}

QueryParts parse_query(const FrameHeader& header, std::span<const std::byte> payload) {
  const PayloadParts parts = split_payload(header, payload);
  return parse_query(parts.body, header.type == static_cast<std::uint16_t>(FrameType::kQuery), parts.records);
}

std::uint64_t columns_bytes(std::uint64_t rows, std::uint32_t fields) {
  const Wide bytes = columns_wide(rows, fields);
  if (bytes > kMaxPayloadBytes - sizeof(ReplyHeader))
    throw WireError(ErrorCode::kTooLarge, "reply: " + str(rows) + " rows need " + str(bytes) +
                                              " bytes, more than a frame may have (" + str(kMaxFrameBytes) + ")");
  return static_cast<std::uint64_t>(bytes);
}

std::uint64_t column_offset(std::uint64_t rows, std::uint32_t fields, Field field) {
  std::uint64_t offset = 0;
  for (int f = 0; f < kFieldCount && (1u << f) != field; ++f)
    if (fields >> f & 1) offset = align(offset + rows * kFieldBytes[f], kColumnAlignment);
  return offset;
}

ReplyHeader parse_reply(std::span<const std::byte> payload, std::span<const std::byte> records) {
  const auto header = head<ReplyHeader>(payload, "reply");
  if (header.fields & ~kAllFields) bad_frame("reply: fields has unknown bits: " + str(header.fields & ~kAllFields));
  expect_size(
      "reply", [&] { return str(header.rows) + " rows"; },
      sizeof(ReplyHeader) + columns_wide(header.rows, header.fields), payload.size());
  // The last column's end is padded too, so that the whole block has one rule.
  if (strnlen(header.backend, sizeof header.backend) == sizeof header.backend)
    bad_frame("reply: the backend's name does not end");
  PassedOver passed_over;
  read_records("reply", records, passed_over, [](const RecordView& record) {
    return record.tag == static_cast<std::uint16_t>(ReplyRecord::kIgnored);
  });
  return header;
}

PosesParts parse_poses(std::span<const std::byte> payload) {
  PosesParts parts;
  parts.header = head<PosesHeader>(payload, "poses");
  expect_size(
      "poses", [&] { return str(parts.header.count) + " poses"; },
      sizeof(PosesHeader) + Wide(parts.header.count) * sizeof(PoseRecord), payload.size());
  expect_zero(parts.header.reserved, "poses");
  parts.poses = Records<PoseRecord>(payload.data() + sizeof(PosesHeader), parts.header.count);
  return parts;
}

AttachRecord parse_attach(std::span<const std::byte> payload) {
  const auto record = head<AttachRecord>(payload, "attach");
  expect_size("attach", its_contents, sizeof(AttachRecord), payload.size());
  if (record.has_pose > 1) bad_frame("attach: has_pose " + std::to_string(record.has_pose) + " is neither 0 nor 1");
  return record;
}

PosesResult parse_poses_done(std::span<const std::byte> payload) {
  const auto result = head<PosesResult>(payload, "poses done");
  expect_size("poses done", its_contents, sizeof(PosesResult), payload.size());
  return result;
}

SceneParts parse_scene(std::span<const std::byte> payload) {
  SceneParts parts;
  parts.header = head<SceneHeader>(payload, "scene");
  const SceneHeader& h = parts.header;
  expect_size(
      "scene",
      [&] {
        return str(h.body_count) + " bodies, " + str(h.group_count) + " groups and " + str(h.member_count) + " members";
      },
      sizeof(SceneHeader) + Wide(h.body_count) * sizeof(BodyRecord) + Wide(h.group_count) * sizeof(GroupRecord) +
          Wide(h.member_count) * 4,
      payload.size());
  Cursor cursor(payload.data() + sizeof(SceneHeader));
  parts.bodies = cursor.take<BodyRecord>(h.body_count);
  parts.groups = cursor.take<GroupRecord>(h.group_count);
  parts.members = cursor.take<std::uint32_t>(h.member_count);
  if (strnlen(h.backend, sizeof h.backend) == sizeof h.backend) bad_frame("scene: the backend's name does not end");
  for (std::uint64_t i = 0; i < parts.bodies.size(); ++i) expect_name(parts.bodies[i].name, "scene: bodies", i);
  for (std::uint64_t i = 0; i < parts.groups.size(); ++i) {
    const GroupRecord group = parts.groups[i];
    expect_name(group.name, "scene: groups", i);
    if (std::uint64_t{group.first_member} + group.member_count > h.member_count)
      bad_frame("scene: groups[" + str(i) + "]: its members go past the end of the list");
  }
  for (std::uint64_t i = 0; i < parts.members.size(); ++i)
    if (parts.members[i] >= h.body_count) bad_frame("scene: members[" + str(i) + "] is no body");
  return parts;
}

PairTableParts parse_pair_table(std::span<const std::byte> payload) {
  PairTableParts parts;
  parts.header = head<PairsHeader>(payload, "pair table");
  expect_size(
      "pair table", [&] { return str(parts.header.count) + " pairs"; },
      sizeof(PairsHeader) + Wide(parts.header.count) * sizeof(PairRecord), payload.size());
  parts.pairs = Records<PairRecord>(payload.data() + sizeof(PairsHeader), parts.header.count);
  return parts;
}

StatesParts parse_states(std::span<const std::byte> payload) {
  StatesParts parts;
  parts.header = head<StatesHeader>(payload, "body states");
  expect_size(
      "body states", [&] { return str(parts.header.count) + " bodies"; },
      sizeof(StatesHeader) + Wide(parts.header.count) * sizeof(BodyStateRecord), payload.size());
  parts.states = Records<BodyStateRecord>(payload.data() + sizeof(StatesHeader), parts.header.count);
  return parts;
}

NewBodyParts parse_new_body(std::span<const std::byte> payload) {
  NewBodyParts parts;
  parts.record = head<NewBodyRecord>(payload, "new body");
  const NewBodyRecord& r = parts.record;
  expect_size(
      "new body", [&] { return str(r.vertex_count) + " vertices"; },
      sizeof(NewBodyRecord) + Wide(r.vertex_count) * sizeof(VertexRecord), payload.size());
  expect_name(r.name, "new body", 0);
  if (r.shape > static_cast<std::uint8_t>(BodyShape::kCylinder))
    bad_query("new body: shape " + str(r.shape) + " is none of 0 to 4");
  if (r.shape != static_cast<std::uint8_t>(BodyShape::kHull) && r.vertex_count)
    bad_query("new body: vertices are for a hull alone");
  if (r.is_static > 1 || r.has_pose > 1) bad_query("new body: is_static and has_pose are 0 or 1");
  expect_zero(r.reserved, "new body");
  parts.vertices = Records<VertexRecord>(payload.data() + sizeof(NewBodyRecord), r.vertex_count);
  return parts;
}

RemoveBodyRecord parse_remove_body(std::span<const std::byte> payload) {
  const auto record = head<RemoveBodyRecord>(payload, "remove body");
  expect_size("remove body", its_contents, sizeof(RemoveBodyRecord), payload.size());
  expect_name(record.name, "remove body", 0);
  return record;
}

SceneChange parse_scene_changed(std::span<const std::byte> payload) {
  const auto change = head<SceneChange>(payload, "scene changed");
  expect_size("scene changed", its_contents, sizeof(SceneChange), payload.size());
  expect_zero(change.reserved, "scene changed");
  return change;
}

Records<CounterRecord> parse_stats(std::span<const std::byte> payload) {
  if (payload.size() % sizeof(CounterRecord))
    bad_frame("stats: " + str(payload.size()) + " bytes are no whole number of records of " +
              str(sizeof(CounterRecord)));
  const Records<CounterRecord> counters(payload.data(), payload.size() / sizeof(CounterRecord));
  for (std::uint64_t i = 0; i < counters.size(); ++i) expect_name(counters[i].name, "stats: counters", i);
  return counters;
}

ErrorParts parse_error(std::span<const std::byte> payload) {
  ErrorParts parts;
  parts.header = head<ErrorHeader>(payload, "error");
  expect_size(
      "error", [&] { return "a text of " + str(parts.header.text_bytes) + " bytes and its header"; },
      Wide(sizeof(ErrorHeader)) + parts.header.text_bytes, payload.size());
  const auto text = payload.subspan(sizeof(ErrorHeader));
  parts.text.assign(reinterpret_cast<const char*>(text.data()), text.size());
  return parts;
}

void parse_empty(std::span<const std::byte> payload, std::uint16_t type) {
  if (!payload.empty())
    bad_frame("a " + type_name(type) + " frame has no payload, got " + str(payload.size()) + " bytes");
}

}  // namespace clearance::wire
