// The columns of a reply, one after another.
#pragma once

#include "engine/query/query.h"

namespace clearance::cuda {

/// The view, with the columns of `direct` in place of its own where there are such.
inline ReplyView preferring(ReplyView view, const ReplyView& direct) {
  const auto prefer = [](auto*& column, auto* other, int) {
    if (other) column = other;
  };
  for_each_column(prefer, view, direct);
  return view;
}

}  // namespace clearance::cuda
