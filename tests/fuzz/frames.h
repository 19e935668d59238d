// Format of frames in an input: [control 1 B | size 2 B, little-endian | bytes] repeated.
#pragma once

#include <algorithm>
#include <vector>

#include "tests/fuzz/fuzz_target.h"
#include "wire/wire.h"

namespace clearance::fuzz {

/// Set in the control byte if magic, version, sizes and reserved words of the header are to be corrected, so that
/// mutations of the payload are not all rejected by the first check.
inline constexpr std::uint8_t kMendHeader = 1;

struct InputFrame {
  std::uint8_t control = 0;
  std::vector<std::byte> bytes;  ///< at least as many as a header has
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

/// Appends a frame to the bytes of an input.
inline void append_frame(std::vector<std::byte>& input, std::uint8_t control, Bytes frame) {
  wire::append(input, control);
  wire::append(input, static_cast<std::uint16_t>(frame.size()));
  wire::append_bytes(input, frame.data(), frame.size());
}

}  // namespace clearance::fuzz
