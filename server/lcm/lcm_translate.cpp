#include "server/lcm/lcm_translate.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "wire/lcm/lcm_bus.h"

namespace clearance {
namespace {

/// Upper bound on a message's size without its rows: ids, counts, the backend's name.
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

/// Payload of the loop's reply. An error frame is thrown as WireError.
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

}  // namespace

ReplyParts::ReplyParts(FrameBytes frame, std::int64_t server_id, std::int64_t sequence, std::int64_t client_id)
    : frame_(std::move(frame)) {
  common_.server_id = server_id;
  common_.sequence = sequence;
  common_.client_id = client_id;
  wire::FrameHeader frame_header{};
  try {
    const auto whole = wire::split_frame(frame_.span(), frame_header);
    const auto payload = wire::split_payload(frame_header, whole).body;  // messages have no field for records
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
  message.points32_count = rows.vectors(kFieldPoints32, 6, message.points32);
  message.bounds_count = rows.vectors(kFieldBounds, 2, message.bounds);
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
