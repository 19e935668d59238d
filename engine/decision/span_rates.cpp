#include "engine/decision/span_rates.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/decision/slack_bounds.h"

namespace clearance {

namespace {

constexpr double kUp = kMotionSlack;
constexpr double kFloatUnit = 0x1p-24;
constexpr double kTwistRounding = 0x1p-40;      // of a twist in float64, relative to the speed of points
constexpr double kTimeRounding = 14 * 0x1p-53;  // of q(t) for each degree of it, relative to the largest position

constexpr double kGivenRounding = 0x1p-46;  // of a given body's translation at a time, relative to the largest one

double greatest_travel(const SceneRobot& robot) {
  using Kind = KinematicStep::Kind;
  const auto slides = [](const KinematicStep& s) { return s.kind == Kind::kSliding || s.kind == Kind::kPlanar; };
  if (std::ranges::none_of(robot.kinematics.steps(), slides)) return 0;
  std::vector<double> limits;
  for (const RobotColumn& column : robot.model.columns) limits.push_back(most_travel(column));
  double most = robot.kinematics.travel(limits);
  for (double& limit : limits) limit = -limit;
  return std::max(most, robot.kinematics.travel(limits));
}

}  // namespace

SpanRates::SpanRates(const Plan& plan, std::span<const Source> sources, std::uint32_t body_count)
    : bodies_(body_count) {
  for (const LinkMotion& motion : plan.motions) travel_.push_back(greatest_travel(motion.robot()));
  for (const Source& source : sources) {
    if (source.given != kNone) {
      take_given(plan, source);
      continue;
    }
    const Kinematics& robot = plan.motions[source.robot].robot().kinematics;
    Body& body = bodies_[source.body];
    body.robot = &robot;
    body.link = source.link;
    body.ball = source.ball;
    body.path = {source.robot, source.path.movers()};
    body.reach = (norm(source.ball.centre) + source.ball.radius) * kUp;
    const PlacementError error = robot.error(source.link, body.reach);
    body.turn_error = error.turn;
    body.error = error.at(travel_[source.robot], 0) + rounding(plan, source);
    body.reach = (body.reach + robot.reach(source.link, body.reach) + 2 * travel_[source.robot]) * kUp;
  }
}

void SpanRates::take_given(const Plan& plan, const Source& source) {
  Body& body = bodies_[source.body];
  const double reach = (norm(source.ball.centre) + source.ball.radius) * kUp;
  body.path = {kNone, {}, source.given, reach};
  body.turn_error = kGivenTurnError;
  body.error = rounding(plan, source);
  body.reach = (reach + source.farthest) * kUp;
}

std::vector<SpanRates::View> SpanRates::views_of(const MovedPair& pair) const {
  const Body &a = bodies_[pair.a], &b = bodies_[pair.b];
  if (a.path.given != kNone && a.path.given == b.path.given) return {{{}, {}, pair.a}};  // rigid
  std::vector<View> views{{a.path, b.path, kNone}};
  if (!a.robot || !b.robot) return views;  // one stays
  const Kinematics& robot = *a.robot;
  if (a.path.robot != b.path.robot || robot.root_of(a.link) != robot.root_of(b.link)) return views;
  views.push_back({{}, {b.path.robot, MotionPath(robot, a.link, b.link, b.ball).movers()}, pair.a});
  views.push_back({{a.path.robot, MotionPath(robot, b.link, a.link, a.ball).movers()}, {}, pair.b});
  return views;
}

double SpanRates::rounding(const Plan& plan, const Source& source) {
  if (source.given != kNone)
    return (kGivenTurnError * (norm(source.ball.centre) + source.ball.radius) + kGivenRounding * source.farthest) * kUp;
  const SceneRobot& robot = plan.motions[source.robot].robot();
  const double by = (plan.query.control_points - 1) * kTimeRounding * kMostPosition * kUp,
               travel = greatest_travel(robot);
  double sum = 0;
  for (const Mover& mover : source.path.movers()) sum += way_of_mover(mover, travel) * by;
  return sum * kUp;
}

MotionRates SpanRates::rates(const Path& path, const Changes& changes) const {
  if (path.given != kNone) {
    const Given& by = changes.given[path.given];
    return {(by.shift + path.reach * by.turn) * kUp, (path.reach * by.turn * by.turn + by.bend) * kUp, by.turn};
  }
  if (path.movers.empty()) return {};
  const auto of = [&](const std::vector<std::vector<double>>& change) {
    const auto of_column = [&](std::uint32_t column) { return change[path.robot][column]; };
    return rates_of_path(path.movers.data(), path.movers.size(), of_column, travel_[path.robot], 0);
  };
  MotionRates result = of(changes.change);
  if (!changes.bend.empty()) result.acceleration = (result.acceleration + of(changes.bend).speed) * kUp;
  return result;
}

SpanRates::Rates SpanRates::of(std::uint32_t body, const Changes& changes) const {
  const Body& b = bodies_[body];
  Rates result{rates(b.path, changes), 0};
  result.twist_error =
      ((kTwistRounding + 4 * b.turn_error + 64 * kFloatUnit) * (result.motion.speed + result.motion.turn * b.reach) +
       4 * result.motion.turn * b.error) *
      kUp;
  return result;
}

SpanRates::PairRates SpanRates::of_pair(std::span<const View> views, const Changes& changes) const {
  PairRates best{HUGE_VAL, HUGE_VAL, kNone};
  for (const View& view : views) {
    const MotionRates a = rates(view.a, changes), b = rates(view.b, changes);
    best.speed = std::min(best.speed, (a.speed + b.speed) * kUp);
    if (const double acceleration = (a.acceleration + b.acceleration) * kUp; acceleration < best.acceleration)
      best.acceleration = acceleration, best.seer = view.seer;
  }
  return best;
}

}  // namespace clearance
