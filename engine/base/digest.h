// A 64-bit digest of data, the same on every machine. Identifies scenes; not cryptographic.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

#include "engine/base/vec.h"

namespace clearance {

class Digest {
 public:
  void add(std::uint64_t word) {
    state_ = (std::rotl(state_, 29) ^ word) * 0x9E3779B97F4A7C15ull;
    state_ ^= state_ >> 32;
  }
  /// Hashes -0 as +0, so that equal numbers have equal digests.
  void add(double number) { add(std::bit_cast<std::uint64_t>(number + 0.0)); }
  void add(const Vec3d& v) {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  void add(std::span<const Vec3d> vectors) {
    add(std::uint64_t{vectors.size()});
    for (const Vec3d& v : vectors) add(v);
  }
  /// Hashes the length first, so that "ab","c" and "a","bc" differ.
  void add(std::string_view text) {
    add(std::uint64_t{text.size()});
    std::uint64_t word = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
      word = (word << 8) | static_cast<unsigned char>(text[i]);
      if (i % 8 == 7 || i + 1 == text.size()) {
        add(word);
        word = 0;
      }
    }
  }
  /// The digest, never 0.
  std::uint64_t value() const { return state_ ? state_ : 1; }

 private:
  std::uint64_t state_ = 0xC1EA12A4CE5D1657ull;
};

}  // namespace clearance
