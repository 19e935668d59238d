// Deviation of placed links from their poses in real arithmetic: docs/trust/bounds_robots.md, "Kinematics", step by
// step.
#include <algorithm>
#include <cmath>

#include "engine/base/fp_environment.h"
#include "engine/base/placement_error.h"
#include "engine/robot/kinematics.h"

namespace clearance {

namespace {

constexpr double kUnit = 0x1p-53;
constexpr double kSinCosUnits = 1.25;  // of sine, and of cosine: sin_cos.h
constexpr double kTurnedUnits = 20;    // rotating an offset by a computed frame, relative to its length
constexpr double kConstant = 0x1p-80;  // relative error of constants before rounding; 2^-90 at most
constexpr double kSlack = kPlacementSlack;

bool is_power_of_two(double x) {
  int exponent = 0;
  return std::abs(std::frexp(x, &exponent)) == 0.5;
}

// The part of a quaternion whose products are rounded: its components other than 0 and powers of two.
double rounded_part(const Quaternion<double>& q) {
  double sum = 0;
  for (const double x : {q.w, q.x, q.y, q.z})
    if (!is_power_of_two(x)) sum += x * x;
  return std::sqrt(sum);
}

double length_of(const Vec3d& v) {
  return std::hypot(v.x, v.y, v.z) * kSlack;
}

}  // namespace

double PlacementError::at(double travel, double distance) const {
  return placement_error(fixed, per_travel, travel, per_distance, distance);
}

Kinematics::StepError Kinematics::error_of(const KinematicStep& step, double inexact_turn, double inexact_shift,
                                           double inexact_along) const {
  using Kind = KinematicStep::Kind;
  const Quaternion<double>&a = step.still, &b = step.turning;
  const double *pa = &a.w, *pb = &b.w;
  int terms = 0;
  bool sums = false;
  for (int k = 0; k < 4; ++k) {
    terms += pa[k] != 0 || pb[k] != 0;
    sums = sums || (pa[k] != 0 && pb[k] != 0);
  }
  double units = 0;  // of the quaternion, relative to its length
  if (step.kind == Kind::kTurning || step.kind == Kind::kPlanar)
    units += kSinCosUnits * std::sqrt(2.0) + std::hypot(rounded_part(a), rounded_part(b)) + (sums ? 1 : 0);
  const double products = std::sqrt(terms);
  units += terms == 1 ? 1 : terms == 2 ? products + 1 : 2 * products + 1;  // product with the parent's frame
  units += 1;                                                              // normalisation

  StepError error;
  error.turn = 2 * (inexact_turn + kConstant + units * kUnit);
  error.length = length_of(step.at);
  error.length_travel = length_of(step.along[0]) + length_of(step.along[1]);
  error.shift = inexact_shift + kConstant * error.length + kTurnedUnits * kUnit * error.length;
  if (step.kind == Kind::kSliding || step.kind == Kind::kPlanar) {
    // Two products and sums; a mimic joint's position has an error of 2 units and one of its offset before.
    const double factor = step.mimics ? 5 : 3;
    error.shift += 2 * kUnit * error.length + (step.mimics ? kUnit * std::abs(step.offset) : 0);
    error.shift_travel = 2 * (inexact_along + kConstant) + (factor + 1 + kTurnedUnits) * kUnit * error.length_travel;
  }
  return error;
}

// Sums the steps from a frame to a link: rotation errors act on all steps after them.
PlacementError Kinematics::error_along(std::uint32_t link, std::uint32_t from_frame, double radius) const {
  const auto roots = static_cast<std::uint32_t>(roots_.size());
  std::vector<std::uint32_t> path;
  for (std::uint32_t frame = nodes_[link].frame; frame != from_frame; frame = carrier(frame))
    path.push_back(frame - roots);
  PlacementError error;
  if (path.empty()) return error;
  double turn = from_frame < roots ? 2 * kUnit : 0;  // a root's quaternion is normalised
  for (auto at = path.rbegin(); at != path.rend(); ++at) {
    const StepError& step = step_errors_[*at];
    const Node& node = nodes_[steps_[*at].link];
    error.fixed += turn * step.length + step.shift;
    error.per_travel += turn * step.length_travel + step.shift_travel;
    turn += step.turn;
    if (step.length == 0 && step.length_travel == 0) continue;  // the sum is exact
    error.fixed += kUnit * node.length;
    error.per_travel += kUnit * node.length_travel;
    error.per_distance += kUnit;
  }
  error.fixed += turn * radius;
  return {error.fixed * kSlack, error.per_travel * kSlack, error.per_distance * kSlack, turn * kSlack};
}

PlacementError Kinematics::error(std::uint32_t link, double radius) const {
  const FpEnvironment environment;
  return error_along(link, root_of(link), radius);
}

std::uint32_t Kinematics::root_of(std::uint32_t link) const {
  std::uint32_t frame = nodes_[link].frame;
  while (frame >= roots_.size()) frame = carrier(frame);
  return frame;
}

PlacementError Kinematics::error_between(std::uint32_t a, double radius_a, std::uint32_t b, double radius_b) const {
  const FpEnvironment environment;
  const auto frames_of = [&](std::uint32_t link) {  // from the root on
    std::vector<std::uint32_t> frames = {nodes_[link].frame};
    while (frames.back() >= roots_.size()) frames.push_back(carrier(frames.back()));
    std::reverse(frames.begin(), frames.end());
    return frames;
  };
  const std::vector<std::uint32_t> to_a = frames_of(a), to_b = frames_of(b);
  std::size_t common = 0;
  while (common < to_a.size() && common < to_b.size() && to_a[common] == to_b[common]) ++common;
  const PlacementError of_a = error_along(a, to_a[common ? common - 1 : 0], radius_a);
  const PlacementError of_b = error_along(b, to_b[common ? common - 1 : 0], radius_b);
  return {of_a.fixed + of_b.fixed, of_a.per_travel + of_b.per_travel, of_a.per_distance + of_b.per_distance,
          of_a.turn + of_b.turn};
}

double Kinematics::travel(std::span<const double> positions) const {
  double most = 0;
  if (!slides_) return most;
  for (const KinematicStep& step : steps_)
    most = std::max(most, travel_of(step, [&](std::uint32_t column) { return positions[column]; }));
  return most;
}

void Kinematics::travels(std::span<const double> positions, std::span<double> links) const {
  std::fill(links.begin(), links.end(), 0.0);
  if (!slides_) return;
  for (const KinematicStep& step : steps_)
    links[step.link] =
        std::max(links[carrier_of(step)], travel_of(step, [&](std::uint32_t column) { return positions[column]; }));
}

double Kinematics::reach(std::uint32_t link, double radius) const {
  return nodes_[link].length + radius;
}

}  // namespace clearance
