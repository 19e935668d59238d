// Search of the evaluator for the nearest of two bodies' part pairs.
#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/evaluate/evaluate.h"
#include "engine/narrow/group.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr std::size_t kBoxesPerUnit = 16;   // comparisons of boxes
constexpr std::size_t kSortedAtOnce = 256;  // part pairs

}  // namespace

// Lists the part pairs within the cut-off; beyond it only the nearest, if there is no other.
void Evaluator::begin_search(const PlacedBodies& bodies, std::uint32_t index, WorkMeter& meter) {
  const std::size_t begin = part_pairs_.size();
  const std::span<const Aabb> boxes_a = boxes_.at(*bodies.placement, bodies.pair.a),
                              boxes_b = boxes_.at(*bodies.placement, bodies.pair.b);
  const Slack slack = pair_slack(*bodies.placement, bodies.pair);
  const double cut_off = options_.reference ? kInf : slack.cut_off(bodies.max_distance);
  PartPair far{kInf, kNone, kNone};  // the nearest beyond the cut-off
  double left = kInf;                // the gap of the next one
  for (std::uint32_t i = 0; i < boxes_a.size(); ++i)
    for (std::uint32_t j = 0; j < boxes_b.size(); ++j) {
      const PartPair p{certify_box_gap(boxes_a[i], boxes_b[j]), i, j};
      if (!(p.gap > cut_off)) {
        part_pairs_.push_back(p);
      } else if (goes_before(p, far)) {
        left = far.gap;
        far = p;
      } else {
        left = std::min(left, p.gap);
      }
    }
  meter.count(boxes_a.size() * boxes_b.size() / kBoxesPerUnit);
  if (part_pairs_.size() > begin) {
    left = far.gap;
  } else if (drops(far.gap, bodies) &&
             !(is_by_parts(bodies.pair) && box_gap(scene_, *bodies.placement, bodies.pair) <= 0)) {
    return replace_answer(answers_[index], beyond_answer(slack.true_lower(far.gap)));
  } else {
    part_pairs_.push_back(far);
  }
  searches_.push_back({index, begin, part_pairs_.size(), begin, 0, slack, 0, {}, {}});
  PartSearch& state = searches_.back().state;
  state.lower = left;
  if (options_.reference) state.round = part_pairs_.size() - begin;  // all at once
}

// Combines the searched part pairs into the answer of their bodies.
void Evaluator::finish_search(PairSearch& search, WorkMeter& meter) {
  const PlacedBodies& bodies = pairs_[search.index];
  BodiesAnswer& found = search.found;
  found.lower = search.state.lower;
  const bool by_elements = search.elements != nullptr, by_parts = is_by_parts(bodies.pair);
  const bool held = (by_elements || by_parts) && finds_containment(search, meter);
  if (by_elements) {
    const ElementSearch::HullsGap hulls = search.elements->hulls_gap();
    unused_.push_back(std::move(search.elements));
    // A shift that separates the hulls separates the bodies within.
    if (options_.limits.signed_distance && search.slack.true_lower(found.lower) <= 0 && !(held && by_parts)) {
      found.lower = hulls.lower;
      found.best.normal = hulls.normal;
    }
  }
  PairAnswer& answer = answers_[search.index];
  const double true_lower = search.slack.true_lower(found.lower);
  const bool has_upper = found.best.bounds.upper < kInf;
  if (by_elements && !has_upper && true_lower > bodies.max_distance)
    return replace_answer(answer, beyond_answer(true_lower));
  finish(bodies, found, answer, !by_parts ? Overlap::kExact : held ? Overlap::kContained : Overlap::kOfProxies);
}

// Whether the gap of its boxes suffices to answer a pair.
bool Evaluator::drops(double gap, const PlacedBodies& bodies) const {
  const NarrowLimits& limits = options_.limits;
  return (options_.drops_beyond || bodies.max_distance < limits.max_distance) &&
         gap > loser_beyond(pair_slack(*bodies.placement, bodies.pair).cut_off(bodies.max_distance), limits);
}

// Sorts the part pairs of the next round. The rest need only come later, because most searches end after a few.
void Evaluator::sort_ahead(PairSearch& search) {
  const std::size_t wanted = std::min(search.next + search.state.round, search.end);
  if (wanted <= search.sorted) return;
  const auto at = [&](std::size_t i) { return part_pairs_.begin() + static_cast<std::ptrdiff_t>(i); };
  const std::size_t to = std::min(search.end, std::max(wanted, search.sorted + kSortedAtOnce));
  if (to < search.end) std::nth_element(at(search.sorted), at(to), at(search.end), goes_before);
  std::sort(at(search.sorted), at(to), goes_before);
  search.sorted = to;
}

// Adds the next round to tasks_, after those of single parts. Returns false if no part pair is left.
bool Evaluator::add_tasks(PairSearch& search) {
  const PlacedBodies& bodies = pairs_[search.index];
  search.task_count = 0;
  search.min_penetration = is_by_parts(bodies.pair) ? 0 : search.slack.outer;
  if (search.elements) return add_element_tasks(search);
  const Body &a = scene_.bodies()[bodies.pair.a], &b = scene_.bodies()[bodies.pair.b];
  PartSearch& state = search.state;
  const double cut_off = cut_off_of(search), near_enough = stop_below(bodies, search.slack);
  sort_ahead(search);
  for (std::size_t i = search.next; i < search.end && search.task_count < state.round; ++i) {
    const PartPair& p = part_pairs_[i];
    if (!options_.reference && !state.belongs_to_round(p.gap, cut_off)) break;
    add_task(search, cut_off, near_enough, *a.parts[p.a], *b.parts[p.b]);
  }
  if (search.task_count == 0 && search.next < search.end) state.leave_out(part_pairs_[search.next].gap);
  return search.task_count > 0;
}

double Evaluator::cut_off_of(const PairSearch& search) const {
  const double user = search.slack.cut_off(pairs_[search.index].max_distance);
  return options_.reference ? user : search.state.cut_off(user);
}

void Evaluator::add_task(PairSearch& search, double cut_off, double stop_below, const ConvexPart& a,
                         const ConvexPart& b) {
  const PlacedBodies& bodies = pairs_[search.index];
  tasks_.push_back({&a, &b, &(*bodies.placement)[bodies.pair.a].pose, &(*bodies.placement)[bodies.pair.b].pose, cut_off,
                    static_cast<std::uint32_t>(tasks_.size() - singles_), search.min_penetration, stop_below});
  ++search.task_count;
}

// Takes the answers of a round.
void Evaluator::take_round(PairSearch& search, double stop_below, std::span<const NarrowAnswer> answers) {
  assert(search.next + answers.size() <= search.end);
  ElementSearch* const elements = search.elements.get();
  if (elements && take_hulls_or_proxies(search, answers)) return;
  PartSearch& state = search.state;
  const bool by_parts = is_by_parts(pairs_[search.index].pair);
  const auto pair_at = [&](std::size_t k) -> ElementPair {
    if (elements) return elements->round()[k];
    const PartPair& p = part_pairs_[search.next + k];
    return {p.gap, {p.a, kNone}, {p.b, kNone}};
  };
  for (std::size_t k = 0; k < answers.size(); ++k) {
    const NarrowAnswer& answer = answers[k];
    const ElementPair p = pair_at(k);
    if (!options_.reference && state.ends_before(p.gap)) {
      state.leave_out(p.gap);
      search.next = search.end;
      return;
    }
    if (state.take(p.gap, answer.bounds.lower, answer.bounds.upper)) {
      search.found.best = answer;
      search.found.a = p.a;
      search.found.b = p.b;
    }
    const bool wants_depth = options_.limits.signed_distance && !elements;
    const double upper = by_parts ? state.upper : search.slack.true_upper(state.upper);
    if (!wants_depth && upper <= 0) {  // the bodies overlap, and no depth is requested
      search.next = search.end;
      return;
    }
    const bool is_last = !elements && search.next + k + 1 == search.end;
    if (!options_.reference && state.upper <= stop_below && !is_last) {  // near enough
      state.leave_out(p.gap);
      search.next = search.end;
      return;
    }
  }
  if (elements) return end_element_round(search, answers);
  state.round *= 2;
  search.next += answers.size();
}

}  // namespace clearance
