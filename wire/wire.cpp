#include "wire.h"

#include <cmath>
#include <limits>

namespace clearance::wire {
namespace {

constexpr std::uint64_t kMaxPayloadBytes = kMaxFrameBytes - sizeof(FrameHeader);
constexpr std::uint32_t kAllFields = (1u << kFieldCount) - 1;

// Sizes are summed in 128 bits: three counts of 32 bits and a record size cannot overflow it.
using Wide = unsigned __int128;

constexpr std::uint64_t align(std::uint64_t bytes, std::uint64_t to) {
  return (bytes + to - 1) / to * to;
}

std::string str(std::uint64_t value) {
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

void expect_at_most(const char* what, unsigned value, unsigned most) {
  if (value > most)
    bad_query(std::string("query: ") + what + " " + str(std::uint64_t{value}) + " is none of 0 to " +
              str(std::uint64_t{most}));
}

void check_query_values(const QueryHeader& q) {
  if (std::isnan(q.max_distance) || q.max_distance < 0)
    bad_query("query: max_distance must be a number of metres >= 0, got " + str(q.max_distance));
  if (!std::isfinite(q.abs_tol) || q.abs_tol < 0)
    bad_query("query: abs_tol must be a finite number of metres >= 0, got " + str(q.abs_tol));
  if (!std::isfinite(q.rel_tol)) bad_query("query: rel_tol must be finite, got " + str(q.rel_tol));
  expect_at_most("all_pairs", q.all_pairs, 1);
  expect_at_most("precision", q.precision, static_cast<unsigned>(Precision::kF32));
  expect_at_most("signed_distance", q.signed_distance, 1);
  expect_at_most("reduce", q.reduce, static_cast<unsigned>(Reduce::kMin));
  expect_at_most("format", q.format, static_cast<unsigned>(Format::kCompact));
  expect_at_most("warm", q.warm, 1);
  if (q.fields & ~kAllFields)
    bad_query("query: fields has unknown bits: " + str(std::uint64_t{q.fields & ~kAllFields}));
  if (q.max_pose_age_ns < 0) bad_query("query: max_pose_age_ns must be >= 0, got " + std::to_string(q.max_pose_age_ns));
  if (q.all_pairs && q.pair_count)
    bad_query("query: all_pairs is set, yet " + str(std::uint64_t{q.pair_count}) + " pairs are named");
  if (q.configuration_count && !q.body_count)
    bad_query("query: " + str(std::uint64_t{q.configuration_count}) + " configurations of no bodies");
  if (q.min_pose_stamp_ns < 0)
    bad_query("query: min_pose_stamp_ns must be >= 0, got " + std::to_string(q.min_pose_stamp_ns));
  if (q.pose_wait_ns < 0 || q.pose_wait_ns > kMaxPoseWaitNs)
    bad_query("query: pose_wait_ns must be 0 to " + std::to_string(kMaxPoseWaitNs) + ", got " +
              std::to_string(q.pose_wait_ns));
  if (q.pose_wait_ns && !q.min_pose_stamp_ns) bad_query("query: pose_wait_ns is for a query with min_pose_stamp_ns");
  expect_zero(q.padding, "query");
  expect_zero(q.padding2, "query");
  expect_zero(q.reserved, "query");
}

}  // namespace

void check_header(const FrameHeader& h, std::uint64_t payload_bytes) {
  if (h.magic != kMagic) {
    char text[80];
    std::snprintf(text, sizeof text, "frame: magic is 0x%08x, expected 0x%08x", h.magic, kMagic);
    bad_frame(text);
  }
  if (h.version != kVersion)
    throw WireError(ErrorCode::kWrongVersion, "frame: version " + std::to_string(h.version) +
                                                  ", this side speaks version " + std::to_string(kVersion));
  if (h.payload_bytes > kMaxPayloadBytes)
    bad_frame("frame: a payload of " + str(h.payload_bytes) + " bytes is more than the " + str(kMaxPayloadBytes) +
              " allowed");
  if (h.payload_bytes != payload_bytes)
    bad_frame("frame: the header speaks of a payload of " + str(h.payload_bytes) + " bytes, " + str(payload_bytes) +
              " came");
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

std::uint64_t query_payload_bytes(std::uint64_t pairs, std::uint64_t bodies, std::uint64_t configurations) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (pairs > kMost || bodies > kMost || configurations > kMost ||
      query_bytes(pairs, bodies, configurations) > kMaxPayloadBytes)
    throw WireError(ErrorCode::kTooLarge, "query: " + str(pairs) + " pairs and " + str(configurations) +
                                              " configurations of " + str(bodies) + " bodies do not fit into a frame");
  return static_cast<std::uint64_t>(query_bytes(pairs, bodies, configurations));
}

void write_query(std::byte* frame, const FrameHeader& header, const QueryHeader& query, const void* pairs,
                 const void* bodies, const void* configurations) {
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
}

QueryParts parse_query(std::span<const std::byte> payload, bool with_configurations) {
  QueryParts parts;
  parts.header = head<QueryHeader>(payload, "query");
  const QueryHeader& q = parts.header;
  const std::uint64_t configurations = with_configurations ? q.configuration_count : 0;
  expect_size(
      "query",
      [&] {
        return str(std::uint64_t{q.pair_count}) + " pairs, " + str(std::uint64_t{q.body_count}) + " bodies and " +
               str(configurations) + " configurations";
      },
      query_bytes(q.pair_count, q.body_count, configurations), payload.size());
  check_query_values(q);
  Cursor cursor(payload.data() + sizeof(QueryHeader));
  parts.pairs = cursor.take<PairRecord>(q.pair_count);
  parts.bodies = cursor.take<std::uint32_t>(q.body_count);
  cursor.skip(q.body_count % 2 * 4);
  parts.configurations = cursor.take<ConfigurationRecord>(configurations * q.body_count);
  return parts;
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

ReplyHeader parse_reply(std::span<const std::byte> payload) {
  const auto header = head<ReplyHeader>(payload, "reply");
  if (header.fields & ~kAllFields)
    bad_frame("reply: fields has unknown bits: " + str(std::uint64_t{header.fields & ~kAllFields}));
  expect_size(
      "reply", [&] { return str(header.rows) + " rows"; },
      sizeof(ReplyHeader) + columns_wide(header.rows, header.fields), payload.size());
  // The last column's end is padded too, so that the whole block has one rule.
  if (strnlen(header.backend, sizeof header.backend) == sizeof header.backend)
    bad_frame("reply: the backend's name does not end");
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
        return str(std::uint64_t{h.body_count}) + " bodies, " + str(std::uint64_t{h.group_count}) + " groups and " +
               str(std::uint64_t{h.member_count}) + " members";
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
    bad_query("new body: shape " + str(std::uint64_t{r.shape}) + " is none of 0 to 4");
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
      "error", [&] { return "a text of " + str(std::uint64_t{parts.header.text_bytes}) + " bytes and its header"; },
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
