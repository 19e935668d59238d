// Decides pairs of one robot's links by their joint tables, for the kernel of decisions (decide_kernel.h).
#pragma once

#include <cstdint>

#include "engine/decision/decision_view.h"

#ifndef CLEARANCE_ISA
#error "define CLEARANCE_ISA, the instruction set this file is compiled for"
#endif

namespace clearance {
namespace CLEARANCE_ISA {

/// What the tables of a query prove in one state.
class TableLookup {
 public:
  explicit TableLookup(const DecisionView& view) : v_(view) { forget(); }

  /// Nothing is proved.
  void forget() {
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t) is_free_[t] = false;
  }
  /// \param positions of the state; null to prove nothing
  /// \param hit called with the position of each pair that is within its margin
  template <class Hit>
  void look_up(const double* positions, const Hit& hit) {
    if (!positions) return forget();
    for (std::uint32_t t = 0; t < v_.tabled_count; ++t) {
      const TabledPair& pair = v_.tabled[t];
      const TableCell cell = cell_at(pair, positions);
      is_free_[t] = cell.low > pair.free_above;
      if (cell.high < pair.hit_below) hit(pair.position);
    }
  }
  /// \param table index of a TabledPair, or kNoTable
  bool is_free(std::uint32_t table) const { return table != kNoTable && is_free_[table]; }

 private:
  static TableCell cell_at(const TabledPair& pair, const double* positions) {
    std::uint32_t cell[2];
    for (int c = 0; c < 2; ++c)
      if (!cell_of(pair.columns[c], pair.at[c] == kNone ? pair.fixed[c] : positions[pair.at[c]], cell[c]))
        return {TableCell::kNoLow, TableCell::kNoHigh};
    return pair.cells[(std::uint64_t{cell[0]} << pair.columns[1].shift) + cell[1]];
  }

  const DecisionView& v_;
  bool is_free_[kMostTabledPairs];
};

}  // namespace CLEARANCE_ISA
}  // namespace clearance
