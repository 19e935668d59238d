// A round of states or motions. Included by the sources of StateOracle alone.
#pragma once

#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "tests/oracle/states/state_oracle.h"

namespace clearance::exact {

inline constexpr double kInf = std::numeric_limits<double>::infinity();

/// Rounds of every kind and column of a table in turn, until `count` states or motions are compared. Close rounds have
/// fewer states, and are four times as many.
template <class Table, class Compare>
Table compare_rounds(std::int64_t count, std::uint64_t seed, const Compare& compare) {
  Table table;
  Random random(seed);
  std::int64_t all = 0;
  for (std::size_t turn = 0; all < count; ++turn)
    for (std::size_t kind = 0; kind < table.size(); ++kind)
      for (int n = kind <= static_cast<std::size_t>(StateKind::kNear) ? 1 : 4; n > 0; --n) {
        const std::size_t column = turn % table[kind].size();
        typename Table::value_type::value_type tally;
        compare(static_cast<StateKind>(kind), column, random, tally);
        table[kind][column].add(tally);
        all += tally.count;
      }
  return table;
}

inline bool is_hit(Status s) {
  return s == Status::kOk;
}
inline bool is_free(Status s) {
  return s == Status::kBeyond;
}

inline bool is_decided(Status s) {
  return is_hit(s) || is_free(s);
}

inline QueryView query_of(std::span<const std::uint32_t> joints, std::span<const double> positions, double margin) {
  QueryView query;
  query.joints = joints;
  query.positions = positions;
  query.configuration_count = static_cast<std::uint32_t>(positions.size() / joints.size());
  query.reduce = Reduce::kAny;
  query.margin = margin;
  query.fields = kFieldVerdict | kFieldPair;
  return query;
}

struct StateOracle::Round {
  StateKind kind;
  double margin;
  std::size_t margin_index;
  std::vector<double> through{};    // a state at which obstacles are placed
  std::size_t count = 0;            // of states or motions
  std::vector<double> positions{};  // (count, J), or (2 count, J) starts and ends
  std::vector<double> times{};      // of motions, at which they pass through the state
  double gap = kInf;                // of the placed obstacle, beyond the margin
  bool is_attached = false;

  bool is_close() const { return kind == StateKind::kTouching || kind == StateKind::kDeep; }
};

}  // namespace clearance::exact
