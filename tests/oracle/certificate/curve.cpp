#include "tests/oracle/certificate/curve.h"

#include <algorithm>

namespace clearance::certificate_oracle {
namespace {

// Polar form of a curve: for each of as many times as its degree, of which the first `ends` are `end`, and the others
// `begin`.
Dyadic polar(std::vector<Dyadic> points, double begin, double end, std::size_t ends) {
  for (std::size_t level = 0; points.size() > 1; ++level) {
    const Dyadic time = level < ends ? end : begin, before = Dyadic(1.0) - time;
    for (std::size_t i = 0; i + 1 < points.size(); ++i) points[i] = before * points[i] + time * points[i + 1];
    points.pop_back();
  }
  return points.front();
}

Dyadic longest(const std::vector<Dyadic>& values) {
  Dyadic most;
  for (const Dyadic& value : values) most = std::max(most, abs(value));
  return most;
}

}  // namespace

bool Curve::is_still() const {
  return std::all_of(points_.begin(), points_.end(), [&](const Dyadic& p) { return p == points_.front(); });
}

Curve Curve::derivative() const {
  const Dyadic degree = static_cast<double>(points_.size() - 1);
  std::vector<Dyadic> steps;
  for (std::size_t i = 0; i + 1 < points_.size(); ++i) steps.push_back(degree * (points_[i + 1] - points_[i]));
  if (steps.empty()) steps.emplace_back();
  return Curve(std::move(steps));
}

Dyadic Curve::at(double time) const {
  return polar(points_, time, time, 0);
}

Dyadic Curve::rate(double time) const {
  return derivative().at(time);
}

std::vector<Dyadic> Curve::points_between(double begin, double end) const {
  std::vector<Dyadic> between;
  for (std::size_t k = 0; k < points_.size(); ++k) between.push_back(polar(points_, begin, end, k));
  return between;
}

CurveExtent Curve::extent(double begin, double end) const {
  const auto [places, first, second] = hulls(begin, end);
  return {*std::min_element(places.begin(), places.end()), *std::max_element(places.begin(), places.end()),
          longest(first), longest(second)};
}

std::array<std::vector<Dyadic>, 3> Curve::hulls(double begin, double end) const {
  const Curve first = derivative();
  return {points_between(begin, end), first.points_between(begin, end), first.derivative().points_between(begin, end)};
}

}  // namespace clearance::certificate_oracle
