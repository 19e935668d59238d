// Shared checks of frames: sizes without overflow, and errors with the part and the expected value. Included only by
// wire.h's sources.
#pragma once

#include <concepts>
#include <cstdio>
#include <limits>

#include "wire/wire.h"

namespace clearance::wire {

inline constexpr std::uint64_t kMaxPayloadBytes = kMaxFrameBytes - sizeof(FrameHeader);
inline constexpr std::uint64_t kRecordAlignment = 8;

// Sizes are summed in 128 bits, which three 32-bit counts times record sizes cannot overflow.
using Wide = unsigned __int128;

constexpr std::uint64_t align(std::uint64_t bytes, std::uint64_t to) {
  return (bytes + to - 1) / to * to;
}

template <std::integral T>
std::string str(T value) {
  return std::to_string(value);
}

inline std::string str(Wide value) {
  if (value > std::numeric_limits<std::uint64_t>::max()) return "more than 2^64";
  return std::to_string(static_cast<std::uint64_t>(value));
}

inline std::string str(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

[[noreturn]] inline void bad_frame(const std::string& text) {
  throw WireError(ErrorCode::kBadFrame, text);
}
[[noreturn]] inline void bad_query(const std::string& text) {
  throw WireError(ErrorCode::kBadQuery, text);
}

/// Returns the fixed struct at the start of a payload.
template <class T>
T head(std::span<const std::byte> payload, const char* what) {
  if (payload.size() < sizeof(T))
    bad_frame(std::string(what) + ": the payload has " + str(payload.size()) + " bytes, fewer than its header of " +
              str(sizeof(T)));
  T header;
  std::memcpy(&header, payload.data(), sizeof(T));
  return header;
}

/// \param contents returns a description of the expected payload; called only for an error
template <class Contents>
void expect_size(const char* what, const Contents& contents, Wide expected, std::uint64_t got) {
  if (expected != got)
    bad_frame(std::string(what) + ": " + contents() + " need a payload of " + str(expected) + " bytes, got " +
              str(got));
}
inline std::string its_contents() {
  return "its contents";
}

template <class T, std::size_t N>
void expect_zero(const T (&reserved)[N], const char* what) {
  for (const T& word : reserved)
    if (word != 0) bad_frame(std::string(what) + ": reserved words must be 0");
}

template <std::size_t N>
void expect_name(const char (&name)[N], const char* what, std::uint64_t index) {
  if (strnlen(name, N) == N) bad_frame(std::string(what) + "[" + str(index) + "]: the name does not end");
}

/// Checks that a row by pairs of joints fits into the largest payload; the sizes of larger ones do not fit 64 bits.
inline void expect_width(const char* what, std::uint32_t fields, std::uint32_t joints) {
  if ((fields & kFieldHessianJoints) && Wide(joints) * joints > kMaxPayloadBytes / 8)
    bad_frame(std::string(what) + ": a row of " + str(joints) + " x " + str(joints) + " numbers is too large");
}

/// Consecutive sections of a payload whose size has been checked.
class Cursor {
 public:
  explicit Cursor(const std::byte* at) : at_(at) {}
  template <class T>
  Records<T> take(std::uint64_t count) {
    Records<T> records(at_, count);
    at_ += records.size_bytes();
    return records;
  }
  void skip(std::uint64_t bytes) { at_ += bytes; }

 private:
  const std::byte* at_;
};

}  // namespace clearance::wire
