#include <cstring>

#include "client/channel.h"
#include "client/client.h"
#include "client/fork_guard.h"
#include "wire/wire.h"

namespace clearance {
namespace {

wire::ReplyHeader header_of(const Frame& frame) {
  wire::ReplyHeader header;
  std::memcpy(&header, frame.payload().data(), sizeof header);
  return header;
}

}  // namespace

Reply::Reply(std::unique_ptr<Frame> frame) : frame_(std::move(frame)) {
  try {
    const wire::PayloadParts parts = wire::split_payload(frame_->header(), frame_->payload());
    const auto header = wire::parse_reply(parts.body, parts.records, &joints_);
    epoch_ = wire::epoch_of(frame_->header(), frame_->payload());
    rows_ = header.rows;
    fields_ = header.fields;
  } catch (const wire::WireError& error) {
    throw ConnectionError(std::string("the daemon sent a malformed frame: ") + error.what());
  }
}
Reply::Reply(Reply&&) noexcept = default;
Reply& Reply::operator=(Reply&&) noexcept = default;
Reply::~Reply() = default;

template <class T>
std::span<const T> Reply::column(Field field, std::size_t width) const {
  if (!(fields_ & field)) return {};
  const std::byte* begin =
      frame_->payload().data() + sizeof(wire::ReplyHeader) + wire::column_offset(rows_, fields_, field, joints_);
  return {reinterpret_cast<const T*>(begin), static_cast<std::size_t>(rows_) * width};
}

std::size_t Reply::rows() const {
  return rows_;
}
std::uint64_t Reply::total() const {
  return header_of(*frame_).total;
}
std::uint64_t Reply::configurations() const {
  return header_of(*frame_).configurations;
}
std::uint64_t Reply::pairs() const {
  return header_of(*frame_).pairs;
}
std::uint32_t Reply::fields() const {
  return fields_;
}
std::span<const double> Reply::distance() const {
  return column<double>(kFieldDistance, 1);
}
std::span<const double> Reply::lower() const {
  return column<double>(kFieldLower, 1);
}
std::span<const double> Reply::upper() const {
  return column<double>(kFieldUpper, 1);
}
std::span<const Status> Reply::status() const {
  return column<Status>(kFieldStatus, 1);
}
std::span<const std::uint16_t> Reply::flags() const {
  return column<std::uint16_t>(kFieldFlags, 1);
}
std::span<const double> Reply::point_a() const {
  return column<double>(kFieldPointA, 3);
}
std::span<const double> Reply::point_b() const {
  return column<double>(kFieldPointB, 3);
}
std::span<const double> Reply::normal() const {
  return column<double>(kFieldNormal, 3);
}
std::span<const std::uint32_t> Reply::pieces() const {
  return column<std::uint32_t>(kFieldPieces, 2);
}
std::span<const double> Reply::gradient() const {
  return column<double>(kFieldGradient, 12);
}
std::span<const IdPair> Reply::pair() const {
  return column<IdPair>(kFieldPair, 1);
}
std::span<const std::uint32_t> Reply::configuration() const {
  return column<std::uint32_t>(kFieldConfiguration, 1);
}
std::span<const float> Reply::points32() const {
  return column<float>(kFieldPoints32, 6);
}
std::span<const double> Reply::gradient_joints() const {
  return column<double>(kFieldGradientJoints, joints_);
}
std::uint32_t Reply::joints() const {
  return joints_;
}
std::span<const IdPair> Reply::pair_lower() const {
  return column<IdPair>(kFieldPairLower, 1);
}
std::span<const double> Reply::time() const {
  return column<double>(kFieldTime, 1);
}
std::span<const double> Reply::first_contact() const {
  return column<double>(kFieldFirstContact, 2);
}
std::span<const std::uint32_t> Reply::steps() const {
  return column<std::uint32_t>(kFieldSteps, 1);
}

std::span<const float> Reply::bounds() const {
  return column<float>(kFieldBounds, 2);
}
std::span<const double> Reply::free_scale() const {
  return column<double>(kFieldFreeScale, 1);
}

std::uint64_t Reply::epoch() const {
  return epoch_;
}
std::uint64_t Reply::scene_revision() const {
  return header_of(*frame_).scene_revision;
}
std::uint64_t Reply::snapshot_revision() const {
  return header_of(*frame_).snapshot_revision;
}
std::int64_t Reply::snapshot_stamp_ns() const {
  return header_of(*frame_).snapshot_stamp_ns;
}
std::int64_t Reply::snapshot_sequence() const {
  return header_of(*frame_).snapshot_sequence;
}
std::int64_t Reply::pose_age_ns() const {
  return header_of(*frame_).pose_age_ns;
}
std::uint64_t Reply::engine_ns() const {
  return header_of(*frame_).engine_ns;
}
std::uint64_t Reply::server_ns() const {
  return header_of(*frame_).server_ns;
}
std::string_view Reply::backend() const {
  const std::byte* name = frame_->payload().data() + offsetof(wire::ReplyHeader, backend);
  return {reinterpret_cast<const char*>(name),
          strnlen(reinterpret_cast<const char*>(name), sizeof(wire::ReplyHeader::backend))};
}

}  // namespace clearance
