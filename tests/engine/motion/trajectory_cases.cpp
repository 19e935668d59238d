// Trajectories that overshoot their knots, for motion_cases.h.
#include "tests/engine/motion/motion_cases.h"

namespace clearance::test {

namespace {

// A control point from the differences of those at an end: at place `i` from there.
double point_of(const std::vector<double>& differences, std::uint32_t i, double way) {
  double sum = 0, choose = 1;
  for (std::uint32_t k = 0; k <= i && k < differences.size(); ++k) {
    sum += choose * differences[k];
    choose *= way * static_cast<double>(i - k) / static_cast<double>(k + 1);
  }
  return sum;
}

// Derivative of a curve, apart from a factor.
double rate_at(const double* points, std::uint32_t count, std::size_t stride, double t) {
  double p[8] = {};
  for (std::uint32_t i = 0; i + 1 < count; ++i) p[i] = points[(i + 1) * stride] - points[i * stride];
  for (std::uint32_t left = count - 2; left > 0; --left)
    for (std::uint32_t i = 0; i < left; ++i) p[i] += t * (p[i + 1] - p[i]);
  return p[0];
}

}  // namespace

// A spline of degree 3, 5 or 7 with a second for each segment: its derivatives are continuous, and at knots so large that
// it overshoots. Sometimes all but one of its joints stand still.
void MotionCase::add_trajectory(int segments) {
  const std::uint32_t order = 2 + static_cast<std::uint32_t>(random_.below(3)), points = 2 * order;
  const std::size_t joints = motions.joints.size(), only = random_.below(joints);
  const bool is_alone = random_.below(2) != 0;
  const double size = std::pow(10.0, random_.uniform(-2, 0.3));
  motions.points = points;
  motions.positions.resize(static_cast<std::size_t>(segments) * points * joints);
  for (std::size_t j = 0; j < joints; ++j) {
    std::vector<double> from, to;
    const double start = random_.uniform(-1.5, 1.5);
    for (int s = -1; s < segments; ++s) {
      from = to;
      to.assign(order, 0);
      to[0] = start;
      const bool moves = !is_alone || j == only;
      for (std::uint32_t k = 0; moves && k < order; ++k) to[k] += size * random_.uniform(-1, 1) / (k + 1);
      for (std::uint32_t i = 0; s >= 0 && i < order; ++i) {
        double* const first = &motions.positions[static_cast<std::size_t>(s) * points * joints + j];
        first[i * joints] = point_of(from, i, 1);
        first[(points - 1 - i) * joints] = point_of(to, i, -1);
      }
    }
  }
  for (int s = 0; s < segments; ++s) {
    turns_.push_back(false);
    named.push_back(random_.uniform(0, 1));
    if (random_.below(3) != 0) name_turn(static_cast<std::uint32_t>(s), only);
    turns_.back() = turns_.back() && is_alone;
  }
}

// Names a time at which a joint turns back, if there is one.
void MotionCase::name_turn(std::uint32_t segment, std::size_t joint) {
  const std::size_t joints = motions.joints.size();
  const double* const first = &motions.positions[segment * motions.points * joints + joint];
  const auto rate = [&](double t) { return rate_at(first, motions.points, joints, t); };
  constexpr int kSteps = 32;
  for (int i = 0; i < kSteps; ++i) {
    double low = static_cast<double>(i) / kSteps, high = low + 1.0 / kSteps;
    if (!(rate(low) * rate(high) < 0)) continue;
    while (high - low > 1e-14) {
      const double middle = 0.5 * (low + high);
      (rate(low) * rate(middle) <= 0 ? high : low) = middle;
    }
    named[segment] = high;
    turns_[segment] = true;
    return;
  }
}

}  // namespace clearance::test
