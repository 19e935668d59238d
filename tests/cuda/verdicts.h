// Rows of motions by a device beside the CPU's. Both are true, but may name other pairs and other times.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/motion/motion_step.h"
#include "tests/motion/motion_test.h"

namespace clearance::test {

struct Verdicts {
  int free = 0, hits = 0, undecided = 0;
  int beyond_limits = 0;  ///< rows that say so of the same pair
};

/// Both hold the time of first contact: intervals [free until, hit at].
inline void expect_same_contact(const double* ours, const double* theirs, std::uint32_t motion) {
  EXPECT_LE(ours[0], ours[1]) << motion;
  EXPECT_LE(ours[0], theirs[1]) << motion;
  EXPECT_LE(theirs[0], ours[1]) << motion;
}

/// Rows of reduce any, for the same query.
inline Verdicts compare_verdicts(const Answer& found, const Answer& wanted, const QueryView& q) {
  Verdicts v;
  const ReplyView &ours = found.view, &theirs = wanted.view;
  for (std::uint32_t i = 0; i < found.info.rows; ++i) {
    const auto status = static_cast<Status>(ours.status[i]), wanted_status = static_cast<Status>(theirs.status[i]);
    EXPECT_EQ(ours.configuration[i], i);
    EXPECT_LE(ours.lower[i], ours.upper[i]) << i;
    EXPECT_GT(ours.steps[i], 0u) << i;
    v.undecided += status == Status::kUnconverged;
    if (status == Status::kUnconverged || wanted_status == Status::kUnconverged) continue;
    const bool is_free = status == Status::kBeyond;
    EXPECT_EQ(is_free, wanted_status == Status::kBeyond) << i;
    if (is_free) {
      ++v.free;
      EXPECT_GT(ours.lower[i], q.margin) << i;
      EXPECT_EQ(ours.pair[i].a, kNone) << i;
      EXPECT_TRUE(std::isnan(ours.time[i])) << i;
      EXPECT_EQ(ours.flags[i], theirs.flags[i]) << i;
    } else {
      ++v.hits;
      EXPECT_LE(ours.upper[i], q.margin) << i;
      EXPECT_LE(ours.lower[i], theirs.upper[i]) << i;
      EXPECT_TRUE(ours.time[i] >= 0 && ours.time[i] <= 1) << i;
      if (ours.pair[i].a == theirs.pair[i].a && ours.pair[i].b == theirs.pair[i].b) {
        EXPECT_EQ(ours.flags[i] & kFlagBeyondLimits, theirs.flags[i] & kFlagBeyondLimits) << i;
        v.beyond_limits += (ours.flags[i] & kFlagBeyondLimits) != 0;
      }
    }
    if (!ours.first_contact) continue;
    const double *const contact = ours.first_contact + 2 * i, *const wanted_contact = theirs.first_contact + 2 * i;
    EXPECT_EQ(is_free, std::isinf(contact[0])) << i;
    EXPECT_EQ(is_free, std::isinf(contact[1])) << i;
    expect_same_contact(contact, wanted_contact, i);
    if (!is_free) {
      EXPECT_EQ(contact[1], ours.time[i]) << i;
      EXPECT_LE(contact[1] - contact[0], std::max(kContactTime, wanted_contact[1] - wanted_contact[0])) << i;
    }
  }
  return v;
}

}  // namespace clearance::test
