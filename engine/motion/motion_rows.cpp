// Converts the results of a search to rows.
#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/motion/motion_search.h"
#include "engine/narrow/group.h"

namespace clearance {

// The better of the proved lower bounds: if the search for first contact proves a motion free, its bound may be the
// better one.
const MotionSearch::Lowest& MotionSearch::lowest_of(const Goal& goal) const {
  const bool better =
      goal.unproved == kInf && goal.lowest_of_contact.pair != kNowhere && goal.lowest_of_contact.low > goal.lowest.low;
  return better ? goal.lowest_of_contact : goal.lowest;
}

// If no pair is within its margin: all are proved beyond it, or some pair is undecided or has no usable pose.
void MotionSearch::decide_any(const Goal& goal, Row& row) const {
  const Plan& plan = motion_query_.plan;
  const double low = std::max(goal.lowest.low, 0.0);
  if (goal.decided) {
    row.answer.lower = std::min(low, goal.best.upper);
    row.answer.status = decided_status(row.answer.lower, row.answer.upper);
  } else if (goal.unproved < kInf) {
    row.answer.lower = goal.unusable == kNowhere ? std::min(low, row.answer.upper) : -kInf;
    row.answer.status = Status::kUnconverged;
  } else if (goal.unusable != kNowhere) {
    take_unusable(goal, row);
  } else {
    row = {{kNone, kNone}, row.configuration, beyond_answer(std::max(low, std::nextafter(plan.margins.least(), kInf)))};
  }
}

// A pair without usable poses may be the nearest. Only a proved overlap is the least distance in any case.
void MotionSearch::decide_distance(const Goal& goal, Row& row) const {
  const bool overlaps = goal.pair != kNowhere && goal.best.upper <= 0;
  if (goal.unusable != kNowhere && !overlaps) return take_unusable(goal, row);
  decide_least(motion_query_.plan.query, lowest_of(goal).low, goal.forced, row.answer);
}

void MotionSearch::take_unusable(const Goal& goal, Row& row) const {
  row.answer = goal.unusable_answer;
  row.pair = row.pair_lower = motion_query_.plan.pairs.at(goal.unusable);
}

MotionRow MotionSearch::row_of(const Goal& goal) const {
  const Plan& plan = motion_query_.plan;
  MotionRow made;
  made.steps = steps_;
  made.free_until = goal.unusable == kNowhere ? goal.unproved : 0;
  made.hit = goal.hit;
  made.found = goal.time;
  Row& row = made.row;
  row.configuration = static_cast<std::uint32_t>(moving.motion);
  const Lowest& lowest = lowest_of(goal);
  if (goal.pair != kNowhere) {
    row = {plan.pairs.at(goal.pair), row.configuration, goal.best, goal.origin_a, goal.origin_b};
  } else {
    row.pair = lowest.pair == kNowhere ? BodyPair{kNone, kNone} : plan.pairs.at(lowest.pair);
    row.answer = beyond_answer(lowest.low);
  }
  row.pair_lower = lowest.pair == kNowhere ? row.pair : plan.pairs.at(lowest.pair);
  if (any())
    decide_any(goal, row);
  else
    decide_distance(goal, row);
  assert(!(row.answer.lower > row.answer.upper));
  assert(!any() || row.answer.status != Status::kBeyond || made.free_until == kInf);
  const bool has_witness = goal.pair != kNowhere && row.answer.status != Status::kBeyond;
  if (has_witness && !std::isnan(row.answer.distance)) made.time = goal.time;
  if (goals_.size() == 1 && goal.unusable != kNowhere) row.answer.flags |= kFlagIncomplete;
  if (moving.half_turn) row.answer.flags |= kFlagHalfTurn;
  return made;
}

void MotionSearch::append_rows(std::vector<MotionRow>& rows) const {
  assert(done_);
  if (motion_query_.plan.pairs.size() > 0) {
    for (const Goal& goal : goals_) rows.push_back(row_of(goal));
    return;
  }
  if (motion_query_.plan.query.reduce == Reduce::kNone) return;
  MotionRow none;
  none.row = {{kNone, kNone}, static_cast<std::uint32_t>(moving.motion), empty_answer(), {}, {}, {kNone, kNone}};
  none.free_until = kInf;
  rows.push_back(none);
}

// Tests the interval's width before slack is added, as for other queries.
void decide_least(const QueryView& query, double low, bool forced, PairAnswer& answer) {
  NarrowLimits limits;
  limits.max_distance = query.max_distance;
  limits.abs_tol = query.abs_tol;
  limits.rel_tol = query.rel_tol;
  const double upper = answer.upper;
  const bool overlap = upper <= 0;
  const double lower = overlap ? upper : std::clamp(low, 0.0, upper);
  const std::uint16_t kept = answer.flags;
  decide(limits, lower, upper, [] { return 0.0; }, answer);
  answer.flags = kept;
  if (answer.status != Status::kUnconverged || forced || !std::isfinite(upper)) return;
  answer.status = lower > 0 ? Status::kOk : Status::kContact;
  answer.flags |= kFlagUncertaintyLimited;
}

void write_motion_row(const ReplyView& reply, std::uint64_t at, const MotionRow& row) {
  if (reply.time) reply.time[at] = row.time;
  if (reply.first_contact) {
    reply.first_contact[2 * at] = row.free_until;
    reply.first_contact[2 * at + 1] = row.hit.time;
  }
  if (reply.steps) reply.steps[at] = row.steps;
  write_row(reply, at, row.row);
}

}  // namespace clearance
