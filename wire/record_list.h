// Records of a frame under construction, without copies of their arrays.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "wire/protocol.h"

namespace clearance::wire {

/// Refers to the arrays of records, so that each is copied once, into the frame.
class RecordList {
 public:
  /// \param encoded output of append_record(), in the order of tags
  explicit RecordList(std::vector<std::byte> encoded);
  RecordList(const RecordList&) = delete;
  RecordList& operator=(const RecordList&) = delete;

  /// Inserts a record before the first one with a higher tag.
  /// \param array outlives this
  void insert(std::uint16_t tag, std::uint16_t flags, std::span<const std::byte> array);
  /// Appends output of append_record(), which outlives this.
  void append(std::span<const std::byte> encoded);

  std::uint64_t bytes() const;
  /// Writes all records.
  /// \param to (bytes(),)
  void write(std::byte* to) const;

 private:
  struct Record {
    RecordHeader header;
    std::span<const std::byte> array;
  };
  std::vector<std::byte> encoded_;
  std::vector<Record> records_;
};

}  // namespace clearance::wire
