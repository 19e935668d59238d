// What a configuration's answers come to: rows, once all stages are done.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "engine/narrow/group.h"
#include "engine/query/joint_gradient.h"
#include "engine/query/reduction.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

}  // namespace

Row Reduction::row_of(BodyPair pair, const PairAnswer& answer, std::uint32_t configuration,
                      const Placement& placement) const {
  Row row{pair, configuration, answer, {}, {}, pair, {}};
  if (pair.a < scene_.bodies().size()) row.origin_a = placement[pair.a].pose.t_w;
  if (pair.b < scene_.bodies().size()) row.origin_b = placement[pair.b].pose.t_w;
  if (options_.joint_gradient) {
    row.gradient_joints.resize(plan_.joints.size());
    options_.joint_gradient->write(placement, pair, answer, row.gradient_joints.data());
  }
  return row;
}

// What Reduce::kAny says: of the first pair within its margin; else of the first that is proved neither farther nor
// within; else of the first without usable poses, of which nothing is proved; else of all pairs together.
Row Reduction::decision(std::uint32_t configuration, const Placement& placement) const {
  const std::size_t none = candidates_.size();
  std::size_t open = none, unusable = none;
  for (std::size_t i = 0; i < none; ++i) {
    const PairAnswer& answer = candidate_answers_[i];
    if (decides(candidates_[i], answer)) {
      Row row = row_of(candidate_pairs_[i], answer, configuration, placement);
      row.answer.status = decided_status(answer.lower, answer.upper);
      row.answer.flags |= incomplete_[0] ? kFlagIncomplete : 0;
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
    row.answer.flags |= incomplete_[0] ? kFlagIncomplete : 0;
    return row;
  }
  // Pairs that boxes alone answer leave no bound behind, but for that they are farther than their margins.
  PairAnswer beyond =
      plan_.pairs.size() == 0 ? empty_answer() : beyond_answer(std::nextafter(plan_.margins.least(), kInf));
  if (is_any_stale()) beyond.flags |= kFlagStale;
  return row_of({kNone, kNone}, beyond, configuration, placement);
}

// Whether a pose that a pair rests on may be too old: of all pairs one with any old pose will do.
bool Reduction::is_any_stale() const {
  const std::span<const std::uint8_t> stale = options_.stale;
  if (!options_.want_flags || std::find(stale.begin(), stale.end(), 1) == stale.end()) return false;
  if (plan_.pairs.is_whole_table()) return true;
  const auto is_stale = [&](BodyPair p) { return stale[p.a] || stale[p.b]; };
  return std::any_of(plan_.pairs.list().begin(), plan_.pairs.list().end(), is_stale);
}

void Reduction::widen(Row& row, double lower, const Placement& placement) const {
  const NarrowLimits& asked = options_.limits;
  const auto slack_of = [&](BodyPair p) {
    const bool is_placed = p.a < scene_.bodies().size() && p.b < scene_.bodies().size();
    return is_placed ? pair_slack(placement, p) : Slack();
  };
  widen_to_group(row.answer, lower, asked.max_distance, asked.abs_tol, asked.rel_tol, slack_of(row.pair),
                 slack_of(row.pair_lower));
}

std::vector<Row> Reduction::rows(std::uint32_t configuration, const Placement& placement) {
  assert(stage_ == kDone);
  if (any()) return {decision(configuration, placement)};
  std::vector<Row> rows;
  if (within()) {
    for (std::size_t i = 0; i < candidates_.size(); ++i)
      if (candidate_answers_[i].status != Status::kBeyond)
        rows.push_back(row_of(candidate_pairs_[i], candidate_answers_[i], configuration, placement));
    return rows;
  }
  struct Candidates {
    Standing best, unusable;  // the winner, and the first pair without usable poses
    const PairAnswer *winner = nullptr, *first_unusable = nullptr;
    double lower = kInf;                             // the least of all
    std::uint64_t lower_place = Standing::kNowhere;  // of the first that has it
  };
  std::vector<Candidates> groups(groups_);
  // \param gap of the bodies' boxes, where it is known
  const auto offer = [&](std::uint64_t position, BodyPair pair, const PairAnswer& answer, const double* gap = nullptr) {
    const bool usable = !std::isnan(answer.distance);
    const double lower = usable && !options_.reference
                             ? lower_with_box(answer.lower, gap ? *gap : box_gap(scene_, placement, pair))
                             : answer.lower;
    const Standing standing = standing_of(answer.lower, answer.upper, position);
    for_groups(pair, [&](std::uint32_t g) {
      Candidates& group = groups[g];
      if (!usable) incomplete_[g] = 1;
      if (usable && (lower < group.lower || (lower == group.lower && position < group.lower_place))) {
        group.lower = lower;
        group.lower_place = position;
      }
      Standing& best = usable ? group.best : group.unusable;
      if (!(standing < best)) return;
      best = standing;
      (usable ? group.winner : group.first_unusable) = &answer;
    });
  };
  for (std::size_t i = 0; i < seeds_.size(); ++i) offer(seeds_[i], seed_pairs_[i], seed_answers_[i]);
  const bool know_gaps = candidate_gaps_.size() == candidates_.size();
  for (std::size_t i = 0; i < candidates_.size(); ++i)
    offer(candidates_[i], candidate_pairs_[i], candidate_answers_[i], know_gaps ? &candidate_gaps_[i] : nullptr);
  for (std::size_t g = 0; g < groups_; ++g) {
    const Candidates& group = groups[g];
    const PairAnswer* answer = group.winner ? group.winner : group.first_unusable;
    if (!answer) {
      const auto body = static_cast<std::uint32_t>(g);
      rows.push_back(row_of({per_body() ? body : kNone, kNone}, empty_answer(), configuration, placement));
      continue;
    }
    Row row = row_of(plan_.pairs.at(group.winner ? group.best.place : group.unusable.place), *answer, configuration,
                     placement);
    if (group.lower_place != Standing::kNowhere) row.pair_lower = plan_.pairs.at(group.lower_place);
    widen(row, group.lower, placement);
    assert(row.answer.lower <= row.answer.upper);
    if (incomplete_[g]) row.answer.flags |= kFlagIncomplete;
    rows.push_back(row);
  }
  return rows;
}

}  // namespace clearance
