// Writes and parses kQuery, kPairs, kCertify and kOpenPlan.
#include "wire/checks.h"

namespace clearance::wire {
namespace {

Wide query_bytes(std::uint64_t pairs, std::uint64_t bodies, std::uint64_t configurations) {
  return Wide(sizeof(QueryHeader)) + Wide(pairs) * sizeof(PairRecord) + (Wide(bodies) * 4 + 7) / 8 * 8 +
         Wide(configurations) * bodies * sizeof(ConfigurationRecord);
}

/// Describes the error of an option's value (a word as its number).
template <class T>
[[noreturn]] void reject_option(const QueryOption& option, T value) {
  const std::string name = std::string("query: ") + option.name;
  const Legal& legal = option.legal;
  if (legal.kind == Legal::Kind::kWord) bad_query(name + " " + str(value) + " is not one of 0 to " + str(legal.most));
  if (legal.kind == Legal::Kind::kBits)
    bad_query(name + " has unknown bits: " + str(static_cast<std::uint64_t>(value) & ~legal.mask));
  // Without a text, both ends are integers.
  const std::string range =
      legal.text ? legal.text : str(std::int64_t(legal.least)) + " to " + str(std::int64_t(legal.most));
  bad_query(name + " must be " + range + ", got " + str(value));
}
template <class T>
void check_option(const QueryOption& option, T value) {
  const Legal& legal = option.legal;
  bool is_legal = true;
  if (legal.kind == Legal::Kind::kWord) is_legal = double(value) <= legal.most;
  if (legal.kind == Legal::Kind::kBits) is_legal = (static_cast<std::uint64_t>(value) & ~legal.mask) == 0;
  if (legal.kind == Legal::Kind::kRange) is_legal = double(value) >= legal.least && double(value) <= legal.most;
  if (!is_legal) reject_option(option, value);
}

void check_query_header(const QueryHeader& q) {
  if (q.all_pairs > 1) bad_query("query: all_pairs " + str(q.all_pairs) + " is not one of 0 to 1");
  if (q.all_pairs && q.pair_count) bad_query("query: all_pairs is set, yet " + str(q.pair_count) + " pairs are named");
  expect_zero(q.padding, "query");
  expect_zero(q.padding2, "query");
  expect_zero(q.reserved, "query");
}

/// Reads a record as an array of T.
template <class T>
Records<T> read_array(const RecordView& record, const char* name) {
  if (record.bytes.size() % sizeof(T))
    bad_frame("query: " + std::string(name) + " (record " + str(record.tag) + ") has " + str(record.bytes.size()) +
              " bytes, expected a multiple of " + str(sizeof(T)));
  return Records<T>(record.bytes.data(), record.bytes.size() / sizeof(T));
}

bool take_array(const RecordView& record, QueryParts& parts) {
  switch (static_cast<QueryRecord>(record.tag)) {
    case QueryRecord::kMargins:
      parts.margins = read_array<MarginEntry>(record, "margins");
      return true;
    case QueryRecord::kPairMargins:
      parts.pair_margins = read_array<double>(record, "pair_margins");
      return true;
    case QueryRecord::kJoints:
      parts.joints = read_array<std::uint32_t>(record, "joints");
      return true;
    case QueryRecord::kPositions:
      parts.positions = read_array<double>(record, "positions");
      return true;
    case QueryRecord::kWeights:
      parts.weights = read_array<double>(record, "weights");
      return true;
    case QueryRecord::kGrowths:
      parts.growths = read_array<double>(record, "growths");
      return true;
    case QueryRecord::kVelocities:
      parts.velocities = read_array<double>(record, "velocities");
      return true;
    case QueryRecord::kTwists:
      parts.twists = read_array<double>(record, "twists");
      return true;
    case QueryRecord::kSpeedErrors:
      parts.speed_errors = read_array<double>(record, "speed_errors");
      return true;
    case QueryRecord::kRows:
      parts.rows = read_array<std::uint64_t>(record, "rows");
      parts.has_rows = true;
      return true;
  }
  return false;
}

/// Checks the number of velocities or twists, of which there may be none.
void check_speeds(const Records<double>& speeds, const char* name, QueryRecord tag, Wide expected) {
  if (speeds.size() && expected != speeds.size())
    bad_query("query: " + std::string(name) + " (record " + str(static_cast<std::uint16_t>(tag)) + ") has " +
              str(speeds.size()) + " numbers, expected " + str(expected));
}

/// Checks the moved bodies and joints, and the numbers of positions and growths.
void check_joints(const QueryParts& parts, bool with_configurations) {
  const std::uint64_t count = parts.header.configuration_count, joints = parts.joints.size();
  if (count && !parts.header.body_count && !joints)
    bad_query("query: " + str(count) + " configurations of no bodies and no joints");
  if (!with_configurations && parts.positions.size()) bad_query("query: positions are not for kPairs and kOpenPlan");
  if (!with_configurations && parts.growths.size()) bad_query("query: growths are not for kPairs and kOpenPlan");
  if (!with_configurations && parts.velocities.size() + parts.twists.size() > 0)
    bad_query("query: velocities and twists are not for kPairs and kOpenPlan");
  if (!with_configurations) return;
  check_speeds(parts.velocities, "velocities", QueryRecord::kVelocities, Wide(count) * joints);
  check_speeds(parts.twists, "twists", QueryRecord::kTwists, Wide(count) * parts.header.body_count * 6);
  if (joints && !count) bad_query("query: " + str(joints) + " joints, and no configurations of them");
  if (Wide(count) * joints != parts.positions.size())
    bad_query("query: positions (record " + str(static_cast<std::uint16_t>(QueryRecord::kPositions)) + ") has " +
              str(parts.positions.size()) + " numbers, expected " + str(count) + " configurations of " + str(joints) +
              " joints");
  const std::uint64_t bodies = parts.header.body_count;
  if (parts.growths.size() && Wide(count) * bodies != parts.growths.size())
    bad_query("query: growths (record " + str(static_cast<std::uint16_t>(QueryRecord::kGrowths)) + ") has " +
              str(parts.growths.size()) + " numbers, expected " + str(count) + " configurations of " + str(bodies) +
              " bodies");
}

QueryOptions read_options(std::span<const std::byte> records, QueryParts& parts) {
  const QueryHeader& header = parts.header;
  QueryOptions options;
  for_each_query_option([&](const QueryOption& option, auto member) {
    if constexpr (requires { member(header); }) {
      check_option(option, member(header));
      member(options) = static_cast<std::remove_reference_t<decltype(member(options))>>(member(header));
    }
  });
  parts.epoch = read_records("query", records, parts.passed_over, [&](const RecordView& record) {
    bool known = take_array(record, parts);
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
  return options;
}

}  // namespace

std::uint64_t query_payload_bytes(std::uint64_t pairs, std::uint64_t bodies, std::uint64_t configurations) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (pairs > kMost || bodies > kMost || configurations > kMost ||
      query_bytes(pairs, bodies, configurations) > kMaxPayloadBytes)
    throw WireError(ErrorCode::kTooLarge, "query: " + str(pairs) + " pairs and " + str(configurations) +
                                              " configurations of " + str(bodies) + " bodies do not fit into a frame");
  return static_cast<std::uint64_t>(query_bytes(pairs, bodies, configurations));
}

void insert_inputs(std::vector<std::byte>& records, const QueryInputs& inputs) {
  for_each_input(inputs, [&records](QueryRecord tag, std::span<const std::byte> bytes) {
    insert_record(records, static_cast<std::uint16_t>(tag), kRecordRequired, bytes);
  });
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
  if (has_configurations(static_cast<FrameType>(header.type)))
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
  parts.options = read_options(records, parts);
  check_joints(parts, with_configurations);
  Cursor cursor(payload.data() + sizeof(QueryHeader));
  parts.pairs = cursor.take<PairRecord>(q.pair_count);
  parts.bodies = cursor.take<std::uint32_t>(q.body_count);
  cursor.skip(q.body_count % 2 * 4);
  parts.configurations = cursor.take<ConfigurationRecord>(configurations * q.body_count);
  return parts;
}

QueryParts parse_query(const FrameHeader& header, std::span<const std::byte> payload) {
  const PayloadParts parts = split_payload(header, payload);
  QueryParts query = parse_query(parts.body, has_configurations(static_cast<FrameType>(header.type)), parts.records);
  if (query.has_rows && header.type != static_cast<std::uint16_t>(FrameType::kCertify))
    bad_query("query: rows (record " + str(static_cast<std::uint16_t>(QueryRecord::kRows)) + ") are for kCertify");
  return query;
}

}  // namespace clearance::wire
