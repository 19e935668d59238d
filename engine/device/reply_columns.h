// The columns of a reply, one after another.
#pragma once

#include "engine/query/query.h"

namespace clearance::cuda {

/// Calls f(column of each view..., entries a row) for every column that there may be. Views may be const.
template <class F, class... View>
void for_each_column(F&& f, View&... view) {
  f(view.distance..., 1);
  f(view.lower..., 1);
  f(view.upper..., 1);
  f(view.status..., 1);
  f(view.flags..., 1);
  f(view.point_a..., 3);
  f(view.point_b..., 3);
  f(view.normal..., 3);
  f(view.pieces..., 2);
  f(view.gradient..., 12);
  f(view.pair..., 1);
  f(view.configuration..., 1);
  f(view.compact..., 1);
}

/// The view, with the columns of `direct` in place of its own where there are such.
inline ReplyView preferring(ReplyView view, const ReplyView& direct) {
  const auto prefer = [](auto*& column, auto* other, int) {
    if (other) column = other;
  };
  for_each_column(prefer, view, direct);
  return view;
}

}  // namespace clearance::cuda
