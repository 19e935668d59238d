// Answers for a group of pairs, such as all pairs of a configuration or of a body: the pair that represents the group,
// and bounds on them all. For host and device.
#pragma once

#include "engine/narrow/answer.h"

namespace clearance {

/// Rank of a candidate in its group: the least upper bound wins. If no upper bound is finite, since boxes alone prove
/// the pairs to be beyond max_distance, the least gap wins, and then the first place.
struct CandidateRank {
  double upper = __builtin_inf();
  double gap = __builtin_inf();    ///< metres; 0 if `upper` is finite
  std::uint64_t place = kNowhere;  ///< in the query's order

  static constexpr std::uint64_t kNowhere = ~std::uint64_t{0};

  CLEARANCE_HD friend bool operator<(const CandidateRank& p, const CandidateRank& q) {
    return p.upper != q.upper ? p.upper < q.upper : p.gap != q.gap ? p.gap < q.gap : p.place < q.place;
  }
};
CLEARANCE_HD inline CandidateRank rank_of(double lower, double upper, std::uint64_t place) {
  return {upper, upper < __builtin_inf() ? 0 : lower, place};
}

/// Contribution of an answer to its group's lower bound. Far pairs are skipped by the gap of their boxes, so that an
/// evaluated pair must contribute no less than its gap, unless nothing could be proved for it.
/// \param lower of the answer
/// \param gap 0 if the boxes touch
CLEARANCE_HD inline double lower_with_box(double lower, double gap) {
  return gap > 0 && gap > lower && lower > -__builtin_inf() ? gap : lower;
}

/// Status of a pair that is proved to be within a margin: lower and upper are its bounds, upper <= margin.
CLEARANCE_HD inline Status decided_status(double lower, double upper) {
  return upper <= 0 ? Status::kOverlap : lower > 0 ? Status::kOk : Status::kContact;
}

/// Distance beyond which a pair can neither win its group nor lower the interval, if another pair has this upper bound:
/// within the tolerance such a pair has a lower bound of no less than `upper`. Metres.
CLEARANCE_HD inline double loser_beyond(double upper, const NarrowLimits& limits) {
  if (!(limits.rel_tol < 0.5)) return __builtin_inf();
  const double least = upper > 0 ? upper : 0;
  return (least + limits.abs_tol) * (1 + 4 * limits.rel_tol);
}

/// Answer for a group without pairs, as if infinitely far apart.
CLEARANCE_HD inline PairAnswer empty_answer() {
  const double infinite = __builtin_inf();
  return {infinite, infinite, infinite, Status::kBeyond, 0, kNone, kNone, no_point(), no_point(), no_point()};
}

/// Turns the winner's answer into its group's: the interval reaches down to the group's least lower bound. Infinity, of
/// pairs with clouds without points alone, is beyond every max_distance.
CLEARANCE_HD inline void widen_to_group(PairAnswer& answer, double lower, double max_distance, double abs_tol,
                                        double rel_tol) {
  if (answer.distance != answer.distance) return;  // no pair of the group has usable poses
  if (lower < answer.lower) answer.lower = lower;
  if (answer.status == Status::kOk && !is_narrow(answer.upper - answer.lower, answer.upper, abs_tol, rel_tol))
    answer.status = Status::kUnconverged;
  if (answer.status != Status::kBeyond) return;
  const bool is_beyond = answer.lower > max_distance || answer.lower == __builtin_inf();
  if (!is_beyond) answer.status = Status::kUnconverged;
  answer.distance = is_beyond ? answer.lower : answer.upper;
}

/// The same for bodies with uncertainty. The tolerance is tested without slack: width from slack alone, in the winner's
/// upper bound and in the least lower bound, is no lack of refinement.
/// \param winner slack of the winner
/// \param lowest slack of the pair with the least lower bound
CLEARANCE_HD inline void widen_to_group(PairAnswer& answer, double lower, double max_distance, double abs_tol,
                                        double rel_tol, const Slack& winner, const Slack& lowest) {
  const double slack = (winner.outer + lowest.inner) * (1 + 0x1p-30),
               size = answer.upper < 0 ? -answer.upper : answer.upper;
  const double wanted = slack > 0 && abs_tol < rel_tol * size ? rel_tol * size : abs_tol;
  widen_to_group(answer, lower, max_distance, wanted + slack, rel_tol);
  if (slack > 0 && answer.status == Status::kOk &&
      !is_narrow(answer.upper - answer.lower, answer.upper, abs_tol, rel_tol))
    answer.flags |= kFlagUncertaintyLimited;
}

}  // namespace clearance
