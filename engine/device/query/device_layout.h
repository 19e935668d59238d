// Places of a device query's input and columns in one block of device memory.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/device/query/device_plan.h"

namespace clearance {

/// Poses, positions and columns, each from a multiple of kColumnAlignment.
struct DeviceLayout {
  /// Places the input. Throws QueryError (kTooLarge).
  /// \param query its configurations are a number alone
  explicit DeviceLayout(const QueryView& query);
  /// Places the columns behind it.
  void add_columns(const QuerySize& of_answer);

  GivenOnDevice given(std::byte* memory) const;
  ReplyView rows(std::byte* memory) const;
  /// Calls f(Field bit, bytes of a row, offset) for each column in the order of Field.
  template <class F>
  void for_each_column(F f) const {
    std::uint64_t offset = columns_offset;
    for (int column = 0; column < kFieldCount; ++column) {
      if (!(size.fields >> column & 1)) continue;
      const std::uint64_t row = field_bytes(column, joints);
      f(1u << column, static_cast<std::uint32_t>(row), offset);
      offset = aligned(offset + size.rows * row);
    }
  }

  std::uint32_t bodies = 0, joints = 0;
  std::uint64_t positions_offset = 0, columns_offset = 0;  ///< poses begin at 0
  std::uint64_t bytes = 0;                                 ///< at least one
  QuerySize size;

 private:
  static constexpr std::uint64_t aligned(std::uint64_t bytes) {
    return (bytes + kColumnAlignment - 1) / kColumnAlignment * kColumnAlignment;
  }
};

}  // namespace clearance
