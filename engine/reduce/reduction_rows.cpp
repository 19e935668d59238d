// Rows of a reduction, once all stages are done.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "engine/evaluate/joint_gradient.h"
#include "engine/narrow/group.h"
#include "engine/reduce/reduction.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

}  // namespace

// Pairs rejected by their boxes leave no bound except that they are beyond their margins.
PairAnswer beyond_all_margins(const Plan& plan) {
  return plan.pairs.size() == 0 ? empty_answer() : beyond_answer(std::nextafter(plan.margins.least(), kInf));
}

Row Reduction::row_of(BodyPair pair, const PairAnswer& answer, std::uint32_t configuration,
                      const BodyPoses& placement) const {
  Row row{pair, configuration, answer, {}, {}, pair, {}, {}};
  if (pair.a < scene_.bodies().size()) row.origin_a = placement[pair.a].pose.t_w;
  if (pair.b < scene_.bodies().size()) row.origin_b = placement[pair.b].pose.t_w;
  if (options_.joint_gradient) {
    row.gradient_joints.resize(plan_.joints.size());
    options_.joint_gradient->write(placement, pair, answer, row.gradient_joints.data());
  }
  return row;
}

// The row of Reduce::kAny: the first pair within its margin; otherwise the first unresolved one; otherwise the first
// without usable poses, about which nothing is proved; otherwise one row for all pairs.
Row Reduction::decision(std::uint32_t configuration, const BodyPoses& placement) const {
  const std::size_t none = candidates_.size();
  std::size_t open = none, unusable = none;
  for (std::size_t i = 0; i < none; ++i) {
    const PairAnswer& answer = candidate_answers_[i];
    if (decides(candidates_[i], answer)) {
      Row row = row_of(candidate_pairs_[i], answer, configuration, placement);
      row.answer.status = decided_status(answer.lower, answer.upper);
      row.answer.flags |= unusable_[0] != kNoPair ? kFlagIncomplete : 0;
      return row;
    }
    if (std::isnan(answer.distance))
      unusable = std::min(unusable, i);
    else if (answer.status != Status::kBeyond)
      open = std::min(open, i);
  }
  if (const std::size_t i = std::min(open == none ? unusable : open, none); i < none) {
    Row row = row_of(candidate_pairs_[i], candidate_answers_[i], configuration, placement);
    if (i == open) row.answer.status = Status::kUnconverged;
    row.answer.flags |= unusable_[0] != kNoPair ? kFlagIncomplete : 0;
    return row;
  }
  return row_of({kNone, kNone}, beyond_all_margins(plan_), configuration, placement);
}

void Reduction::widen(Row& row, double lower, const BodyPoses& placement) const {
  const NarrowLimits& limits = options_.limits;
  const auto slack_of = [&](BodyPair p) {
    const bool is_placed = p.a < scene_.bodies().size() && p.b < scene_.bodies().size();
    return is_placed ? pair_slack(placement, p) : Slack();
  };
  widen_to_group(row.answer, lower, limits.max_distance, limits.abs_tol, limits.rel_tol, slack_of(row.pair),
                 slack_of(row.pair_lower));
}

// The row of a group with a pair without usable poses, which may be nearer than all others.
Row Reduction::unusable_row(std::uint64_t position, std::uint32_t configuration, const BodyPoses& placement) const {
  const BodyPair pair = plan_.pairs.at(position);
  Row row = row_of(pair, unusable_answer(scene_, placement, pair, options_), configuration, placement);
  row.answer.flags |= kFlagIncomplete;
  return row;
}

// The best and the lowest of each group's answers.
std::vector<Reduction::GroupResult> Reduction::group_results(const BodyPoses& placement) const {
  std::vector<GroupResult> groups(groups_);
  const auto offer = [&](std::uint64_t position, BodyPair pair, const PairAnswer& answer) {
    if (std::isnan(answer.distance)) return;  // scans found pairs without usable poses
    const double lower =
        options_.reference ? answer.lower : lower_with_box(answer.lower, box_gap(scene_, placement, pair));
    const CandidateRank rank = rank_of(answer.lower, answer.upper, position);
    for_groups(pair, [&](std::uint32_t g) {
      GroupResult& group = groups[g];
      if (lower < group.lower || (lower == group.lower && position < group.lower_place)) {
        group.lower = lower;
        group.lower_place = position;
      }
      if (!(rank < group.best)) return;
      group.best = rank;
      group.winner = &answer;
    });
  };
  for (std::size_t i = 0; i < seeds_.size(); ++i) offer(seeds_[i], seed_pairs_[i], seed_answers_[i]);
  for (std::size_t i = 0; i < candidates_.size(); ++i)
    offer(candidates_[i], candidate_pairs_[i], candidate_answers_[i]);
  return groups;
}

Row Reduction::group_row(std::uint32_t g, const GroupResult& group, std::uint32_t configuration,
                         const BodyPoses& placement) const {
  const std::uint64_t unusable = unusable_[g];
  // Only a proved overlap is the minimum regardless of pairs without usable poses.
  if (unusable != kNoPair && !(group.winner && group.winner->upper <= 0))
    return unusable_row(unusable, configuration, placement);
  if (!group.winner) return row_of({per_body() ? g : kNone, kNone}, empty_answer(), configuration, placement);
  Row row = row_of(plan_.pairs.at(group.best.place), *group.winner, configuration, placement);
  if (group.lower_place != CandidateRank::kNowhere) row.pair_lower = plan_.pairs.at(group.lower_place);
  widen(row, group.lower, placement);
  if (unusable != kNoPair) {
    row.answer.flags |= kFlagIncomplete;
    if (options_.limits.signed_distance) {  // its depth may be greater
      row.answer.lower = -kInf;
      row.pair_lower = plan_.pairs.at(unusable);
    }
  }
  assert(row.answer.lower <= row.answer.upper);
  return row;
}

void Reduction::take_rows(std::uint32_t configuration, const BodyPoses& placement, std::vector<Row>& rows) {
  assert(stage_ == kDone);
  rows.clear();
  if (any()) {
    rows.push_back(decision(configuration, placement));
  } else if (within() || each()) {
    for (std::size_t i = 0; i < candidates_.size(); ++i)
      if (each() || candidate_answers_[i].status != Status::kBeyond)
        rows.push_back(row_of(candidate_pairs_[i], candidate_answers_[i], configuration, placement));
  } else {
    const std::vector<GroupResult> groups = group_results(placement);
    for (std::uint32_t g = 0; g < groups.size(); ++g) rows.push_back(group_row(g, groups[g], configuration, placement));
  }
}

}  // namespace clearance
