// Decides pairs of one robot's links by their joint tables, for the kernel of decisions (decide_kernel.h).
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/decision/kernel/decision_view.h"

#ifndef CLEARANCE_ISA
#error "define CLEARANCE_ISA, the instruction set this file is compiled for"
#endif

namespace clearance {
namespace CLEARANCE_ISA {

/// Decisions of a query's tables in one state, or in a span of a motion.
class TableLookup {
 public:
  explicit TableLookup(const DecisionView& view) : v_(view) {
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t) is_free_[t] = false;
  }

  /// Finds the cells of all pairs in a state, which then take time to arrive from memory.
  /// \param k number of the state, less than 8
  /// \param positions of the state; null to prove nothing
  void find(std::size_t k, const double* positions) {
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t)
      cells_[k][t] = positions ? v_.tabled[t].find(positions) : nullptr;
  }
  /// The cells found in state k.
  const TableCell* const* cells(std::size_t k) const { return cells_[k]; }
  /// Decides the pairs of a state.
  /// \param cells (tabled_count,) of the state
  /// \param hit called with the position of each pair that is within its margin
  template <class Hit>
  void look_up(const TableCell* const* cells, const Hit& hit) {
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t) {
      const TabledPair& pair = v_.tabled[t];
      const TableCell* const cell = cells[t];
      is_free_[t] = cell && cell->low > pair.free_above;
      if (cell && cell->high < pair.hit_below) hit(pair.position);
    }
  }
  /// Whether the pair of a table was found free.
  /// \param table index of a TabledPair, or kNoTable
  bool is_free(std::uint32_t table) const { return table != kNoTable && is_free_[table]; }

  /// A pair in a span.
  struct Span {
    Verdict verdict = Verdict::kUnresolved;  ///< kHit if it is within its margin in the middle
    bool is_middle_free = false;             ///< so that shorter spans may be free
  };
  /// Looks one pair up in a span.
  /// \param positions in the middle; null to prove nothing
  /// \param reach change of each position until a span's end, >= 0
  Span in_span(std::uint32_t table, const double* positions, const double* reach) const {
    if (table == kNoTable || !positions) return {};
    const TabledPair& pair = v_.tabled[table];
    double at[2], low[2], high[2];
    for (int c = 0; c < 2; ++c) {
      at[c] = pair.position_of(c, positions);
      const double by = pair.at[c] == kNone ? 0 : reach[pair.at[c]];
      low[c] = at[c] - by;
      high[c] = at[c] + by;
    }
    for (const std::uint32_t most : {2u, 4u})
      if (pair.table.over(low, high, most).low > pair.free_above) return {Verdict::kFree, true};
    const TableCell cell = pair.table.at(at);
    return {cell.high < pair.hit_below ? Verdict::kHit : Verdict::kUnresolved, cell.low > pair.free_above};
  }

 private:
  const DecisionView& v_;
  const TableCell* cells_[8][kMostTabledPairs];  // by state; null outside the table
  bool is_free_[kMostTabledPairs];
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
