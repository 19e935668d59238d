// How an input holds frames: [control 1 B | size 2 B, little-endian | bytes] one after another.
#pragma once

#include <algorithm>
#include <vector>

#include "tests/fuzz/fuzz_target.h"
#include "wire/wire.h"

namespace clearance::fuzz {

/// Set in the control byte: magic, version, sizes and reserved words of the header are put right, so that mutations of
/// the payload are not all refused at the first look.
inline constexpr std::uint8_t kMendHeader = 1;

struct InputFrame {
  std::uint8_t control = 0;
  std::vector<std::byte> bytes;  ///< at least a header's worth
};

inline InputFrame next_frame(Input& in) {
  InputFrame frame;
  frame.control = in.number<std::uint8_t>();
  const Bytes bytes = in.take(in.number<std::uint16_t>());
  frame.bytes.assign(bytes.begin(), bytes.end());
  wire::FrameHeader header{};
  if (frame.bytes.size() < sizeof header) frame.bytes.resize(sizeof header);
  if (frame.control & kMendHeader) {
    std::memcpy(&header, frame.bytes.data(), sizeof header);
    header.magic = wire::kMagic;
    header.version = wire::kVersion;
    header.payload_bytes = frame.bytes.size() - sizeof header;
    header.records_bytes = std::min(header.records_bytes, header.payload_bytes) / 8 * 8;
    std::memset(header.reserved, 0, sizeof header.reserved);
    std::memcpy(frame.bytes.data(), &header, sizeof header);
  }
  return frame;
}

/// The bytes of an input with one more frame.
inline void append_frame(std::vector<std::byte>& input, std::uint8_t control, Bytes frame) {
  wire::append(input, control);
  wire::append(input, static_cast<std::uint16_t>(frame.size()));
  wire::append_bytes(input, frame.data(), frame.size());
}

}  // namespace clearance::fuzz
