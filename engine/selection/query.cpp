#include "engine/selection/query.h"

#include <cstddef>

namespace clearance {

QueryView for_pairs(QueryView query) {
  query.reduce = Reduce::kNone;
  query.margin = 0;
  query.margins = {};
  query.pair_margins = {};
  query.weights = {};
  query.speed_errors = {};
  query.growths = {};
  query.max_evaluations = 0;
  query.control_points = 2;
  query.fields = 0;
  query.configuration_count = 0;
  query.configurations = {};
  query.positions = {};
  query.velocities = query.twists = {};
  query.k = 0;
  return query;
}

ReplyView reply_view_over(std::byte* base, std::uint64_t rows, std::uint32_t fields, std::uint64_t* bytes,
                          std::uint32_t joints) {
  ReplyView view;
  view.rows = rows;
  view.joints = joints;
  std::uint64_t offset = 0;
  int position = 0;
  for_each_column(
      [&]<class Column>(Column*& column, int) {
        const int at = position++;
        if (!(fields >> at & 1)) return;
        if (base) column = reinterpret_cast<Column*>(base + offset);
        offset += (rows * field_bytes(at, joints) + kColumnAlignment - 1) / kColumnAlignment * kColumnAlignment;
      },
      view);
  if (bytes) *bytes = offset;
  return view;
}

}  // namespace clearance
