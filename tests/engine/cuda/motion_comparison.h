// Compares a device's rows of motions with the CPU's. Both are valid, but may name different pairs and times.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/motion/motion_step.h"
#include "tests/engine/motion/motion_test.h"

namespace clearance::test {

struct MotionComparison {
  int free = 0, hits = 0, undecided = 0;
  int beyond_limits = 0;  ///< rows that report it for the same pair
};

/// Checks that hold for every row. Returns whether both rows are decided, and counts ours if it is not.
inline bool is_decided(const ReplyView& ours, const ReplyView& theirs, std::uint32_t i, int& undecided) {
  EXPECT_EQ(ours.configuration[i], i);
  EXPECT_LE(ours.lower[i], ours.upper[i]) << i;
  EXPECT_GT(ours.steps[i], 0u) << i;
  const bool is_open = static_cast<Status>(ours.status[i]) == Status::kUnconverged;
  undecided += is_open;
  return !is_open && static_cast<Status>(theirs.status[i]) != Status::kUnconverged;
}

/// Whether both rows are of the same pair and report it beyond the limits. Rows of one pair must agree.
inline bool reports_limits(const ReplyView& ours, const ReplyView& theirs, std::uint32_t i) {
  if (ours.pair[i].a != theirs.pair[i].a || ours.pair[i].b != theirs.pair[i].b) return false;
  EXPECT_EQ(ours.flags[i] & kFlagBeyondLimits, theirs.flags[i] & kFlagBeyondLimits) << i;
  return (ours.flags[i] & kFlagBeyondLimits) != 0;
}

/// Both intervals [free until, hit at] contain the time of first contact.
inline void expect_same_contact(const double* ours, const double* theirs, std::uint32_t motion) {
  EXPECT_LE(ours[0], ours[1]) << motion;
  EXPECT_LE(ours[0], theirs[1]) << motion;
  EXPECT_LE(theirs[0], ours[1]) << motion;
}

/// Rows of reduce any for the same query.
inline MotionComparison compare_motions(const Answer& found, const Answer& wanted, const QueryView& q) {
  MotionComparison v;
  const ReplyView &ours = found.view, &theirs = wanted.view;
  for (std::uint32_t i = 0; i < found.info.rows; ++i) {
    if (!is_decided(ours, theirs, i, v.undecided)) continue;
    const auto status = static_cast<Status>(ours.status[i]), wanted_status = static_cast<Status>(theirs.status[i]);
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
      v.beyond_limits += reports_limits(ours, theirs, i);
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

struct LeastRows {
  int apart = 0, touching = 0, undecided = 0, hits = 0;
};

/// An interval of the least distance is as narrow as requested. The arm's slack, a tenth of that, may come on top and
/// must be flagged.
inline void expect_narrow(double lower, double upper, std::uint16_t flags, const QueryView& q, std::uint32_t motion) {
  EXPECT_LE(upper - lower, q.abs_tol * (flags & kFlagUncertaintyLimited ? 1.3 : 1 + 1e-9)) << motion;
}

/// Rows of the least distance for the same query: intervals that intersect, as narrow as requested, with the same free
/// range.
inline LeastRows compare_least(const Answer& found, const Answer& wanted, const QueryView& q) {
  LeastRows v;
  const ReplyView &ours = found.view, &theirs = wanted.view;
  for (std::uint32_t i = 0; i < found.info.rows; ++i) {
    EXPECT_LE(ours.lower[i], theirs.upper[i]) << i;
    EXPECT_LE(theirs.lower[i], ours.upper[i]) << i;
    if (!is_decided(ours, theirs, i, v.undecided)) continue;
    expect_narrow(ours.lower[i], ours.upper[i], ours.flags[i], q, i);
    EXPECT_TRUE(ours.time[i] >= 0 && ours.time[i] <= 1) << i;
    EXPECT_LT(ours.pair[i].a, kNone) << i;
    ++(static_cast<Status>(ours.status[i]) == Status::kOk ? v.apart : v.touching);
    reports_limits(ours, theirs, i);
    if (!ours.first_contact) continue;
    const double *const contact = ours.first_contact + 2 * i, *const wanted_contact = theirs.first_contact + 2 * i;
    expect_same_contact(contact, wanted_contact, i);
    const bool hits = contact[1] < kInf, wanted_hits = wanted_contact[1] < kInf;
    v.hits += hits;
    EXPECT_EQ(hits, contact[0] < kInf) << i;
    if (wanted_hits || std::isinf(wanted_contact[0])) {
      EXPECT_EQ(hits, wanted_hits) << i;
    }
    if (hits) {
      EXPECT_LE(contact[1] - contact[0], std::max(kContactTime, wanted_contact[1] - wanted_contact[0])) << i;
    }
    if (hits && ours.upper[i] > q.margin) ADD_FAILURE() << i << ": nothing is so near";
  }
  return v;
}

}  // namespace clearance::test
