// The columns of a reply, one after another.
#pragma once

#include "engine/query.h"

namespace clearance::cuda {

/// Calls f(column of a, of b, of c, entries a row) for every column that there may be.
template <class F>
void for_each_column(const ReplyView& a, const ReplyView& b, const ReplyView& c, F&& f) {
  f(a.distance, b.distance, c.distance, 1);
  f(a.lower, b.lower, c.lower, 1);
  f(a.upper, b.upper, c.upper, 1);
  f(a.status, b.status, c.status, 1);
  f(a.flags, b.flags, c.flags, 1);
  f(a.point_a, b.point_a, c.point_a, 3);
  f(a.point_b, b.point_b, c.point_b, 3);
  f(a.normal, b.normal, c.normal, 3);
  f(a.pieces, b.pieces, c.pieces, 2);
  f(a.gradient, b.gradient, c.gradient, 12);
  f(a.pair, b.pair, c.pair, 1);
  f(a.configuration, b.configuration, c.configuration, 1);
  f(a.compact, b.compact, c.compact, 1);
}

}  // namespace clearance::cuda
