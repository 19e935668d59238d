// The enabled pairs of bodies in lexicographic order, without storing them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/body_pair.h"
#include "engine/scene/scene.h"

namespace clearance {

/// The enabled pairs (a < b) of a scene: all except pairs of static bodies, of parent and child, of frames, and ignored
/// pairs. Memory grows with bodies and exclusions, not with pairs: 50,000 bodies have more than 10^9 pairs.
class PairTable {
 public:
  /// \param parents of each body, or kNone
  /// \param ignored pairs to leave out
  PairTable(const engine::Scene& scene, std::span<const std::uint32_t> parents, std::span<const BodyPair> ignored);

  std::uint64_t size() const { return row_begin_.back(); }
  /// Returns whether {a, b}, in either order, is enabled.
  bool enabled(std::uint32_t a, std::uint32_t b) const;
  /// Returns the position of an enabled pair, a < b.
  std::uint64_t position(BodyPair pair) const;
  /// Writes the pairs at positions [begin, begin + count).
  void copy(std::uint64_t begin, std::uint64_t count, BodyPair* out) const;

  /// The table's arrays, for lookups outside this class.
  struct Arrays {
    std::span<const std::uint8_t> is_static;        ///< (N,)
    std::span<const std::uint32_t> movable_before;  ///< (N + 1,) movable bodies with a smaller id
    std::span<const std::uint64_t> row_begin;       ///< (N + 1,) position of the first pair (i, j > i)
    std::span<const std::uint32_t> excluded_begin;  ///< (N + 1,) rows of `excluded`
    std::span<const std::uint32_t> excluded;        ///< sorted j of each row
  };
  Arrays arrays() const { return {is_static_, movable_before_, row_begin_, excluded_begin_, excluded_}; }

 private:
  std::uint32_t partners_before(std::uint32_t row, std::uint32_t j) const;  // below j, exclusions included
  bool excluded(std::uint32_t a, std::uint32_t b) const;                    // a < b, not both static

  std::uint32_t bodies_;
  std::vector<std::uint8_t> is_static_;
  std::vector<std::uint32_t> movable_before_;
  std::vector<std::uint64_t> row_begin_;
  std::vector<std::uint32_t> excluded_begin_;
  std::vector<std::uint32_t> excluded_;
};

}  // namespace clearance
