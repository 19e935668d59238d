#include "engine/evaluate/second_order.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "engine/evaluate/feature_pair.h"
#include "engine/evaluate/part_gap.h"
#include "engine/evaluate/rate_bounds.h"
#include "engine/narrow/narrow_phase.h"

namespace clearance {

// A joint, or the motion of a body that the query gives, as it moves a witness point. World axes.
struct PairMover {
  std::uint32_t at;     // column of the query's joints, or kNone
  double scale;         // of a mimic joint
  double speed;         // its share of the velocities, per second; NaN if unknown
  Vec3d spin;           // angular velocity by its variable
  Vec3d shift;          // velocity of the witness point
  std::uint32_t given;  // the body whose velocity is given or stored, or kNone
};

// The movers from a body down to the nearest one that carries the other body as well.
struct MoverChain {
  std::vector<std::uint32_t> way;  // bodies, from the pair's
  std::vector<PairMover> movers;
  std::vector<std::uint32_t> given;  // bodies of the query among those that carry the body, and itself
  double sign;                       // 1 of b, -1 of a
};

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// For units of work.
constexpr std::uint64_t kTermsPerUnit = 64, kPairsPerUnit = 16;

// Lowers the radius to that over which no other two parts of the bodies become the nearest.
double radius_among_parts(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b,
                          const PairAnswer& answer, double distance, double radius, WorkMeter& meter) {
  NarrowLimits limits;
  WorkMeter narrow;
  meter.count(std::uint64_t{a.parts.size()} * b.parts.size() / kPairsPerUnit);
  for (std::uint32_t i = 0; i < a.parts.size(); ++i)
    for (std::uint32_t j = 0; j < b.parts.size(); ++j) {
      if (i == answer.part_a && j == answer.part_b) continue;
      if (part_gap(*a.parts[i], pose_a, *b.parts[j], pose_b) - distance >= 2 * radius) continue;
      limits.max_distance = distance + 2 * radius;
      const NarrowAnswer other = narrow_phase(*a.parts[i], pose_a, *b.parts[j], pose_b, limits, nullptr, &narrow);
      if (!other.beyond) radius = std::clamp((other.bounds.lower - distance) / 2, 0.0, radius);
    }
  meter.count(narrow.spent());
  return radius;
}

void add_joint(const JointMover& joint, const BodyPoses& placement, const Vec3d& point, const double* velocities,
               std::vector<PairMover>& out) {
  const auto speed = [&](std::uint32_t at) { return velocities && at != kNone ? joint.scale * velocities[at] : 0; };
  if (const std::uint32_t at = joint.turns ? joint.at[joint.slides] : kNone; at != kNone) {
    const PoseMatrix& link = placement[joint.link].pose;  // its origin is on the axis
    const Vec3d axis = link.R_wb * joint.axis;
    out.push_back({at, joint.scale, speed(at), axis, cross(axis, point - link.t_w), kNone});
  }
  for (std::uint32_t k = joint.slides; k-- > 0;) {
    const std::uint32_t at = joint.at[k];
    if (at == kNone) continue;
    const Vec3d along = placement[joint.carrier].pose.R_wb * joint.along[k];
    out.push_back({at, joint.scale, speed(at), {0, 0, 0}, along, kNone});
  }
}

void add_twist(std::uint32_t body, const double* twist, const Vec3d& origin, const Vec3d& point,
               std::vector<PairMover>& out) {
  const Vec3d spin{twist[0], twist[1], twist[2]}, shift{twist[3], twist[4], twist[5]};
  if (!std::isfinite(squared_norm(spin) + squared_norm(shift))) {
    out.push_back({kNone, 1, kNan, {0, 0, 0}, {0, 0, 0}, body});
    return;
  }
  out.push_back({kNone, 1, 1, spin, cross(spin, point - origin), body});
  out.push_back({kNone, 1, 1, {0, 0, 0}, shift, body});
}

// First derivative of the distance at the query's velocities.
double rate_of(const MoverChain (&chains)[2], const Vec3d& normal) {
  double rate = 0;
  for (const MoverChain& chain : chains)
    for (const PairMover& m : chain.movers) rate += chain.sign * m.speed * dot(normal, m.shift);
  return rate;
}

std::optional<FeaturePair> features_of(const Body& a, const PoseMatrix& pose_a, const Body& b, const PoseMatrix& pose_b,
                                       const PairAnswer& answer, bool wants_radius, WorkMeter& meter) {
  const ConvexPart &part_a = *a.parts[answer.part_a], &part_b = *b.parts[answer.part_b];
  const WitnessPoints start{answer.point_a - answer.normal * part_a.radius,
                            answer.point_b + answer.normal * part_b.radius + (pose_b.t_w - pose_a.t_w)};
  meter.count(FeaturePair::units_to_find(part_a, part_b));
  return FeaturePair::find(part_a, pose_a, part_b, pose_b, start, answer.normal, wants_radius);
}

// Numbers from 0 on.
std::vector<std::uint32_t> all_of(std::size_t count) {
  std::vector<std::uint32_t> ids(count);
  std::iota(ids.begin(), ids.end(), 0u);
  return ids;
}

JointGradient movers_of(const engine::Scene& scene, const Plan& plan) {
  if (plan.query.configuration_count > 0) return {scene, plan};
  return {scene, *plan.snapshot, all_of(scene.joints().size()), all_of(scene.bodies().size())};
}

}  // namespace

SecondOrder::SecondOrder(const engine::Scene& scene, const Plan& plan)
    : scene_(scene),
      plan_(plan),
      is_current_(plan.query.configuration_count == 0),
      joints_(movers_of(scene, plan)),
      given_of_(scene.bodies().size(), kNone) {
  for (std::uint32_t i = 0; i < plan.given_bodies; ++i) given_of_[plan.bodies[i]] = i;
  for (std::uint32_t body = 0; body < scene.bodies().size(); ++body) carrier_.push_back(joints_.carrier_of(body));
}

struct SecondOrder::Chains {
  MoverChain side[2];
};

// The velocity of a body that the query gives, or that is stored with its current pose; null if it stands still.
const double* SecondOrder::twist_of(std::uint32_t body, std::uint32_t configuration) const {
  if (is_current_) {
    const BodyTwist& stored = plan_.snapshot->velocity[body];
    return stored == BodyTwist{} ? nullptr : stored.data();
  }
  const std::uint32_t given = given_of_[body];
  if (given == kNone || plan_.twists.empty()) return nullptr;
  return plan_.twists.data() + 6 * (configuration * plan_.given_bodies + given);
}

// The ways from both bodies towards the root. What carries both changes nothing.
void SecondOrder::find_ways(BodyPair pair, Chains& chains) const {
  constexpr std::size_t kFew = 16;
  auto &a = chains.side[0].way, &b = chains.side[1].way;
  for (auto [body, way] : {std::pair(pair.a, &a), std::pair(pair.b, &b)}) {
    way->reserve(kFew);
    for (; body != kNone; body = carrier_[body]) way->push_back(body);
  }
  while (!a.empty() && !b.empty() && a.back() == b.back()) {
    a.pop_back();
    b.pop_back();
  }
}

// Movers of both bodies on their ways, at their witness points.
void SecondOrder::find_movers(const BodyPoses& placement, std::uint32_t configuration, const Vec3d& point_a,
                              const Vec3d& point_b, Chains& chains) const {
  const double* const velocities = is_current_ ? plan_.snapshot->joints.velocity.data()
                                   : plan_.velocities.empty()
                                       ? nullptr
                                       : plan_.velocities.data() + configuration * plan_.joints.size();
  for (int side = 0; side < 2; ++side) {
    MoverChain& chain = chains.side[side];
    chain.sign = side ? 1 : -1;
    chain.movers.clear();
    chain.movers.reserve(chain.way.size());
    chain.given.clear();
    for (const std::uint32_t body : chain.way) {
      const Vec3d& point = side ? point_b : point_a;
      const std::uint32_t mover = joints_.mover_of()[body];
      if (mover != kNone && joints_.movers()[mover].link == body)
        add_joint(joints_.movers()[mover], placement, point, velocities, chain.movers);
      if (given_of_[body] != kNone) chain.given.push_back(body);
      if (const double* const twist = twist_of(body, configuration))
        add_twist(body, twist, placement[body].pose.t_w, point, chain.movers);
    }
  }
}

// Adds the second derivatives by all pairs of movers.
void SecondOrder::combine(const FeaturePair& features, const Chains& chains, SecondOrderRow& row,
                          WorkMeter& meter) const {
  struct Term {
    FeaturePair::Term term;
    const PairMover* mover;
    int side;
  };
  std::vector<Term> terms;
  terms.reserve(chains.side[0].movers.size() + chains.side[1].movers.size());
  for (int side = 0; side < 2; ++side)
    for (const PairMover& m : chains.side[side].movers) {
      const Vec3d still{0, 0, 0};
      const FeatureMotion motion{side ? still : m.spin, side ? m.spin : still, m.shift * chains.side[side].sign};
      terms.push_back({features.term(motion), &m, side});
    }
  meter.count(terms.size() * terms.size() / kTermsPerUnit);
  const std::size_t joints = plan_.joints.size();
  // The movers of current poses are all joints of the scene, not columns of the query.
  double* const hessian = row.hessian_joints.empty() || is_current_ ? nullptr : row.hessian_joints.data();
  double curvature = 0;
  for (std::size_t x = 0; x < terms.size(); ++x)
    for (std::size_t y = x; y < terms.size(); ++y) {
      const PairMover &carried = *terms[x].mover, &carrier = *terms[y].mover;  // if of one chain
      double value = FeaturePair::curvature(terms[x].term, terms[y].term);
      if (terms[x].side == terms[y].side)
        value += chains.side[terms[x].side].sign * dot(features.normal(), cross(carrier.spin, carried.shift));
      curvature += (x == y ? 1 : 2) * value * carried.speed * carrier.speed;
      if (!hessian || carried.at == kNone || carrier.at == kNone) continue;
      const double scaled = value * carried.scale * carrier.scale;
      hessian[carried.at * joints + carrier.at] += scaled;
      if (x != y) hessian[carrier.at * joints + carried.at] += scaled;
    }
  row.curvature = curvature;
}

// Relative errors of axes and lever arms as computed, far above those of links: docs/trust/bounds_robots.md, "Rates".
constexpr double kTwistUnits = 0x1p-36;

Interval SecondOrder::bound_rate(const BodyPoses& placement, BodyPair pair, const PairAnswer& answer,
                                 const std::optional<FeaturePair>& features, const Chains& chains,
                                 WorkMeter& meter) const {
  const Body &a = scene_.bodies()[pair.a], &b = scene_.bodies()[pair.b];
  const PoseMatrix &pose_a = placement[pair.a].pose, &pose_b = placement[pair.b].pose;
  const Slack slack = pair_slack(placement, pair);
  const RateBounds bounds(a, pose_a, b, pose_b, answer, features, slack, meter);
  PairMotion motion;
  double unknown = 0, speeds = 0, turns = 0;
  for (int side = 0; side < 2; ++side) {
    const double reach = (side ? b : a).reach + slack.inner;
    const Vec3d arm = side ? answer.point_b : answer.point_a;
    for (const PairMover& m : chains.side[side].movers) {
      if (std::isnan(m.speed)) {
        const double most = m.given == kNone ? 0 : scene_.bodies()[m.given].max_speed;
        unknown += most > 0 ? most : std::numeric_limits<double>::infinity();
        continue;
      }
      const Vec3d turn = m.spin * m.speed;
      Vec3d &turn_of_side = side ? motion.turn_b : motion.turn_a, &shift = side ? motion.shift_b : motion.shift_a;
      turn_of_side = turn_of_side + turn;
      shift = shift + (m.shift * m.speed - cross(turn, arm));
      turns += norm(turn);
      speeds += norm(m.shift) * std::abs(m.speed) + norm(turn) * (norm(arm) + reach);
    }
  }
  double tilt = kTwistUnits;
  if (placement.has_uncertainties())
    for (const std::uint32_t body : {pair.a, pair.b}) tilt += placement.uncertainty(body).known.turn;
  const double error = (unknown + speeds * tilt + turns * (slack.inner + slack.outer) +
                        speed_errors(bounds, placement, pair, answer, chains, slack, tilt, meter)) *
                       (1 + 0x1p-40);
  Interval all = bounds.of(motion, meter);
  if (!plan_.query.signed_distance && answer.lower <= 0) all = {std::min(all.lower, 0.0), std::max(all.upper, 0.0)};
  all = {difference_below(all.lower, error), sum_above(all.upper, error)};
  return all.is_possible() ? all : within(std::numeric_limits<double>::infinity());
}

// Bound on the change of the rate by errors of the query's velocities.
double SecondOrder::speed_errors(const RateBounds& bounds, const BodyPoses& placement, BodyPair pair,
                                 const PairAnswer& answer, const Chains& chains, const Slack& slack, double tilt,
                                 WorkMeter& meter) const {
  if (plan_.speed_errors.empty()) return 0;
  double sum = 0;
  for (int side = 0; side < 2; ++side) {
    const std::uint32_t body = side ? pair.b : pair.a;
    const Vec3d arm = side ? answer.point_b : answer.point_a;
    const double reach = scene_.bodies()[body].reach + slack.inner, turn_arm = norm(arm) + reach;
    for (const PairMover& m : chains.side[side].movers) {
      if (m.at == kNone || plan_.speed_errors[m.at] == 0) continue;
      PairMotion unit;
      (side ? unit.turn_b : unit.turn_a) = m.spin;
      (side ? unit.shift_b : unit.shift_a) = m.shift - cross(m.spin, arm);
      const Interval by_speed = bounds.of(unit, meter);
      const double turn = norm(m.spin), displaced = (norm(m.shift) + turn * turn_arm) * tilt;
      const double most = std::max(-by_speed.lower, by_speed.upper) + displaced + turn * (slack.inner + slack.outer);
      sum += plan_.speed_errors[m.at] * std::abs(m.scale) * most;
    }
    for (const std::uint32_t given : chains.side[side].given) {
      const double* const errors = plan_.speed_errors.data() + plan_.joints.size() + 2 * given_of_[given];
      const double away = norm(placement[body].pose.t_w - placement[given].pose.t_w);
      sum += errors[0] * (away + reach) + errors[1];
    }
  }
  return sum * (1 + 0x1p-36);
}

SecondOrderRow SecondOrder::row(const BodyPoses& placement, BodyPair pair, std::uint32_t configuration,
                                const PairAnswer& answer, WorkMeter& meter) const {
  SecondOrderRow row;
  const std::size_t n = scene_.bodies().size(), joints = plan_.joints.size();
  const bool wants_hessian = (plan_.size.fields & kFieldHessianJoints) != 0;
  if (wants_hessian) row.hessian_joints.assign(joints * joints, kNan);
  meter.count(1 + row.hessian_joints.size() / kTermsPerUnit);
  if (pair.a >= n || pair.b >= n || std::isnan(answer.point_a.x) || std::isnan(answer.normal.x)) return row;
  const Body &a = scene_.bodies()[pair.a], &b = scene_.bodies()[pair.b];
  const PoseMatrix &pose_a = placement[pair.a].pose, &pose_b = placement[pair.b].pose;
  Chains chains;
  find_ways(pair, chains);
  find_movers(placement, configuration, pose_a.t_w + answer.point_a, pose_b.t_w + answer.point_b, chains);
  const bool is_flat = answer.status == Status::kOverlap && answer.distance == 0;  // as its gradient
  row.rate = is_flat ? 0 : rate_of(chains.side, answer.normal);
  if ((plan_.size.fields & (kSecondOrderFields & ~kFieldRate)) == 0) return row;
  const bool has_parts = !is_flat && !has_surface(a) && !has_surface(b) && answer.part_a < a.parts.size() &&
                         answer.part_b < b.parts.size();
  const bool wants_radius = (plan_.size.fields & kFieldSmoothRadius) != 0;
  const auto features = has_parts ? features_of(a, pose_a, b, pose_b, answer, wants_radius, meter) : std::nullopt;
  if (plan_.size.fields & kFieldRateBounds) {
    const Interval bounds = bound_rate(placement, pair, answer, features, chains, meter);
    row.rate_lower = bounds.lower;
    row.rate_upper = bounds.upper;
  }
  if (!features) return row;
  find_movers(placement, configuration, pose_a.t_w + features->point_a(), pose_a.t_w + features->point_b(), chains);
  row.rate = rate_of(chains.side, features->normal());
  if (wants_hessian && !is_current_) std::fill(row.hessian_joints.begin(), row.hessian_joints.end(), 0.0);
  if (plan_.size.fields & (kFieldCurvature | kFieldHessianJoints)) combine(*features, chains, row, meter);
  if (wants_radius)
    row.smooth_radius =
        radius_among_parts(a, pose_a, b, pose_b, answer,
                           features->distance() - a.parts[answer.part_a]->radius - b.parts[answer.part_b]->radius,
                           features->smooth_radius(), meter);
  return row;
}

}  // namespace clearance
