// Frames and their records, independent of the contents.
#include <utility>

#include "wire/checks.h"

namespace clearance::wire {

void check_header(const FrameHeader& h, std::uint64_t payload_bytes) {
  if (h.magic != kMagic) {
    char text[80];
    std::snprintf(text, sizeof text, "frame: magic is 0x%08x, expected 0x%08x", h.magic, kMagic);
    bad_frame(text);
  }
  if (h.version != kVersion)
    throw WireError(ErrorCode::kWrongVersion,
                    "frame: version " + str(h.version) + ", this side speaks version " + str(kVersion));
  if (h.payload_bytes > kMaxPayloadBytes)
    bad_frame("frame: a payload of " + str(h.payload_bytes) + " bytes is more than the " + str(kMaxPayloadBytes) +
              " allowed");
  if (h.payload_bytes != payload_bytes)
    bad_frame("frame: the header announces a payload of " + str(h.payload_bytes) + " bytes, " + str(payload_bytes) +
              " came");
  if (h.flags & ~kKnownFrameFlags) bad_frame("frame: flags has unknown bits: " + str(h.flags & ~kKnownFrameFlags));
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
  if (h.records_bytes > payload.size() || h.records_bytes % kRecordAlignment)
    bad_frame("frame: " + str(h.records_bytes) + " bytes are not whole records at the end of a payload of " +
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
  return make_header(type, request.request_id, payload_bytes, scene_revision, request.client_id);
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
    case FrameType::kSetJoints:
      return "kSetJoints";
    case FrameType::kGetJoints:
      return "kGetJoints";
    case FrameType::kGetStats:
      return "kGetStats";
    case FrameType::kSetPoints:
      return "kSetPoints";
    case FrameType::kCertify:
      return "kCertify";
    case FrameType::kOpenPlan:
      return "kOpenPlan";
    case FrameType::kRunPlan:
      return "kRunPlan";
    case FrameType::kClosePlan:
      return "kClosePlan";
    case FrameType::kReload:
      return "kReload";
    case FrameType::kAddBody:
      return "kAddBody";
    case FrameType::kRemoveBody:
      return "kRemoveBody";
    case FrameType::kAllow:
      return "kAllow";
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
    case FrameType::kJoints:
      return "kJoints";
    case FrameType::kStats:
      return "kStats";
    case FrameType::kSceneChanged:
      return "kSceneChanged";
    case FrameType::kCertificate:
      return "kCertificate";
    case FrameType::kPlan:
      return "kPlan";
    case FrameType::kPlanDone:
      return "kPlanDone";
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
    case ErrorCode::kNewEpoch:
      return "new_epoch";
    case ErrorCode::kDeadline:
      return "deadline";
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

namespace {

/// Inserts a record in place, without a copy of its own.
void put_record(std::vector<std::byte>& records, std::size_t at, const RecordHeader& header,
                std::span<const std::byte> bytes) {
  records.insert(records.begin() + static_cast<std::ptrdiff_t>(at),
                 align(sizeof header + std::uint64_t{header.bytes}, kRecordAlignment), std::byte{0});
  std::memcpy(records.data() + at, &header, sizeof header);
  if (!bytes.empty()) std::memcpy(records.data() + at + sizeof header, bytes.data(), bytes.size());
}

}  // namespace

void append_record(std::vector<std::byte>& records, std::uint16_t tag, std::uint16_t flags,
                   std::span<const std::byte> bytes) {
  put_record(records, records.size(), {tag, flags, static_cast<std::uint32_t>(bytes.size())}, bytes);
}

void insert_record(std::vector<std::byte>& records, std::uint16_t tag, std::uint16_t flags,
                   std::span<const std::byte> bytes) {
  std::size_t at = 0;
  for (RecordHeader record; at < records.size(); at += align(sizeof record + record.bytes, kRecordAlignment)) {
    std::memcpy(&record, records.data() + at, sizeof record);
    if (record.tag > tag) break;
  }
  put_record(records, at, {tag, flags, static_cast<std::uint32_t>(bytes.size())}, bytes);
}

void append_epoch(std::vector<std::byte>& records, std::uint64_t epoch, std::uint16_t flags) {
  append_record(records, static_cast<std::uint16_t>(CommonRecord::kEpoch), flags, std::as_bytes(std::span(&epoch, 1)));
}

std::uint64_t epoch_of(const FrameHeader& header, std::span<const std::byte> payload) {
  PassedOver none;
  return read_records("reply", split_payload(header, payload).records, none, [](const RecordView&) { return true; });
}

std::uint64_t epoch_in(const char* what, const RecordView& record) {
  std::uint64_t epoch = 0;
  if (record.bytes.size() == sizeof epoch) std::memcpy(&epoch, record.bytes.data(), sizeof epoch);
  if (epoch == 0) bad_frame(what + std::string(": an epoch is a number of 8 bytes, and not 0"));
  return epoch;
}

FrameHeader with_records(FrameHeader header, std::uint64_t records_bytes) {
  header.records_bytes = records_bytes;
  header.payload_bytes += records_bytes;
  return header;
}

RecordView take_record(const char* what, std::span<const std::byte>& records, std::uint16_t& last) {
  RecordHeader header;
  if (records.size() < sizeof header)
    head<RecordHeader>(records, (what + std::string(": a record")).c_str());  // throws
  std::memcpy(&header, records.data(), sizeof header);
  const auto reject = [&](const std::string& why) {
    bad_frame(std::string(what) + ": record " + str(header.tag) + why);
  };
  if (header.flags & ~kRecordRequired) reject(" has unknown flags");
  if (header.tag <= last) reject(" comes after record " + str(last) + ": tags must increase from 1");
  last = header.tag;
  const std::uint64_t whole = align(sizeof header + std::uint64_t{header.bytes}, kRecordAlignment);
  if (whole > records.size()) reject(" goes past the end of the frame");
  const RecordView record{header.tag, (header.flags & kRecordRequired) != 0,
                          records.subspan(sizeof header, header.bytes)};
  records = records.subspan(static_cast<std::size_t>(whole));
  return record;
}

void pass_over(const char* what, const RecordView& record, PassedOver& passed_over) {
  if (record.required)
    throw WireError(ErrorCode::kNotSupported,
                    std::string(what) + ": record " + str(record.tag) + " is required but unknown to this side");
  passed_over.push_back(record.tag);
}

}  // namespace clearance::wire
