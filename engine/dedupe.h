// Exact duplicates among positions, found by hashing their bits.
#pragma once

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "math.h"

namespace clearance {

/// The distinct positions of a list, in order of first appearance.
template <class T>
struct UniquePositions {
  std::vector<Vec3<T>> positions;
  std::vector<std::uint32_t> index;  ///< of each input position among `positions`
};

/// Merges positions that are equal as numbers (-0 equals +0); nothing is merged within a tolerance.
/// \param count at most 2^32 - 2. \param position gives position i; none may be NaN.
template <class T, class F>
UniquePositions<T> unique_positions(std::size_t count, F&& position) {
  using Bits = std::conditional_t<sizeof(T) == 8, std::uint64_t, std::uint32_t>;
  constexpr std::uint32_t kFree = 0xFFFFFFFFu;
  assert(count < kFree);
  const auto hash = [](const Vec3<T>& v) {
    std::uint64_t h = 0;
    for (int k = 0; k < 3; ++k) {
      h = (std::rotl(h, 23) ^ std::uint64_t{std::bit_cast<Bits>(v[k])}) * 0x9E3779B97F4A7C15ull;
      h ^= h >> 29;
    }
    return h * 0xD6E8FEB86659FD93ull;
  };

  UniquePositions<T> out;
  out.index.resize(count);
  int log2_slots = std::clamp(static_cast<int>(std::bit_width(count / 2)), 8, 24);
  std::vector<std::uint32_t> slots(std::size_t{1} << log2_slots, kFree);
  const auto place = [&](std::uint64_t h) { return static_cast<std::size_t>(h >> (64 - log2_slots)); };
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3<T> p = position(i), v{p.x + T(0), p.y + T(0), p.z + T(0)};  // -0 becomes +0
    std::size_t s = place(hash(v));
    const std::size_t mask = slots.size() - 1;
    while (slots[s] != kFree) {
      const Vec3<T>& u = out.positions[slots[s]];
      if (u.x == v.x && u.y == v.y && u.z == v.z) break;
      s = (s + 1) & mask;
    }
    if (slots[s] != kFree) {
      out.index[i] = slots[s];
      continue;
    }
    const auto fresh = static_cast<std::uint32_t>(out.positions.size());
    slots[s] = fresh;
    out.index[i] = fresh;
    out.positions.push_back(v);
    if (2 * out.positions.size() <= slots.size()) continue;
    ++log2_slots;
    slots.assign(slots.size() * 2, kFree);
    for (std::uint32_t k = 0; k < out.positions.size(); ++k) {
      std::size_t t = place(hash(out.positions[k]));
      while (slots[t] != kFree) t = (t + 1) & (slots.size() - 1);
      slots[t] = k;
    }
  }
  return out;
}

template <class T>
UniquePositions<T> unique_positions(std::span<const Vec3<T>> input) {
  return unique_positions<T>(input.size(), [&](std::size_t i) { return input[i]; });
}

}  // namespace clearance
