// Records of a request under construction, without copies of their arrays.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <utility>
#include <vector>

#include "wire/protocol.h"

namespace clearance {

/// Refers to the arrays of records, so that each is copied once, into the frame.
class RecordList {
 public:
  /// \param encoded output of wire::append_record(), in the order of tags
  explicit RecordList(std::vector<std::byte> encoded) : encoded_(std::move(encoded)) {
    constexpr std::size_t kUsual = 8;
    records_.reserve(kUsual);
    append(encoded_);
  }
  RecordList(const RecordList&) = delete;
  RecordList& operator=(const RecordList&) = delete;

  /// Inserts a record before the first one with a higher tag.
  /// \param array outlives this
  void insert(wire::QueryRecord tag, std::span<const std::byte> array) {
    const auto number = static_cast<std::uint16_t>(tag);
    const auto at =
        std::find_if(records_.begin(), records_.end(), [number](const Record& r) { return r.header.tag > number; });
    records_.insert(at, {{number, wire::kRecordRequired, static_cast<std::uint32_t>(array.size())}, array});
  }
  /// Appends output of wire::append_record(), which outlives this.
  void append(std::span<const std::byte> encoded) {
    while (!encoded.empty()) {
      wire::RecordHeader header;
      std::memcpy(&header, encoded.data(), sizeof header);
      records_.push_back({header, encoded.subspan(sizeof header, header.bytes)});
      encoded = encoded.subspan(sizeof header + padded(header.bytes));
    }
  }

  std::uint64_t bytes() const {
    std::uint64_t sum = 0;
    for (const Record& record : records_) sum += sizeof record.header + padded(record.array.size());
    return sum;
  }
  /// Writes all records.
  /// \param to (bytes(),)
  void write(std::byte* to) const {
    for (const auto& [header, array] : records_) {
      std::memcpy(to, &header, sizeof header);
      to += sizeof header;
      if (!array.empty()) std::memcpy(to, array.data(), array.size());
      std::memset(to + array.size(), 0, padded(array.size()) - array.size());
      to += padded(array.size());
    }
  }

 private:
  struct Record {
    wire::RecordHeader header;
    std::span<const std::byte> array;
  };
  /// Records begin at multiples of 8 bytes.
  static std::uint64_t padded(std::uint64_t bytes) { return (bytes + 7) / 8 * 8; }
  static_assert(sizeof(wire::RecordHeader) % 8 == 0);

  std::vector<std::byte> encoded_;
  std::vector<Record> records_;
};

}  // namespace clearance
