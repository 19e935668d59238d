// Search of the evaluator among the elements (triangles and parts) of bodies that are not convex.
#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/evaluate/evaluate.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

}  // namespace

void Evaluator::begin_element_search(std::uint32_t index, double max_distance) {
  const PlacedBodies& bodies = pairs_[index];
  const BodyPoses& placement = *bodies.placement;
  PairSearch& search = searches_.emplace_back(PairSearch{index,
                                                         0,
                                                         std::numeric_limits<std::size_t>::max(),
                                                         0,
                                                         0,
                                                         pair_slack(placement, bodies.pair),
                                                         max_distance,
                                                         0,
                                                         {},
                                                         {}});
  if (unused_.empty()) unused_.push_back(std::make_unique<ElementSearch>());
  search.elements = std::move(unused_.back());
  unused_.pop_back();
  const Body &a = scene_.bodies()[bodies.pair.a], &b = scene_.bodies()[bodies.pair.b];
  search.elements->begin(a, placement[bodies.pair.a].pose, b, placement[bodies.pair.b].pose);
}

// Gathers the next round of a search: first the hulls and then one near pair, which guide the search.
// Returns false if the slice is over.
bool Evaluator::gather(PairSearch& search, WorkMeter& meter) {
  if (search.next == search.end) return true;
  ElementSearch& elements = *search.elements;
  const double user = search.slack.cut_off(search.max_distance), upper = search.state.upper;
  if (search.state.round == 1) {
    if (drops(search.max_distance) && elements.left() > user) return true;
    if (!elements.are_hulls_taken() && (options_.limits.signed_distance || !elements.leave_hulls())) {
      elements.begin_hulls(options_.limits.signed_distance);
      return true;
    }
    if (elements.begin_near(user)) return true;
    search.state.round = 2;
  }
  search.is_cut |= !(upper <= user);
  double cut_off = search.state.cut_off(user);
  // All pairs around a nearest vertex are equally near: leaves out those that keep the interval within half of the
  // tolerance.
  if (!options_.reference && upper > 0 && upper <= user && upper < kInf)
    cut_off =
        std::max(0.5 * upper, upper - 0.5 * tolerance_at(upper, options_.limits.abs_tol, options_.limits.rel_tol));
  return elements.gather(std::min(search.state.round, ElementSearch::kMostOfRound), cut_off, meter);
}

bool Evaluator::add_element_tasks(PairSearch& search) {
  if (search.next == search.end) return false;
  const ElementSearch& elements = *search.elements;
  const double cut_off = cut_off_of(search), near_enough = stop_below(pairs_[search.index], search.slack);
  for (std::size_t i = 0; i < elements.round().size(); ++i)
    add_task(search, cut_off, near_enough, search.elements->part_a(i), search.elements->part_b(i));
  if (search.task_count == 0) search.state.leave_out(search.elements->left());
  return search.task_count > 0;
}

// Takes the answers of hulls. Returns false if they are those of elements.
bool Evaluator::take_hulls(PairSearch& search, std::span<const NarrowAnswer> answers) {
  ElementSearch& elements = *search.elements;
  if (!elements.in_hulls() || answers.empty()) return false;
  for (const NarrowAnswer& hulls : answers) elements.see_hulls(hulls.bounds.lower, hulls.normal);
  elements.take_hulls(answers[0].bounds.lower, answers[0].normal);
  return true;
}

void Evaluator::end_element_round(PairSearch& search, std::span<const NarrowAnswer> answers) {
  PartSearch& state = search.state;
  ElementSearch& elements = *search.elements;
  const bool is_one_near = state.round == 1;  // a single pair guides the search less well than separate hulls
  state.round *= 2;
  if (state.upper > 0 && !(is_one_near && elements.hulls_are_apart()))
    elements.look_along(state.upper < kInf ? search.found.best.normal : answers[0].normal);
  elements.end_round();
}

}  // namespace clearance
