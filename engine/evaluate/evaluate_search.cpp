// Search of the evaluator for the nearest of two bodies' part pairs.
#include <algorithm>
#include <cassert>
#include <cmath>

#include "engine/evaluate/evaluate.h"
#include "engine/hull/primitive.h"
#include "engine/narrow/certify.h"
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
  double least = kInf;               // gap of the nearest within the cut-off
  std::size_t nearest = begin;
  for (std::uint32_t i = 0; i < boxes_a.size(); ++i)
    for (std::uint32_t j = 0; j < boxes_b.size(); ++j) {
      const PartPair p{certify_box_gap(boxes_a[i], boxes_b[j]), i, j};
      if (!(p.gap > cut_off)) {
        nearest = p.gap < least ? part_pairs_.size() : nearest;
        least = std::min(least, p.gap);
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
    std::swap(part_pairs_[begin], part_pairs_[nearest]);
  } else if (drops(bodies.max_distance) && far.gap > loser_beyond(cut_off, options_.limits)) {
    return replace_answer(answers_[index], beyond_answer(slack.true_lower(far.gap)));
  } else {
    part_pairs_.push_back(far);
  }
  PairSearch& search = searches_.emplace_back();  // members set in place: a copy takes longer than the boxes
  search.index = index;
  search.next = begin;
  search.end = part_pairs_.size();
  search.sorted = begin + 1;
  search.slack = slack;
  search.max_distance = bodies.max_distance;
  search.state.lower = left;
  if (options_.reference) search.state.round = search.end - begin;  // all at once
}

// Combines the searched part pairs into the answer of their bodies.
void Evaluator::finish_search(PairSearch& search, WorkMeter& meter) {
  const PlacedBodies& bodies = pairs_[search.index];
  BodiesAnswer& found = search.found;
  found.lower = search.state.lower;
  const bool by_elements = search.elements != nullptr;
  if (is_searched_again(search)) {
    again_.push_back(search.index);
    unused_.push_back(std::move(search.elements));
    return;
  }
  if (by_elements) {
    take_containment(search, meter);
    const ElementSearch::HullsGap hulls = search.elements->hulls_gap();
    unused_.push_back(std::move(search.elements));
    // A shift that separates the hulls separates the bodies within.
    if (options_.limits.signed_distance && search.slack.true_lower(found.lower) <= 0) {
      found.lower = hulls.lower;
      found.best.normal = hulls.normal;
    }
  }
  PairAnswer& answer = answers_[search.index];
  const double true_lower = search.slack.true_lower(found.lower);
  const bool has_upper = found.best.bounds.upper < kInf;
  if (by_elements && !has_upper && true_lower > search.max_distance)
    return replace_answer(answer, beyond_answer(true_lower));
  finish(bodies, search.max_distance, found, answer);
}

// Whether a gap beyond max_distance suffices to answer a pair.
bool Evaluator::drops(double max_distance) const {
  return options_.drops_beyond || max_distance < options_.limits.max_distance;
}

// Whether the bits of a pair's interval matter, but may depend on the nearer pairs that were evaluated before: a cloud
// has elements that are equally near, and a cut-off changes their order.
bool Evaluator::is_searched_again(const PairSearch& search) const {
  const PlacedBodies& bodies = pairs_[search.index];
  if (!search.is_cut || !(search.max_distance < bodies.max_distance_alone) || options_.reference) return false;
  return (is_cloud(scene_.bodies()[bodies.pair.a]) || is_cloud(scene_.bodies()[bodies.pair.b])) &&
         !(search.slack.true_lower(search.state.lower) > search.max_distance);
}

// Sorts the part pairs of the next round, since most searches end after a few. The nearest beyond the cut-off comes
// after those within; the others beyond are never requested, because cut-offs only fall.
void Evaluator::sort_ahead(PairSearch& search, double cut_off) {
  const std::size_t wanted = std::min(search.next + search.state.round, search.end);
  if (wanted <= search.sorted) return;
  const auto at = [&](std::size_t i) { return part_pairs_.begin() + static_cast<std::ptrdiff_t>(i); };
  const auto before = [](const PartPair& p, const PartPair& q) { return goes_before(p, q); };  // inlined
  const auto is_within = [&](const PartPair& p) { return search.state.belongs_to_round(p.gap, cut_off); };
  const auto beyond = std::partition(at(search.sorted), at(search.end), is_within);
  const auto within = static_cast<std::size_t>(beyond - part_pairs_.begin());
  const std::size_t to = std::min(within, std::max(wanted, search.sorted + kSortedAtOnce));
  if (to < within) std::nth_element(at(search.sorted), at(to), beyond, before);
  std::sort(at(search.sorted), at(to), before);
  search.sorted = to;
  if (to < within || within == search.end) return;
  std::iter_swap(beyond, std::min_element(beyond, at(search.end), before));
  ++search.sorted;
}

// Adds the next round to tasks_, after those of single parts. Returns false if no part pair is left.
bool Evaluator::add_tasks(PairSearch& search) {
  const PlacedBodies& bodies = pairs_[search.index];
  search.task_count = 0;
  search.min_penetration = search.slack.outer;
  if (search.elements) return add_element_tasks(search);
  const Body &a = scene_.bodies()[bodies.pair.a], &b = scene_.bodies()[bodies.pair.b];
  PartSearch& state = search.state;
  const double cut_off = cut_off_of(search), near_enough = stop_below(bodies, search.slack);
  while (search.task_count == 0 && search.next < search.end) {
    sort_ahead(search, options_.reference ? kInf : cut_off);
    const std::size_t most = std::min(search.next + state.round, search.end);
    std::size_t end = search.next;
    while (end < most && (options_.reference || state.belongs_to_round(part_pairs_[end].gap, cut_off))) ++end;
    if (end == search.next) {
      state.leave_out(part_pairs_[end].gap);
      return false;
    }
    // Every pair counts if the search may stop early, or if all bounds that it finds are beyond max_distance.
    const bool may_drop = state.round > 1 && state.upper <= cut_off && near_enough == -kInf;
    if (may_drop && !options_.reference) drop_losers(search, end, cut_off);
    for (std::size_t i = search.next; i < end; ++i)
      add_task(search, cut_off, near_enough, *a.parts[part_pairs_[i].a], *b.parts[part_pairs_[i].b]);
    if (search.task_count == 0) state.round *= 2;
  }
  return search.task_count > 0;
}

// Takes part pairs of a round that end at `end` out of it, and moves the others back, if their boxes in the bodies' own
// axes prove that they change neither end of the interval.
void Evaluator::drop_losers(PairSearch& search, std::size_t end, double cut_off) {
  const double far = loser_beyond(cut_off, options_.limits);
  if (!(far < kInf)) return;
  const BodyPair pair = pairs_[search.index].pair;
  const Body &a = scene_.bodies()[pair.a], &b = scene_.bodies()[pair.b];
  const BodyPoses& placement = *pairs_[search.index].placement;
  const PoseMatrix &pose_a = placement[pair.a].pose, &pose_b = placement[pair.b].pose;
  const Mat3d R = pose_a.R_wb.transpose_times(pose_b.R_wb);
  const Vec3d D = pose_a.R_wb.transpose_times(pose_b.t_w - pose_a.t_w);
  std::size_t kept = end;
  for (std::size_t i = end; i-- > search.next;) {
    const PartPair p = part_pairs_[i];
    const ConvexPart &part_a = *a.parts[p.a], &part_b = *b.parts[p.b];
    if (is_half_space(part_a) || is_half_space(part_b) || !(certify_parts_gap(part_a, part_b, R, D, far) > far))
      part_pairs_[--kept] = p;
  }
  search.next = kept;
}

double Evaluator::cut_off_of(const PairSearch& search) const {
  const double user = search.slack.cut_off(search.max_distance);
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
  if (elements && take_hulls(search, answers)) return;
  PartSearch& state = search.state;
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
    const double upper = search.slack.true_upper(state.upper);
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
