// Exact duplicates among positions, found by hashing their bits.
#pragma once

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "engine/base/vec.h"

namespace clearance {

/// Numbers distinct positions. Compares exactly, without a tolerance (-0 equals +0).
template <class T>
class PositionIndex {
 public:
  /// \param expected expected number of lookups, at most 2^32 - 2; only a hint
  explicit PositionIndex(std::size_t expected)
      : log2_slots_(std::clamp(static_cast<int>(std::bit_width(expected / 2)), 8, 24)),
        slots_(std::size_t{1} << log2_slots_, kFree) {
    assert(expected < kFree);
  }

  /// Returns the number of a position without a NaN. A new position gets the next number.
  std::uint32_t number(const Vec3<T>& p) {
    const Vec3<T> v{p.x + T(0), p.y + T(0), p.z + T(0)};  // -0 becomes +0
    std::size_t s = place(v);
    for (; slots_[s] != kFree; s = (s + 1) & (slots_.size() - 1)) {
      const Vec3<T>& u = positions_[slots_[s]];
      if (u.x == v.x && u.y == v.y && u.z == v.z) return slots_[s];
    }
    const auto fresh = static_cast<std::uint32_t>(positions_.size());
    slots_[s] = fresh;
    positions_.push_back(v);
    if (2 * positions_.size() > slots_.size()) grow();
    return fresh;
  }

  /// The positions, indexed by number.
  const std::vector<Vec3<T>>& positions() const { return positions_; }
  std::vector<Vec3<T>> take() { return std::move(positions_); }

 private:
  static constexpr std::uint32_t kFree = 0xFFFFFFFFu;

  std::size_t place(const Vec3<T>& v) const {
    using Bits = std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t>;
    std::uint64_t h = 0;
    for (int k = 0; k < 3; ++k) {
      h = (std::rotl(h, 23) ^ std::uint64_t{std::bit_cast<Bits>(v[k])}) * 0x9E3779B97F4A7C15ull;
      h ^= h >> 29;
    }
    return static_cast<std::size_t>((h * 0xD6E8FEB86659FD93ull) >> (64 - log2_slots_));
  }
  void grow() {
    ++log2_slots_;
    slots_.assign(slots_.size() * 2, kFree);
    for (std::uint32_t k = 0; k < positions_.size(); ++k) {
      std::size_t t = place(positions_[k]);
      while (slots_[t] != kFree) t = (t + 1) & (slots_.size() - 1);
      slots_[t] = k;
    }
  }

  int log2_slots_;
  std::vector<std::uint32_t> slots_;
  std::vector<Vec3<T>> positions_;
};

/// The distinct positions of a list, in order of first appearance.
template <class T>
struct UniquePositions {
  std::vector<Vec3<T>> positions;
  std::vector<std::uint32_t> index;  ///< of each input position among `positions`
};

/// \param count number of positions, at most 2^32 - 2
/// \param position returns position i, without a NaN
template <class T, class F>
UniquePositions<T> unique_positions(std::size_t count, F&& position) {
  PositionIndex<T> numbers(count);
  UniquePositions<T> out;
  out.index.reserve(count);
  for (std::size_t i = 0; i < count; ++i) out.index.push_back(numbers.number(position(i)));
  out.positions = numbers.take();
  return out;
}

template <class T>
UniquePositions<T> unique_positions(std::span<const Vec3<T>> input) {
  return unique_positions<T>(input.size(), [&](std::size_t i) { return input[i]; });
}

}  // namespace clearance
