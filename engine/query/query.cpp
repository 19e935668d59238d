#include "engine/query/query.h"

#include <cstddef>

namespace clearance {

ReplyView reply_view_over(std::byte* base, std::uint64_t rows, std::uint32_t fields, std::uint64_t* bytes) {
  ReplyView view;
  view.rows = rows;
  std::uint64_t offset = 0;
  const auto place = [&]<class Column>(Field field, int position, Column*& column) {
    if (!(fields & field)) return;
    if (base) column = reinterpret_cast<Column*>(base + offset);
    offset += (rows * kFieldBytes[position] + kColumnAlignment - 1) / kColumnAlignment * kColumnAlignment;
  };
  place(kFieldDistance, 0, view.distance);
  place(kFieldLower, 1, view.lower);
  place(kFieldUpper, 2, view.upper);
  place(kFieldStatus, 3, view.status);
  place(kFieldFlags, 4, view.flags);
  place(kFieldPointA, 5, view.point_a);
  place(kFieldPointB, 6, view.point_b);
  place(kFieldNormal, 7, view.normal);
  place(kFieldPieces, 8, view.pieces);
  place(kFieldGradient, 9, view.gradient);
  place(kFieldPair, 10, view.pair);
  place(kFieldConfiguration, 11, view.configuration);
  place(kFieldCompact, 12, view.compact);
  if (bytes) *bytes = offset;
  return view;
}

}  // namespace clearance
