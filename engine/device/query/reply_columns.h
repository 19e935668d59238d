// Operations on all columns of a reply.
#pragma once

#include "engine/selection/query.h"

namespace clearance::cuda {

/// The view, with columns of `direct` replacing its own where set.
inline ReplyView preferring(ReplyView view, const ReplyView& direct) {
  const auto prefer = [](auto*& column, auto* other, int) {
    if (other) column = other;
  };
  for_each_column(prefer, view, direct);
  return view;
}

/// The view's columns, starting at a row.
inline ReplyView rows_from(std::uint64_t row, const ReplyView& view) {
  ReplyView from = view;
  const auto shift = [&](auto*& column, int width) {
    if (column) column += row * static_cast<std::uint64_t>(width);
  };
  for_each_column(shift, from);
  return from;
}

}  // namespace clearance::cuda
