// Builds and validates frames and their records (protocol.h), with the same routines in the daemon and in clients.
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
#include <type_traits>
#include <vector>

#include "wire/protocol.h"

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
