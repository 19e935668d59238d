#include "engine/decision/given_motions.h"

#include <algorithm>
#include <cmath>

namespace clearance {

namespace {

constexpr double kUp = kMotionSlack;

void normalize(Pose& X) {
  const double length = detail::quaternion_norm(X);
  for (double* q : {&X.qw, &X.qx, &X.qy, &X.qz}) *q /= length;
}

}  // namespace

bool GivenMotions::begin(const CoverPlan& covers, std::uint64_t motion) {
  const std::size_t points = plan_.query.control_points, bodies = plan_.given_bodies;
  first_ = points * motion;
  motions_.clear();
  growths_.clear();
  const std::span<const Pose> poses = plan_.configurations.subspan(first_ * bodies, points * bodies);
  for (std::size_t p = 0; p < points; ++p) {
    poses_.assign(poses.begin() + static_cast<std::ptrdiff_t>(p * bodies),
                  poses.begin() + static_cast<std::ptrdiff_t>((p + 1) * bodies));
    if (!covers.take_given(poses_)) return false;
    for (const Pose& X : poses_)
      if (!(norm(X.translation) <= kMaxPosition)) return false;  // CurveSpan has no bounds for it
  }
  for (std::size_t i = 0; i < bodies; ++i) {
    motions_.emplace_back(poses[i], poses[points > 2 ? i : bodies + i]);
    if (motions_.back().is_half_turn() || !(motions_.back().turn_error() <= SpanRates::kGivenTurnError)) return false;
    if (!plan_.growths.empty())
      growths_.emplace_back(plan_.growths.data() + first_ * bodies + i, static_cast<std::uint32_t>(points), bodies);
  }
  return true;
}

double GivenMotions::length() const {
  double sum = 0;
  for (const BodyMotion& motion : motions_) sum += motion.shift() + motion.turn();
  for (const JointCurve& growth : growths_) sum += growth.length();
  return sum;
}

void GivenMotions::append_to(std::vector<JointCurve>& curves) {
  const std::size_t points = plan_.query.control_points, bodies = plan_.given_bodies;
  for (std::size_t i = 0; i < bodies; ++i) {
    const Vec3d& start = plan_.configurations[first_ * bodies + i].translation;
    for (const double* coordinate : {&start.x, &start.y, &start.z})
      curves.emplace_back(coordinate, static_cast<std::uint32_t>(points), bodies * (sizeof(Pose) / sizeof(double)));
  }
  curves.insert(curves.end(), growths_.begin(), growths_.end());
}

void GivenMotions::place(double time, std::span<const JointCurve> curves, Pose* poses) const {
  for (std::size_t i = 0; i < motions_.size(); ++i) {
    poses[i] = motions_[i].at(time);
    normalize(poses[i]);
    if (curves.empty()) continue;
    const JointCurve* const by = &curves[plan_.joints.size() + 3 * i];
    poses[i].translation = {by[0].at(time), by[1].at(time), by[2].at(time)};
  }
}

void GivenMotions::take_span(std::span<const JointSpan> columns, std::vector<SpanRates::Given>& given) {
  const std::size_t bodies = motions_.size(), joints = plan_.joints.size();
  given.resize(bodies);
  for (std::size_t i = 0; i < bodies; ++i) {
    if (columns.empty()) {
      given[i] = {motions_[i].shift(), motions_[i].turn(), 0};
      spans_[i].shift = motions_[i].along();
      if (!growths_.empty()) spans_[i].growth = growths_[i].length() * kUp;
      continue;
    }
    const JointSpan* const by = &columns[joints + 3 * i];
    given[i] = {std::hypot(by[0].change, by[1].change, by[2].change) * kUp, 0,
                std::hypot(by[0].bend, by[1].bend, by[2].bend) * kUp};
    spans_[i].shift = {by[0].slope, by[1].slope, by[2].slope};
    if (!growths_.empty()) spans_[i].growth = columns[joints + 3 * bodies + i].change;
  }
}

Twist GivenMotions::twist(std::uint32_t body, const Pose& X) const {
  const BodyMotion& motion = motions_[body];
  const Quaternion<double> q{X.qw, X.qx, X.qy, X.qz};
  return {turned(q, motion.axis() * motion.angle()), spans_[body].shift};
}

double GivenMotions::growth(std::uint32_t body, double middle, double half) const {
  if (body >= growths_.size()) return 0;
  return (growths_[body].at(middle) + growths_[body].rounding() + spans_[body].growth * half) * kUp;
}

double GivenMotions::least_growth(std::uint32_t body, double time) const {
  if (body >= growths_.size()) return 0;
  return std::max(growths_[body].at(time) - growths_[body].rounding(), 0.0) / kUp;
}

}  // namespace clearance
