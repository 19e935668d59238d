#include "server/lcm/lcm_translate.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "wire/lcm_bus.h"

namespace clearance {
namespace {

/// What a message says besides its rows, generously: ids, counts, the backend's name.
constexpr std::size_t kMessageOverhead = 512;
constexpr std::size_t kRoomForRows = kLcmMessageBytes - kMessageOverhead;

std::uint64_t row_bytes(std::uint32_t fields) {
  std::uint64_t bytes = 0;
  for (int i = 0; i < kFieldCount; ++i) bytes += (fields >> i & 1) != 0 ? kFieldBytes[i] : 0;
  return bytes;
}

/// Rows [first, first + count) of the columns of one reply.
class Rows {
 public:
  Rows(const std::byte* columns, const wire::ReplyHeader& header, std::uint64_t first, std::uint64_t count)
      : columns_(columns), header_(header), first_(first), count_(count) {}

  template <class T>
  std::int32_t scalars(Field field, std::vector<T>& out) const {
    return read(field, out, 1, [](auto& dst, const T* src) { dst = *src; });
  }
  template <class T>
  std::int32_t vectors(Field field, int width, std::vector<std::vector<T>>& out) const {
    return read(field, out, width, [width](auto& dst, const T* src) { dst.assign(src, src + width); });
  }

 private:
  template <class Out, class Assign>
  std::int32_t read(Field field, std::vector<Out>& out, int width, Assign assign) const {
    if ((header_.fields & field) == 0) return 0;
    using T = std::remove_cvref_t<decltype(value_type(static_cast<Out*>(nullptr)))>;
    const auto* begin =
        reinterpret_cast<const T*>(columns_ + wire::column_offset(header_.rows, header_.fields, field)) +
        first_ * static_cast<std::uint64_t>(width);
    out.resize(count_);
    for (std::uint64_t i = 0; i < count_; ++i) assign(out[i], begin + i * static_cast<std::uint64_t>(width));
    return static_cast<std::int32_t>(count_);
  }
  template <class T>
  static T value_type(T*);
  template <class T>
  static T value_type(std::vector<T>*);

  const std::byte* columns_;
  const wire::ReplyHeader& header_;
  std::uint64_t first_, count_;
};

wire::ReplyHeader reply_of(std::span<const std::byte> payload, const std::byte*& columns) {
  const wire::ReplyHeader header = wire::parse_reply(payload);
  columns = payload.data() + sizeof(wire::ReplyHeader);
  return header;
}

/// The payload of a frame of our own loop; an error frame is thrown as what it says.
std::span<const std::byte> payload_of(std::span<const std::byte> frame, wire::FrameType wanted) {
  wire::FrameHeader header;
  const auto payload = wire::split_payload(header, wire::split_frame(frame, header)).body;
  if (header.type == static_cast<std::uint16_t>(wire::FrameType::kError)) {
    const wire::ErrorParts error = wire::parse_error(payload);
    throw wire::WireError(static_cast<wire::ErrorCode>(error.header.code), error.text);
  }
  if (header.type != static_cast<std::uint16_t>(wanted)) {
    throw wire::WireError(wire::ErrorCode::kUnknownType, "unexpected frame " + wire::type_name(header.type));
  }
  return payload;
}

/// Takes over what a message says of the options; 0 is the default of each.
template <class Message>
void read_options(const Message& message, QueryOptions& options) {
  for_each_query_option([&](const QueryOption&, auto member) {
    if constexpr (requires { member(message); })
      if (const auto value = member(message); value != 0)
        member(options) = static_cast<std::remove_reference_t<decltype(member(options))>>(value);
  });
}

/// \param options that the query does not have. \param rows of joints; 0: the query's own configurations
std::vector<std::byte> frame_of(const clearance_lcm::query_t& query, QueryOptions options,
                                std::span<const std::uint32_t> joints = {}, std::span<const double> positions = {},
                                std::int32_t rows = 0) {
  read_options(query, options);
  if (query.wait_for_one) options.wait_for = static_cast<std::uint32_t>(query.wait_for);  // 0 is a body, too
  for (const auto& [field, name] : {std::pair{kFieldPairLower, "pair_lower"},
                                    {kFieldGradientJoints, "gradient_joints"},
                                    {kFieldTime, "time"},
                                    {kFieldFirstContact, "first_contact"},
                                    {kFieldSteps, "steps"},
                                    {kFieldBounds, "bounds"},
                                    {kFieldFreeScale, "free_scale"}})
    if (options.fields & field)
      throw wire::WireError(wire::ErrorCode::kBadQuery, std::string("query: fields: reply_t has no column ") + name);
  // The pair table is not served over LCM, so rows say their pair unless told otherwise.
  if (query.fields == 0) options.fields |= kFieldPair;
  wire::QueryHeader header;
  copy_options(options, header);
  header.all_pairs = query.pair_count == 0;
  header.pair_count = static_cast<std::uint32_t>(query.pair_count);
  header.body_count = static_cast<std::uint32_t>(query.body_count);
  header.configuration_count = static_cast<std::uint32_t>(rows ? rows : query.configuration_count);

  std::vector<std::uint32_t> pairs;
  pairs.reserve(query.pairs.size() * 2);
  for (const auto& pair : query.pairs) {
    pairs.push_back(static_cast<std::uint32_t>(pair[0]));
    pairs.push_back(static_cast<std::uint32_t>(pair[1]));
  }
  std::vector<double> poses;
  poses.reserve(query.configurations.size() * query.bodies.size() * 7);
  for (const auto& configuration : query.configurations) {
    for (const auto& pose : configuration) poses.insert(poses.end(), pose.begin(), pose.end());
  }

  const std::uint64_t payload =
      wire::query_payload_bytes(header.pair_count, header.body_count, header.configuration_count);
  std::vector<std::byte> records = wire::option_records(options);
  wire::insert_joint_records(records, joints, positions);
  std::vector<std::byte> frame(sizeof(wire::FrameHeader) + payload + records.size());
  const wire::FrameHeader frame_header =
      wire::make_header(wire::FrameType::kQuery, static_cast<std::uint64_t>(query.request_id), payload,
                        static_cast<std::uint64_t>(query.scene_revision), static_cast<std::uint64_t>(query.client_id));
  wire::write_query(frame.data(), wire::with_records(frame_header, records.size()), header, pairs.data(),
                    query.bodies.data(), poses.data(), records);
  return frame;
}

}  // namespace

std::vector<std::byte> query_frame_of(const clearance_lcm::query_t& query) {
  return frame_of(query, {});
}

std::vector<std::byte> query_frame_of(const clearance_lcm::joint_query_t& query,
                                      std::span<const std::uint32_t> joints) {
  std::vector<double> positions;
  for (const auto& row : query.positions) positions.insert(positions.end(), row.begin(), row.end());
  QueryOptions options;
  read_options(query, options);
  return frame_of(query.query, options, joints, positions, query.row_count);
}

std::vector<std::byte> nearest_query_frame() {
  clearance_lcm::query_t query{};
  query.reduce = static_cast<std::int8_t>(Reduce::kNearest);
  query.fields = kDefaultFields | kFieldFlags | kFieldPoints | kFieldPair;
  return query_frame_of(query);
}

ReplyParts::ReplyParts(FrameBytes frame, std::int64_t server_id, std::int64_t sequence, std::int64_t client_id)
    : frame_(std::move(frame)) {
  common_.server_id = server_id;
  common_.sequence = sequence;
  common_.client_id = client_id;
  wire::FrameHeader frame_header{};
  try {
    const auto whole = wire::split_frame(frame_.span(), frame_header);
    const auto payload = wire::split_payload(frame_header, whole).body;  // no message has a place for records
    common_.request_id = static_cast<std::int64_t>(frame_header.request_id);
    common_.scene_revision = static_cast<std::int64_t>(frame_header.scene_revision);
    if (frame_header.type == static_cast<std::uint16_t>(wire::FrameType::kError)) {
      const wire::ErrorParts error = wire::parse_error(payload);
      common_.error_code = error.header.code;
      common_.error_text = error.text.substr(0, kRoomForRows);
    } else if (frame_header.type == static_cast<std::uint16_t>(wire::FrameType::kReply)) {
      header_ = reply_of(payload, columns_);
    } else {
      throw wire::WireError(wire::ErrorCode::kInternal, "unexpected frame " + wire::type_name(frame_header.type));
    }
  } catch (const wire::WireError& error) {
    columns_ = nullptr;
    common_.error_code = static_cast<std::int32_t>(wire::ErrorCode::kInternal);
    common_.error_text = error.what();
  }
  if (columns_ != nullptr) {
    const std::uint64_t bytes = std::max<std::uint64_t>(1, row_bytes(header_.fields));
    rows_per_part_ = std::max<std::uint64_t>(1, kRoomForRows / bytes);
    parts_ = std::max<std::uint64_t>(1, (header_.rows + rows_per_part_ - 1) / rows_per_part_);
    common_.row_count = static_cast<std::int64_t>(header_.rows);
    common_.total = static_cast<std::int64_t>(header_.total);
    common_.configurations = static_cast<std::int64_t>(header_.configurations);
    common_.pairs = static_cast<std::int64_t>(header_.pairs);
    common_.fields = static_cast<std::int32_t>(header_.fields);
    common_.reduce = static_cast<std::int8_t>(header_.reduce);
    common_.format = static_cast<std::int8_t>(header_.format);
    common_.scene_revision = static_cast<std::int64_t>(header_.scene_revision);
    common_.snapshot_revision = static_cast<std::int64_t>(header_.snapshot_revision);
    common_.snapshot_stamp_ns = header_.snapshot_stamp_ns;
    common_.oldest_receipt_ns = header_.oldest_receipt_ns;
    common_.pairs_evaluated = static_cast<std::int64_t>(header_.pairs_evaluated);
    common_.engine_ns = static_cast<std::int64_t>(header_.engine_ns);
    common_.server_ns = static_cast<std::int64_t>(header_.server_ns);
    common_.backend = wire::name_of(header_.backend);
  }
  common_.parts = static_cast<std::int32_t>(parts_);
}

clearance_lcm::reply_t ReplyParts::operator[](std::uint64_t part) const {
  clearance_lcm::reply_t message = common_;
  message.part = static_cast<std::int32_t>(part);
  if (columns_ == nullptr) return message;
  const std::uint64_t first = part * rows_per_part_;
  message.first_row = static_cast<std::int64_t>(first);
  const Rows rows(columns_, header_, first, std::min(rows_per_part_, header_.rows - first));
  message.distance_count = rows.scalars(kFieldDistance, message.distance);
  message.lower_count = rows.scalars(kFieldLower, message.lower);
  message.upper_count = rows.scalars(kFieldUpper, message.upper);
  message.status_count = rows.scalars(kFieldStatus, message.status);
  message.flags_count = rows.scalars(kFieldFlags, message.flags);
  message.point_a_count = rows.vectors(kFieldPointA, 3, message.point_a);
  message.point_b_count = rows.vectors(kFieldPointB, 3, message.point_b);
  message.normal_count = rows.vectors(kFieldNormal, 3, message.normal);
  message.pieces_count = rows.vectors(kFieldPieces, 2, message.pieces);
  message.gradient_count = rows.vectors(kFieldGradient, 12, message.gradient);
  message.pair_count = rows.vectors(kFieldPair, 2, message.pair);
  message.configuration_count = rows.scalars(kFieldConfiguration, message.configuration);
  message.compact_count = rows.vectors(kFieldCompact, 8, message.compact);
  return message;
}

std::vector<clearance_lcm::scene_t> scene_messages(std::span<const std::byte> scene_frame, std::int64_t server_id) {
  const wire::SceneParts scene = wire::parse_scene(payload_of(scene_frame, wire::FrameType::kScene));
  std::vector<clearance_lcm::scene_t> messages;
  std::size_t room = 0;
  const auto make_room = [&](std::size_t bytes) -> clearance_lcm::scene_t& {
    if (messages.empty() || room < bytes) {
      clearance_lcm::scene_t& message = messages.emplace_back();
      message = {};
      message.server_id = server_id;
      message.revision = static_cast<std::int64_t>(scene.header.scene_revision);
      message.part = static_cast<std::int32_t>(messages.size() - 1);
      message.body_total = static_cast<std::int32_t>(scene.header.body_count);
      message.group_total = static_cast<std::int32_t>(scene.header.group_count);
      message.pair_total = static_cast<std::int64_t>(scene.header.pair_count);
      message.backend = wire::name_of(scene.header.backend);
      room = kRoomForRows;
    }
    room -= bytes;
    return messages.back();
  };
  make_room(0);
  for (std::uint64_t i = 0; i < scene.bodies.size(); ++i) {
    const wire::BodyRecord body = scene.bodies[i];
    const std::string name = wire::name_of(body.name);
    clearance_lcm::scene_t& message = make_room(4 + (5 + name.size()) + 4 + 1 + 8 + 8);
    ++message.body_count;
    message.ids.push_back(static_cast<std::int32_t>(i));
    message.names.push_back(name);
    message.parents.push_back(static_cast<std::int32_t>(body.parent));
    message.is_static.push_back(body.is_static != 0);
    message.extent.push_back(body.extent);
    message.model_error.push_back(body.model_error);
  }
  for (std::uint64_t i = 0; i < scene.groups.size(); ++i) {
    const wire::GroupRecord group = scene.groups[i];
    const std::string name = wire::name_of(group.name);
    clearance_lcm::scene_t& message = make_room(4 + 5 + name.size());
    ++message.group_count;
    message.groups.push_back(static_cast<std::int32_t>(i));
    message.group_names.push_back(name);
    for (std::uint32_t k = 0; k < group.member_count; ++k) {
      clearance_lcm::scene_t& holder = make_room(8);
      ++holder.member_count;
      holder.members.push_back(
          {static_cast<std::int32_t>(i), static_cast<std::int32_t>(scene.members[group.first_member + k])});
    }
  }
  for (auto& message : messages) message.parts = static_cast<std::int32_t>(messages.size());
  return messages;
}

std::vector<clearance_lcm::distances_t> distances_messages(std::span<const std::byte> reply_frame,
                                                           std::int64_t server_id, std::int64_t sequence) {
  const std::byte* columns = nullptr;
  const wire::ReplyHeader header = reply_of(payload_of(reply_frame, wire::FrameType::kReply), columns);
  const std::uint64_t rows_per_part = kRoomForRows / std::max<std::uint64_t>(1, row_bytes(header.fields));
  const std::uint64_t parts = std::max<std::uint64_t>(1, (header.rows + rows_per_part - 1) / rows_per_part);
  std::vector<clearance_lcm::distances_t> messages(parts);
  for (std::uint64_t part = 0; part < parts; ++part) {
    clearance_lcm::distances_t& message = messages[part];
    message.server_id = server_id;
    message.sequence = sequence;
    message.part = static_cast<std::int32_t>(part);
    message.parts = static_cast<std::int32_t>(parts);
    message.scene_revision = static_cast<std::int64_t>(header.scene_revision);
    message.snapshot_revision = static_cast<std::int64_t>(header.snapshot_revision);
    message.snapshot_stamp_ns = header.snapshot_stamp_ns;
    message.server_ns = static_cast<std::int64_t>(header.server_ns);
    const std::uint64_t first = part * rows_per_part;
    const Rows rows(columns, header, first, std::min(rows_per_part, header.rows - first));
    message.count = rows.vectors(kFieldPair, 2, message.pairs);
    rows.scalars(kFieldDistance, message.distance);
    rows.scalars(kFieldLower, message.lower);
    rows.scalars(kFieldUpper, message.upper);
    rows.scalars(kFieldStatus, message.status);
    rows.scalars(kFieldFlags, message.flags);
    rows.vectors(kFieldPointA, 3, message.point_a);
    rows.vectors(kFieldPointB, 3, message.point_b);
  }
  return messages;
}

std::vector<clearance_lcm::states_t> states_messages(std::span<const std::byte> states_frame, std::int64_t server_id,
                                                     std::int64_t sequence, std::uint64_t scene_revision) {
  const wire::StatesParts states = wire::parse_states(payload_of(states_frame, wire::FrameType::kBodyStates));
  constexpr std::uint64_t kPerPart = kRoomForRows / (4 + 7 * 8 + 1 + 4 + 8 + 8);
  const std::uint64_t count = states.states.size();
  std::vector<clearance_lcm::states_t> messages(std::max<std::uint64_t>(1, (count + kPerPart - 1) / kPerPart));
  for (std::uint64_t part = 0; part < messages.size(); ++part) {
    clearance_lcm::states_t& message = messages[part];
    message.server_id = server_id;
    message.sequence = sequence;
    message.part = static_cast<std::int32_t>(part);
    message.parts = static_cast<std::int32_t>(messages.size());
    message.scene_revision = static_cast<std::int64_t>(scene_revision);
    message.revision = static_cast<std::int64_t>(states.header.revision);
    message.now_ns = states.header.now_ns;
    for (std::uint64_t i = part * kPerPart; i < std::min(count, (part + 1) * kPerPart); ++i) {
      const wire::BodyStateRecord state = states.states[i];
      ++message.count;
      message.ids.push_back(static_cast<std::int32_t>(i));
      message.poses.emplace_back(std::begin(state.pose), std::end(state.pose));
      message.status.push_back(state.status);
      message.parents.push_back(static_cast<std::int32_t>(state.parent));
      message.stamp_ns.push_back(state.stamp_ns);
      message.receipt_ns.push_back(state.receipt_ns);
    }
  }
  return messages;
}

clearance_lcm::status_t status_message(std::span<const std::byte> stats_frame, std::int64_t server_id) {
  const auto counters = wire::parse_stats(payload_of(stats_frame, wire::FrameType::kStats));
  clearance_lcm::status_t message{};
  message.server_id = server_id;
  std::size_t room = kRoomForRows;
  for (std::uint64_t i = 0; i < counters.size(); ++i) {
    const wire::CounterRecord counter = counters[i];
    const std::string name = wire::name_of(counter.name);
    const std::size_t bytes = 5 + name.size() + 8;
    if (bytes > room) break;
    room -= bytes;
    ++message.count;
    message.names.push_back(name);
    message.values.push_back(static_cast<std::int64_t>(counter.value));
  }
  return message;
}

}  // namespace clearance
