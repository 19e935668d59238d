// Convex parts with missing data, to test whether the damage is detected.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/hull/direction_table.h"
#include "tests/oracle/oracle_run.h"

namespace clearance::exact {

/// The vertices of a body that an exact answer depends on.
inline std::vector<Vec3d> decisive(const Case& c, const Result& exact_value, bool of_b) {
  std::vector<Vec3d> v;
  for (const auto& s : exact_value.simplex) v.push_back(of_b ? c.b->vertices[s.b] : c.a->vertices[s.a]);
  return v;
}

inline bool holds(const std::vector<Vec3d>& list, const Vec3d& v) {
  return std::any_of(list.begin(), list.end(), [&](const Vec3d& w) { return w.x == v.x && w.y == v.y && w.z == v.z; });
}

/// The part without `vertices` in the lists of its direction table, although they are still vertices.
inline ConvexPartPtr without_table_entries_of(const ConvexPart& part, const std::vector<Vec3d>& vertices) {
  ConvexPart cut = part;
  if (!cut.table) return std::make_shared<const ConvexPart>(cut);
  DirectionTable table = *cut.table;
  const auto gone = [&](std::uint32_t i) { return holds(vertices, part.vertices[i]); };
  std::uint32_t other = 0;
  while (gone(other)) ++other;
  for (std::size_t at = 0; at < table.lists.size(); at += 1 + table.lists[at]) {
    const auto begin = table.lists.begin() + static_cast<std::ptrdiff_t>(at) + 1, end = begin + table.lists[at];
    const auto kept = std::find_if_not(begin, end, gone);
    std::replace_if(begin, end, gone, kept == end ? other : *kept);
  }
  cut.table = std::make_shared<const DirectionTable>(std::move(table));
  return std::make_shared<const ConvexPart>(cut);
}

}  // namespace clearance::exact
