// One span of a search: the pairs evaluated at a time in it, and what their answers prove on both sides.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "engine/motion/motion_search.h"

namespace clearance {

namespace {

constexpr double kLeastHalf = 0x1p-40;  // shortest half of a span

}  // namespace

PairAnswer grown_answer(PairAnswer answer, const PairGrowth& growth) {
  if (!growth.any() || std::isnan(answer.distance)) return answer;
  answer.lower = std::max(difference_below(answer.lower, growth.most), std::min(answer.lower, 0.0));
  answer.upper = std::max(sum_above(answer.upper, -growth.least), 0.0);
  if (answer.status == Status::kBeyond) {
    answer.distance = answer.lower;
    return answer;
  }
  answer.distance = answer.upper > 0 ? answer.upper : answer.lower;
  if (answer.upper <= 0)
    answer.status = Status::kOverlap;
  else if (answer.status == Status::kOk && answer.lower <= 0)
    answer.status = Status::kContact;
  return answer;
}

void MotionSearch::collect_pairs(Node& node, const Moment& moment, std::vector<PlacedBodies>& to_evaluate,
                                 std::vector<PairRequest>& requests) {
  const BodyPoses& placed = moment.placed;
  motion_query_.bounds.take_sides(node.begin, node.at, node.end, moving);
  for (int side = 0; is_curved() && side < 2; ++side) node.pace[side] = moving.sides.pace(side);
  // Without a first bound on the least distance all pairs would be evaluated in full, so one goes first.
  const PairList& pairs = motion_query_.plan.pairs;
  const bool seeds = motion_query_.plan.query.reduce == Reduce::kMin && !std::exchange(seeded_, true);
  const std::size_t seed = seeds ? nearest_of(node, placed) : node.open.size();
  node.seeds = seed < node.open.size();
  const auto request_about = [&](BodyPair pair, const PairRequest& q) {
    const double stop_below = decides() ? motion_query_.plan.margins.of(node.open[q.open]) : -kInf;
    to_evaluate.push_back(
        {pair, &placed, sum_above(sum_above(q.target, q.way), q.growth.most), stop_below + q.growth.least});
    requests.push_back(q);
  };
  if (node.seeds) {
    const BodyPair pair = pairs.at(node.open[seed]);
    return request_about(pair, request_for(seed, node, pair, placed));
  }
  motion_query_.bounds.speeds(moving, placed, speeds_);
  for (std::size_t i = 0; i < node.open.size(); ++i) {
    const BodyPair pair = pairs.at(node.open[i]);
    const bool usable = !is_unusable(motion_query_.scene, placed, pair);
    if (usable && leaves_by_boxes(i, node, pair, placed)) continue;
    const PairRequest request = request_for(i, node, pair, placed);
    if (!usable || !leaves_along_boxes(request, node, pair, moment)) request_about(pair, request);
  }
}

// Most pairs are so far apart that neither their path nor their uncertainty matters.
bool MotionSearch::leaves_by_boxes(std::size_t i, const Node& node, BodyPair pair, const BodyPoses& placed) {
  const auto speed = [&](std::uint32_t body) {
    const std::uint32_t slot = motion_query_.bounds.slot(body);
    return slot == kNone ? 0 : speeds_[slot];
  };
  Goal& goal = goal_of(node.open[i]);
  const double gap = difference_below(box_gap(motion_query_.scene, placed, pair),
                                      motion_query_.bounds.growth(pair, moving, node.at).most),
               low = difference_below(gap, sum_above(speed(pair.a), speed(pair.b)) * reach_of(node) * (1 + 0x1p-50));
  if (!(low > target_of(node.open[i], goal, 0))) return false;
  leave(goal, node.open[i], std::max(low, node.low[i]), node.begin);
  return true;
}

// Most others do not come near along the direction between their boxes, at their present speeds.
bool MotionSearch::leaves_along_boxes(const PairRequest& request, const Node& node, BodyPair pair,
                                      const Moment& moment) {
  const Aabb *const a = moment.placed.known_box(pair.a), *const b = moment.placed.known_box(pair.b);
  if (!a || !b || request.way == 0) return false;
  const Vec3d n = way_between(*a, *b);
  const double length = norm(n);
  if (!(length > request.target + request.growth.most)) return false;
  const HalfSpans gaps = half_spans(pair, request, n, 0, moment, reach_of(node), true);
  const double low = std::min(gaps.before, gaps.after);
  Goal& goal = goal_of(node.open[request.open]);
  if (!(low > (decides() ? request.target : target_of(node.open[request.open], goal, 0)))) return false;
  leave(goal, node.open[request.open], std::max(low, node.low[request.open]), node.begin);
  return true;
}

MotionSearch::PairRequest MotionSearch::request_for(std::size_t i, const Node& node, BodyPair pair,
                                                    const BodyPoses& placed) {
  const std::uint64_t position = node.open[i];
  PairRequest request;
  request.open = static_cast<std::uint32_t>(i);
  Slack slack;
  if (!is_unusable(motion_query_.scene, placed, pair)) {
    request.rates = motion_query_.bounds.rates(position, pair, moving, placed);
    request.rest = motion_query_.bounds.rest(position, pair, moving, request.rates.seer);
    request.growth = motion_query_.bounds.growth(pair, moving, node.at);
    request.way = way_of_pair(request.rates, reach_of(node));
    slack = pair_slack(placed, pair);
    request.inner = slack.inner;
  }
  const Goal& goal = goal_of(position);
  request.target = decides() ? target_of_margin(position, goal, node, slack) : target_of(position, goal, slack.inner);
  return request;
}

// The pair with the nearest boxes; node.open.size() if all are beyond max_distance or without poses.
std::size_t MotionSearch::nearest_of(const Node& node, const BodyPoses& placed) const {
  std::size_t nearest = node.open.size();
  double least = motion_query_.plan.query.max_distance;
  for (std::size_t i = 0; i < node.open.size(); ++i) {
    const BodyPair pair = motion_query_.plan.pairs.at(node.open[i]);
    const double gap = box_gap(motion_query_.scene, placed, pair);
    if (gap < least) least = gap, nearest = i;
  }
  return nearest;
}

// Records the earliest pair found within its margin if first contact is requested, otherwise the nearest.
void MotionSearch::see(Goal& goal, std::uint64_t position, double time, const PairAnswer& answer,
                       const BodyPoses& placed) {
  const bool within = answer.upper <= motion_query_.plan.margins.of(position);
  const bool earlier = within && time < goal.hit.time, hit_before = goal.hit.time < kInf;
  if (earlier) goal.hit = {time, position, answer.part_a, answer.part_b};
  const bool nearer = answer.upper < goal.upper() && (!any() || within || !goal.decided);
  if (!(any() && seeks_contact_ ? earlier || (nearer && !hit_before) : nearer)) return;
  const BodyPair pair = motion_query_.plan.pairs.at(position);
  goal.best = answer;
  goal.pair = position;
  goal.time = time;
  goal.slack = pair_slack(placed, pair).outer;
  goal.origin_a = placed[pair.a].pose.t_w;
  goal.origin_b = placed[pair.b].pose.t_w;
  goal.decided = any() ? within : answer.upper <= 0;
}

// Lower bounds on either side, along a direction that separates the pair at the time of evaluation.
// \param of_boxes uses the bodies' boxes, which include their uncertainty
HalfSpans MotionSearch::half_spans(BodyPair pair, const PairRequest& request, const Vec3d& n, double inner,
                                   const Moment& moment, double reach, bool of_boxes) const {
  const PairRates& rates = request.rates;
  const double bend = bend_of_pair(rates, reach) - request.rest;
  const auto gaps_on = [&](int side) {
    const auto moving_body = [&](std::uint32_t body) {
      return MovingBody{motion_query_.scene.bodies()[body], moment.placed[body].pose,
                        motion_query_.bounds.twist_before(rates.seer, body, moment.twists[side], moment.placed),
                        of_boxes ? moment.placed.known_box(body) : nullptr};
    };
    MovingBody b = moving_body(pair.b);
    // Growth brings the bodies nearer along every direction.
    if (request.growth.any()) b.twist.shift = b.twist.shift - n * (request.growth.slope[side] / norm(n));
    return gaps_along(n, moving_body(pair.a), b, reach, bend);
  };
  HalfSpans gaps = gaps_on(1);
  if (is_curved()) gaps.before = gaps_on(0).after;  // the progress is positive on both sides
  return without_uncertainty(gaps, inner + request.rest + request.growth.most, rates.drift, reach);
}

// Takes an answer's bounds for both sides of the span. A pair that is not proved on a side continues there.
void MotionSearch::divide(const PairRequest& request, const PairAnswer& answer, const Moment& moment, const Node& node,
                          Half (&halves)[2]) {
  const std::uint64_t position = node.open[request.open];
  Goal& goal = goal_of(position);
  const double inner = request.inner, target = decides() ? request.target : target_of(position, goal, inner);
  const double by_speed = difference_below(answer.lower, request.way);
  double low = std::max(node.low[request.open], by_speed);
  const bool beyond = answer.status == Status::kBeyond;
  if (beyond) low = std::max(low, std::nextafter(request.target, kInf));
  HalfSpans gaps{low, low, -kInf};
  const Vec3d& n = answer.normal;
  const bool has_normal = answer.lower > std::min(target, 0.0) && std::isfinite(n.x + n.y + n.z);
  if (!beyond && !is_proved(low, target) && request.way > 0 && has_normal)
    gaps = half_spans(motion_query_.plan.pairs.at(position), request, n, inner, moment, reach_of(node), false);
  // Shorter spans would not bring the proof past a time at which the pair is too near.
  const bool ends_here = node.half() <= kLeastHalf || (seeks_contact_ && node.half() <= 0.5 * kContactTime && !beyond &&
                                                       answer.lower <= motion_query_.plan.margins.of(position));
  for (int side = 0; side < 2; ++side) {
    Half& half = halves[side];
    const double along = side == 0 ? gaps.before : gaps.after, gap = std::max(low, along);
    const bool proved = beyond || is_proved(gap, target);
    if (proved || request.way == 0 || ends_here) {
      goal.forced |= !proved && !decides();
      leave(goal, position, gap, half.node.begin);
    } else {
      half.node.open.push_back(position);
      half.node.low.push_back(gap);
      const ProvedShare by_normal = proved_until(gaps.middle, along, target);
      // A curve's mean speed bounds nothing before the ends of the span.
      const ProvedShare by_way = is_curved() ? ProvedShare() : proved_until(answer.lower, by_speed, target),
                        most = std::max(by_way, by_normal);
      half.proved =
          std::min(half.proved, most.share * node.pace[side] * (side == 0 ? node.at - node.begin : node.end - node.at));
      half.proved_low.push_back(most.low);
    }
  }
}

// Drops the time from the evaluation on for which all pairs of a side are proved, and queues the remainder. Its ends
// are chosen such that its middle, and the middles of its halves, are exact.
void MotionSearch::push_rest(Half& half, double at) {
  Node& node = half.node;
  if (node.open.empty()) return;
  const bool is_after = node.begin == at;
  const double end = rest_of_half(at, half.proved, node.half(), is_after);
  if (end != at) {
    for (std::size_t i = 0; i < node.open.size(); ++i)
      leave(goal_of(node.open[i]), node.open[i], std::max(half.proved_low[i], node.low[i]), is_after ? at : end);
    (is_after ? node.begin : node.end) = end;
  }
  push(std::move(node));
}

void MotionSearch::take(Node& node, const Moment& moment, std::span<const PairRequest> requests,
                        std::span<const PairAnswer> answers) {
  assert(requests.size() == answers.size());
  --under_way_;
  const double at = node.at;
  Half halves[2];
  halves[0].node.begin = node.begin;
  halves[0].node.end = halves[1].node.begin = at;
  halves[1].node.end = node.end;
  for (Half& half : halves) half.proved = half.node.end - half.node.begin;
  const bool seed = node.seeds;  // the pair continues together with the others
  for (std::size_t k = 0; k < requests.size(); ++k) {
    const PairAnswer answer = grown_answer(answers[k], requests[k].growth);
    const std::uint64_t position = node.open[requests[k].open];
    Goal& goal = goal_of(position);
    if (std::isnan(answer.distance)) {
      if (position < goal.unusable) goal.unusable_answer = answer, goal.unusable = position;
      goal.decided |= goals_.size() > 1;
      continue;
    }
    evaluated_ += answer.upper < kInf;
    // A pair that does not move is there from the beginning on.
    see(goal, position, requests[k].way > 0 ? at : node.begin, answer, moment.placed);
    if (!seed) divide(requests[k], answer, moment, node, halves);
  }
  if (seed) push(std::move(node));
  for (Half& half : halves) push_rest(half, at);
  end_if_done();
}

}  // namespace clearance
