#include "engine/motion/motion_bounds.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/scene/body_ball.h"

namespace clearance {

namespace {

constexpr double kUnit = 0x1p-53;
constexpr double kUp = kMotionSlack;    // for the sums and products below
constexpr double kAxisError = 0x1p-48;  // of a vector's component perpendicular to an axis

double length_of(const Vec3d& v) {
  return std::hypot(v.x, v.y, v.z);
}

double reach_of(const LinkBall& ball) {
  return (length_of(ball.centre) + ball.radius) * kUp;
}

}  // namespace

MotionBounds::MotionBounds(const engine::Scene& scene, const Plan& plan, bool all_pairs) : scene_(scene), plan_(plan) {
  chain_of_body_.assign(scene.bodies().size(), kStill);
  slot_.assign(scene.bodies().size(), kNone);
  for (std::size_t i = 0; i < plan.moved.size(); ++i) slot_[plan.moved[i]] = static_cast<std::uint32_t>(i);
  given_of_.assign(scene.bodies().size(), kNone);
  for (std::size_t i = 0; i < plan.given_bodies; ++i) given_of_[plan.bodies[i]] = static_cast<std::uint32_t>(i);
  for (const std::uint32_t body : plan.moved)
    if (Chain chain = chain_of(body); !chain.empty()) chain_of_body_[body] = add_chain(std::move(chain));
  if (all_pairs)
    take_all_views();
  else
    has_views_.resize(plan.pairs.size());
}

void MotionBounds::take_all_views() {
  std::vector<BodyPair> storage;
  constexpr std::uint64_t kSlice = 4096;
  for (std::uint64_t begin = 0; begin < plan_.pairs.size(); begin += kSlice) {
    const auto pairs = plan_.pairs.slice(begin, std::min(kSlice, plan_.pairs.size() - begin), storage);
    for (std::size_t i = 0; i < pairs.size(); ++i) take_views(begin + i, pairs[i]);
  }
}

void MotionBounds::take_views(std::uint64_t position) {
  if (!has_views_.empty() && !std::exchange(has_views_[position], std::uint8_t{1}))
    take_views(position, plan_.pairs.at(position));
}

std::uint32_t MotionBounds::add_chain(Chain chain) {
  if (chain.empty()) return kStill;
  chains_.push_back(std::move(chain));
  return static_cast<std::uint32_t>(chains_.size() - 1);
}

// From a body outwards to the world, by everything that the query moves.
MotionBounds::Chain MotionBounds::chain_of(std::uint32_t body) const {
  const PoseSnapshot& snapshot = *plan_.snapshot;
  Chain chain;
  LinkBall ball = ball_around(scene_.bodies()[body]);
  double offset = 0;
  for (std::uint32_t at = body; at != kNone; at = snapshot.parent[at]) {
    Link link;
    link.body = at;
    link.given = given_of_[at];
    for (std::uint32_t m = 0; m < plan_.motions.size() && link.given == kNone; ++m)
      for (const std::uint32_t l : plan_.motions[m].links())
        if (plan_.motions[m].robot().bodies[l] == at) link.robot = m, link.link = l;
    if (link.given == kNone && link.robot == kNone) {  // at rest relative to its carrier
      const Pose& X = snapshot.local[at];
      if (!snapshot.given[at] || check(X) == PoseQuality::kBad) continue;  // without a pose there is no answer
      ball.centre = rotation_of(X) * ball.centre + X.translation;
      ball.radius = (ball.radius + 0x1p-48 * (length_of(ball.centre) + length_of(X.translation))) * kUp;
      offset = (offset + length_of(X.translation)) * kUp;
      continue;
    }
    if (chain.empty()) link.ball = ball;
    link.offset = chain.empty() ? 0 : offset;
    offset = 0;
    if (link.robot != kNone) {
      link.path = MotionPath(kinematics(link), link.link, link.ball);
      link.error = kinematics(link).error(link.link, reach_of(link.ball));
      for (const Mover& mover : link.path.movers()) link.slides += !mover.turns;
    }
    chain.push_back(std::move(link));
  }
  return chain;
}

// A common carrier moves neither body relative to the other.
void MotionBounds::take_views(std::uint64_t position, BodyPair pair) {
  const std::size_t bodies = scene_.bodies().size();
  if (pair.a >= bodies || pair.b >= bodies) return;
  const std::uint32_t at_a = chain_of_body_[pair.a], at_b = chain_of_body_[pair.b];
  if (at_a == kStill || at_b == kStill) return;
  const Chain &a = chains_[at_a], &b = chains_[at_b];
  std::size_t shared = 0;
  const auto behind = [&](const Chain& chain) -> const Link& { return chain[chain.size() - 1 - shared]; };
  while (shared < a.size() && shared < b.size() && behind(a).given == behind(b).given &&
         behind(a).robot == behind(b).robot && behind(a).link == behind(b).link)
    ++shared;
  const bool fork_in_robot =
      shared < a.size() && shared < b.size() && behind(a).robot != kNone && behind(a).robot == behind(b).robot;
  if (fork_in_robot && kinematics(behind(a)).root_of(behind(a).link) == kinematics(behind(b)).root_of(behind(b).link))
    views_[position] = views_in_robot(Chain(a), Chain(b), shared);  // copies, because chains are added
  else if (shared > 0)
    views_[position] = view_of_carrier(at_a, at_b, shared);
}

MotionBounds::Views MotionBounds::view_of_carrier(std::uint32_t a, std::uint32_t b, std::size_t shared) {
  Views views;
  views.view[0].seer = chains_[a][chains_[a].size() - shared].body;
  views.view[0].a = chain_before(a, shared);
  views.view[0].b = chain_before(b, shared);
  return views;
}

// A chain relative to a carrier: without its last `shared` links. Cached, because many pairs share it.
std::uint32_t MotionBounds::chain_before(std::uint32_t chain, std::size_t shared) {
  const auto [at, is_new] = before_.try_emplace({chain, shared}, kStill);
  if (!is_new) return at->second;
  Chain shorter(chains_[chain].begin(), chains_[chain].end() - static_cast<std::ptrdiff_t>(shared));
  return at->second = add_chain(std::move(shorter));
}

// Views of the other's points from either link, and of all points from the common carrier.
MotionBounds::Views MotionBounds::views_in_robot(const Chain& a, const Chain& b, std::size_t shared) {
  const std::size_t of_a = a.size() - 1 - shared, of_b = b.size() - 1 - shared;
  const Link &link_a = a[of_a], &link_b = b[of_b];
  const Kinematics& robot = kinematics(link_a);
  const auto inner = [](const Chain& chain, std::size_t count) {
    return Chain(chain.begin(), chain.begin() + static_cast<std::ptrdiff_t>(count));
  };
  const auto with = [&](const Chain& chain, std::size_t count, MotionPath path) {
    Chain longer = inner(chain, count + 1);
    longer.back().path = std::move(path);
    return add_chain(std::move(longer));
  };
  auto [path_a, path_b] = paths_from_fork(robot, link_a.link, link_a.ball, link_b.link, link_b.ball);
  Views views;
  views.count = 3;
  views.view[0].seer = link_a.body;
  views.view[1].seer = link_b.body;
  views.view[2].seer = plan_.motions[link_a.robot].robot().bodies[fork_of(robot, link_a.link, link_b.link)];
  views.view[0].a = add_chain(inner(a, of_a));
  views.view[0].b = with(b, of_b, MotionPath(robot, link_a.link, link_b.link, link_b.ball));
  views.view[1].a = with(a, of_a, MotionPath(robot, link_b.link, link_a.link, link_a.ball));
  views.view[1].b = add_chain(inner(b, of_b));
  views.view[2].a = with(a, of_a, std::move(path_a));
  views.view[2].b = with(b, of_b, std::move(path_b));
  return views;
}

void MotionBounds::take_rates(MovingBodies& moving) const {
  moving.chains.resize(chains_.size());
  moving.chain_errors.resize(chains_.size());
  moving.chain_turns.resize(chains_.size());
  for (std::size_t c = 0; c < chains_.size(); ++c)
    moving.chains[c] = rates_of(chains_[c], moving, &moving.chain_errors[c], &moving.chain_turns[c]);
  moving.errors.assign(plan_.moved.size(), 0);
  for (std::size_t i = 0; i < plan_.moved.size(); ++i)
    if (const std::uint32_t c = chain_of_body_[plan_.moved[i]]; c != kStill) moving.errors[i] = moving.chain_errors[c];
}

// Along a curve a body does not turn: its coordinates are three sliding joints.
MotionRates MotionBounds::rates_of_given(const Link& link, bool is_first, double reach,
                                         const MovingBodies& moving) const {
  const BodyMotion& motion = moving.given[link.given];
  if (!moving.curves.empty()) return moving.given_rates[link.given];
  const Vec3d& centre = link.ball.centre;
  const double across = length_of(cross(motion.axis(), centre)) + kAxisError * length_of(centre);
  const double radius = is_first ? across + link.ball.radius : reach, wrong = motion.error(reach);
  return {(motion.shift() + radius * motion.turn() + wrong) * kUp,
          (radius * motion.turn() + 4 * wrong) * motion.turn() * kUp, motion.turn()};
}

// Sums from the points outwards. Points of the first link lie in its ball; for links farther out they are within
// `reach` of the link's origin.
MotionRates MotionBounds::rates_of(const Chain& chain, const MovingBodies& moving, double* error,
                                   double* turn_error) const {
  MotionRates sum;
  double reach = 0;
  *error = *turn_error = 0;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const Link& link = chain[i];
    reach = i == 0 ? reach_of(link.ball) : (reach + link.offset) * kUp;
    MotionRates own;
    if (link.given != kNone) {
      own = rates_of_given(link, i == 0, reach, moving);
      *error += moving.given[link.given].error(reach);
      *turn_error += moving.given[link.given].turn_error();
      double farthest = moving.given[link.given].farthest();
      if (!moving.curves.empty()) {
        const JointCurve* const by = &moving.curves[plan_.joints.size() + 3 * link.given];
        *error += std::hypot(by[0].rounding(), by[1].rounding(), by[2].rounding());
        farthest = std::hypot(by[0].farthest(), by[1].farthest(), by[2].farthest());
      }
      reach = (reach + farthest) * kUp;
    } else {
      const double beyond = i == 0 ? 0 : reach, travel = moving.travel[link.robot];
      own = link.path.rates(moving.change[link.robot], travel, beyond);
      if (!moving.curves.empty())
        own.acceleration = (own.acceleration + link.path.rates(moving.bend[link.robot], travel, beyond).speed) * kUp;
      const PlacementError placed = i == 0 ? link.error : kinematics(link).error(link.link, reach);
      const MotionRates rounding = link.path.rates(moving.rounding[link.robot], travel, beyond);
      *error += rounding.speed + placed.at(travel, 0);
      *turn_error += rounding.turn;
      reach = (kinematics(link).reach(link.link, reach) + link.slides * travel) * kUp;
    }
    sum = i == 0 ? own : sum.within(own);
  }
  *error *= kUp;
  return sum;
}

MotionRates MotionBounds::rates_of_chain(std::uint32_t chain, const MovingBodies& moving) {
  if (chain == kStill) return {};
  MotionRates rates = moving.chains[chain];
  if (!moving.chain_ways.empty()) rates.speed = moving.chain_ways[chain];
  return rates;
}

// Radians by which the frames behind a body's slack may be rotated. As the body moves relative to them, its slack
// changes by this much per metre.
double MotionBounds::turn_uncertainty(std::uint32_t body, const BodyPoses& placed) const {
  if (plan_.uncertainties.empty()) return 0;
  const PoseUncertainty& uncertainty = placed.uncertainty(body);
  return uncertainty.known.turn + uncertainty.placed.turn + 4 * kUnit;
}

double MotionBounds::drift_of(std::uint32_t body, const MovingBodies& moving, const BodyPoses& placed) const {
  const std::uint32_t chain = chain_of_body_[body];
  if (chain == kStill) return 0;
  const MotionRates& own = moving.chains[chain];
  return drift_of_chain(own, moving.chain_errors[chain], moving.chain_turns[chain], turn_uncertainty(body, placed));
}

void MotionBounds::speeds(const MovingBodies& moving, const BodyPoses& placed, std::vector<double>& speeds) const {
  speeds.clear();
  for (const std::uint32_t body : plan_.moved) {
    const std::uint32_t chain = chain_of_body_[body];
    const double grown = moving.growth.empty() || given_of_[body] == kNone ? 0 : moving.growth[given_of_[body]].change;
    const double speed = chain == kStill ? 0 : rates_of_chain(chain, moving).speed + drift_of(body, moving, placed);
    speeds.push_back((speed + grown) * kUp);
  }
}

PairGrowth MotionBounds::growth(BodyPair pair, const MovingBodies& moving, double time) const {
  PairGrowth sum;
  if (moving.growth.empty()) return sum;
  for (const std::uint32_t body : {pair.a, pair.b}) {
    const std::uint32_t given = given_of_[body];
    if (given == kNone) continue;
    const double at = moving.growths[given].at(time), rounding = moving.growths[given].rounding();
    sum.least += std::max(at - rounding, 0.0);
    sum.most += at + rounding;
    for (int side = 0; side < 2; ++side) sum.slope[side] += moving.growth[given].slope[side];
    sum.change += moving.growth[given].change;
    sum.bend += moving.growth[given].bend;
  }
  return {sum.least * (2 - kUp), sum.most * kUp, {sum.slope[0], sum.slope[1]}, sum.change * kUp, sum.bend * kUp};
}

PairRates MotionBounds::rates(std::uint64_t position, BodyPair pair, const MovingBodies& moving,
                              const BodyPoses& placed) const {
  const auto of = [&](std::uint32_t chain) { return rates_of_chain(chain, moving); };
  const std::uint32_t chain_a = chain_of_body_[pair.a], chain_b = chain_of_body_[pair.b];
  const MotionRates a = of(chain_a), b = of(chain_b);
  PairRates rates{a.speed + b.speed, a.acceleration + b.acceleration};
  if (const auto views = views_.find(position); views != views_.end()) {
    for (std::uint32_t v = 0; v < views->second.count; ++v) {
      const View& view = views->second.view[v];
      rates.see(of(view.a), of(view.b), view.seer);
    }
  }
  const PairGrowth grown = growth(pair, moving, 0);
  rates.speed += grown.change;
  rates.acceleration = (rates.acceleration + grown.bend) * kUp;
  rates.add_drift(drift_of(pair.a, moving, placed) + drift_of(pair.b, moving, placed) + kTwistError * grown.change);
  return rates;
}

double MotionBounds::rest(std::uint64_t position, BodyPair pair, const MovingBodies& moving, std::uint32_t seer) const {
  if (moving.chain_rests.empty()) return 0;
  const auto of = [&](std::uint32_t chain) { return chain == kStill ? 0 : moving.chain_rests[chain]; };
  double rest = of(chain_of_body_[pair.a]) + of(chain_of_body_[pair.b]);
  if (const auto views = views_.find(position); seer != kNone && views != views_.end())
    for (std::uint32_t v = 0; v < views->second.count; ++v)
      if (const View& view = views->second.view[v]; view.seer == seer) rest = of(view.a) + of(view.b);
  return (rest + 0.5 * growth(pair, moving, 0).bend) * kUp;
}

Twist MotionBounds::twist_before(std::uint32_t seer, std::uint32_t body, std::span<const Twist> twists,
                                 const BodyPoses& placed) const {
  const auto twist_of = [&](std::uint32_t of) { return slot_[of] == kNone ? Twist() : twists[slot_[of]]; };
  if (seer == kNone) return twist_of(body);
  return twist_seen(twist_of(body), twist_of(seer), placed[body].pose.t_w - placed[seer].pose.t_w);
}

}  // namespace clearance
