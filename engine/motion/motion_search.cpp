// The order of a search: which span is evaluated next, when pairs leave, and when the search ends.
#include "engine/motion/motion_search.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "engine/narrow/group.h"

namespace clearance {

namespace {

bool is_less_promising(const MotionSearch::Node& p, const MotionSearch::Node& q) {
  return p.least != q.least ? p.least > q.least : p.begin > q.begin;
}

}  // namespace

void MotionSearch::begin(std::span<const OpenPair> open) {
  const bool each = motion_query_.plan.query.reduce == Reduce::kNone;
  goals_.assign(each ? motion_query_.plan.pairs.size() : 1, Goal{});
  spans_.clear();
  under_way_ = 0;
  steps_ = 0;
  evaluated_ = 0;
  seeded_ = false;
  done_ = motion_query_.plan.pairs.size() == 0;
  seeks_contact_ = any() && wants_contact();
  if (done_) return;
  if (open.empty())
    open_all();
  else
    open_some(open);
}

void MotionSearch::open_all() {
  Node root;
  root.open.resize(motion_query_.plan.pairs.size());
  std::iota(root.open.begin(), root.open.end(), std::uint64_t{0});
  root.low.assign(root.open.size(), 0);
  push(std::move(root));
}

// All begin together, in the time that holds theirs, since placing the bodies costs as much as many pairs.
void MotionSearch::open_some(std::span<const OpenPair> open) {
  double begin = 1, end = 0;
  for (const OpenPair& pair : open) {
    begin = std::min(begin, pair.begin);
    end = std::max(end, pair.end);
  }
  Node root;
  root.begin = begin;
  root.end = end;
  for (const OpenPair& pair : open) root.open.push_back(pair.position);
  root.low.assign(root.open.size(), 0);
  push(std::move(root));
}

// Restarts the search from the motion's beginning, when the least distance is known but first contact is not. Returns
// false if first contact is known or not requested.
bool MotionSearch::seek_contact() {
  if (seeks_contact_ || !wants_contact() || steps_ >= motion_query_.plan.query.max_evaluations) return false;
  Node root;
  for (std::uint64_t i = 0; i < motion_query_.plan.pairs.size(); ++i)
    if (goal_of(i).unproved < kInf) root.open.push_back(i);
  if (root.open.empty()) return false;
  root.low.assign(root.open.size(), 0);
  for (Goal& goal : goals_) goal.unproved = kInf;
  seeks_contact_ = true;
  push(std::move(root));
  return true;
}

void MotionSearch::push(Node&& node) {
  node.least = seeks_contact_ ? node.begin : *std::min_element(node.low.begin(), node.low.end());
  spans_.push_back(std::move(node));
  std::push_heap(spans_.begin(), spans_.end(), is_less_promising);
}

// Lower bound at which a pair leaves. For the least distance, it keeps the interval within tolerance, apart from slack.
double MotionSearch::target_of(std::uint64_t position, const Goal& goal, double slack) const {
  if (decides()) return motion_query_.plan.margins.of(position);
  const QueryView& query = motion_query_.plan.query;
  if (goal.pair == kNowhere) return query.max_distance;
  const double required_distance =
      required_distance_for(goal.best.upper, query.abs_tol, query.rel_tol, goal.slack, slack);
  return std::min(query.max_distance, std::max(required_distance, 0.0));
}

// Lower bound at which a pair leaves while its margin decides: the margin or, after a time that is unproved, the bound
// that excludes a contact. Both slacks separate the two.
double MotionSearch::target_of_margin(std::uint64_t position, const Goal& goal, const Node& node,
                                      const Slack& slack) const {
  const double margin = motion_query_.plan.margins.of(position);
  if (!seeks_contact_ || !(goal.unproved <= node.begin)) return margin;
  return difference_below(difference_below(margin, slack.inner), slack.outer);
}

void MotionSearch::leave(Goal& goal, std::uint64_t position, double low, double begin) {
  Lowest& lowest = seeks_contact_ && !any() ? goal.lowest_of_contact : goal.lowest;
  if (low < lowest.low || (low == lowest.low && position < lowest.pair)) lowest = {low, position};
  if (!(low > motion_query_.plan.margins.of(position))) goal.unproved = std::min(goal.unproved, begin);
}

bool MotionSearch::next(Node& node) {
  while (!done_ && may_request()) {
    std::pop_heap(spans_.begin(), spans_.end(), is_less_promising);
    node = std::move(spans_.back());
    spans_.pop_back();
    std::size_t kept = 0;
    for (std::size_t i = 0; i < node.open.size(); ++i) {
      Goal& goal = goal_of(node.open[i]);
      const bool is_late = seeks_contact_ && begins_late(node.begin, goal.hit.time);
      if (is_late || node.low[i] > target_of(node.open[i], goal, 0) || has_converged(goal)) {
        leave(goal, node.open[i], node.low[i], node.begin);
        continue;
      }
      node.open[kept] = node.open[i];
      node.low[kept++] = node.low[i];
    }
    node.open.resize(kept);
    node.low.resize(kept);
    if (kept == 0) continue;
    if (!std::exchange(node.has_steps, true)) {
      ++steps_;
      node.at = is_curved() ? middle_of_length(moving.curves, node.begin, node.end) : 0.5 * node.begin + 0.5 * node.end;
    }
    ++under_way_;
    return true;
  }
  end_if_done();
  return !done_ && may_request() && under_way_ == 0 && next(node);  // another search has begun
}

void MotionSearch::end_if_done() {
  if (done_ || under_way_ > 0) return;
  const bool converged =
      std::all_of(goals_.begin(), goals_.end(), [&](const Goal& goal) { return has_converged(goal); });
  if (!converged && may_request()) return;
  give_up();
  done_ = !seek_contact();
}

// Removes all remaining pairs with their present bounds.
void MotionSearch::give_up() {
  for (const Node& node : spans_)
    for (std::size_t i = 0; i < node.open.size(); ++i) {
      Goal& goal = goal_of(node.open[i]);
      if (!decides()) goal.forced |= !goal.decided && !is_proved(node.low[i], target_of(node.open[i], goal, 0));
      leave(goal, node.open[i], node.low[i], node.begin);
    }
  spans_.clear();
}

}  // namespace clearance
