// From answers to the caller's columns.
#pragma once

#include "evaluate.h"
#include "query.h"

namespace clearance {

/// An answer with its place: which pair, which configuration, and where the bodies' origins are.
struct Row {
  BodyPair pair;
  std::uint32_t configuration = 0;
  PairAnswer answer;
  Vec3d origin_a{0, 0, 0}, origin_b{0, 0, 0};  ///< world frame
};

/// Writes one row of every column there is.
void write_row(const ReplyView& reply, std::uint64_t index, const Row& row);

}  // namespace clearance
