// Which pairs of bodies are asked about, in lexicographic order, without storing them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/body_pair.h"
#include "engine/scene/scene.h"

namespace clearance {

/// The enabled pairs (a < b) of a scene: all but static-static, parent-child and ignored ones, and those of frames.
/// Memory grows with bodies and exclusions, not with pairs: a scene of 50,000 bodies has more than a thousand million.
class PairTable {
 public:
  /// \param parents of each body, kNone for none. \param ignored pairs that are left out.
  PairTable(const Scene& scene, std::span<const std::uint32_t> parents, std::span<const BodyPair> ignored);

  std::uint64_t size() const { return row_begin_.back(); }
  /// Whether {a, b}, in either order, is enabled.
  bool enabled(std::uint32_t a, std::uint32_t b) const;
  /// The position of an enabled pair, a < b.
  std::uint64_t position(BodyPair pair) const;
  /// Writes the pairs at positions [begin, begin + count).
  void copy(std::uint64_t begin, std::uint64_t count, BodyPair* out) const;

  /// What it is made of, for who has to look up pairs elsewhere.
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
  bool excluded(std::uint32_t a, std::uint32_t b) const;                    // a < b, of those that staticness leaves

  std::uint32_t bodies_;
  std::vector<std::uint8_t> is_static_;
  std::vector<std::uint32_t> movable_before_;
  std::vector<std::uint64_t> row_begin_;
  std::vector<std::uint32_t> excluded_begin_;
  std::vector<std::uint32_t> excluded_;
};

}  // namespace clearance
