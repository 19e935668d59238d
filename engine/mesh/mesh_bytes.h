// Numbers in the bytes of a mesh file.
#pragma once

#include <bit>
#include <cstdint>
#include <string_view>
#include <type_traits>

namespace clearance {

/// Reads an unsigned number of up to 8 bytes at `bytes[at]`. All of them must exist.
inline std::uint64_t unsigned_at(std::string_view bytes, std::size_t at, std::size_t size, bool big_endian = false) {
  std::uint64_t x = 0;
  for (std::size_t i = 0; i < size; ++i) {
    const std::uint64_t byte = static_cast<unsigned char>(bytes[at + i]);
    x |= byte << 8 * (big_endian ? size - 1 - i : i);
  }
  return x;
}

/// Reads a float or double at `bytes[at]`.
template <class T>
double real_at(std::string_view bytes, std::size_t at, bool big_endian = false) {
  using Bits = std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t>;
  return static_cast<double>(std::bit_cast<T>(static_cast<Bits>(unsigned_at(bytes, at, sizeof(T), big_endian))));
}

}  // namespace clearance
