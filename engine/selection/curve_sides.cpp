#include "engine/selection/curve_sides.h"

#include <algorithm>
#include <cmath>

namespace clearance {

namespace {

constexpr double kSideErrors = 8;         // error of a rest and of its chord, in errors of JointCurve::at()
constexpr double kSideUp = 1 + 0x1p-30;   // covers the rounding of sums and products
constexpr double kProgressPlaces = 1e6;   // progress is written as decimals
constexpr double kStepsOfLength = 0x1p4;  // at least as many in a span

double squared_distance(std::span<const double> p, std::span<const double> q) {
  double sum = 0;
  for (std::size_t j = 0; j < p.size(); ++j) sum += (p[j] - q[j]) * (p[j] - q[j]);
  return sum;
}

}  // namespace

void CurveSides::take(std::span<const JointCurve> curves, double begin, double time, double end) {
  curves_.assign(curves.size(), {});
  take_side(curves, time, begin, 0);
  take_side(curves, time, end, 1);
  for (std::size_t j = 0; j < curves.size(); ++j) {
    Curve& curve = curves_[j];
    const double error = kSideErrors * curves[j].rounding();
    curve.way = (curve.way + error) * kSideUp;
    curve.rest = (curve.rest + error) * kSideUp;
    curve.change = (std::max(std::abs(curve.chord[0]), std::abs(curve.chord[1])) + curve.rest) * kSideUp;
  }
}

// Progress is the projection on the chord.
void CurveSides::take_side(std::span<const JointCurve> curves, double time, double end, int side) {
  const std::size_t count = curves.size(), points = curves.empty() ? 0 : curves[0].degree() + 1;
  std::vector<double>& progress = progress_[side];
  progress.assign(points, 0);
  points_.resize(points * count);
  double squared = 0;
  for (std::size_t j = 0; j < count; ++j) {
    curves[j].from(time, end, points_.data() + j, count);
    const double chord = curves_[j].chord[side] = points_[(points - 1) * count + j];
    squared += chord * chord;
    for (std::size_t i = 0; i < points; ++i) progress[i] += chord * points_[i * count + j];
  }
  for (double& r : progress)
    r = squared > 0 ? std::round(std::clamp(r / squared, 0.0, 1.0) * kProgressPlaces) / kProgressPlaces : 0;
  for (std::size_t i = 0; i < points; ++i)
    for (std::size_t j = 0; j < count; ++j) {
      Curve& curve = curves_[j];
      const double p = points_[i * count + j];
      curve.way = std::max(curve.way, std::abs(p));
      curve.rest = std::max(curve.rest, std::abs(p - curve.chord[side] * progress[i]));
    }
}

double CurveSides::pace(int side) const {
  const std::vector<double>& progress = progress_[side];
  double step = 0;
  for (std::size_t i = 1; i < progress.size(); ++i) step = std::max(step, progress[i] - progress[i - 1]);
  const double fastest = static_cast<double>(progress.size() - 1) * step;
  return fastest > 1 ? (1 - 0x1p-30) / fastest : 1;
}

double middle_of_length(std::span<const JointCurve> curves, double begin, double end) {
  const double step = std::exp2(std::floor(std::log2((end - begin) / kStepsOfLength)));
  std::vector<double> times, lengths, last(curves.size()), next(curves.size());
  double length = 0;
  for (double t = begin; t < end;) {
    t = std::min((std::floor(t / step) + 1) * step, end);
    for (std::size_t j = 0; j < curves.size(); ++j) next[j] = curves[j].at(t);
    if (times.empty())
      for (std::size_t j = 0; j < curves.size(); ++j) last[j] = curves[j].at(begin);
    length += std::sqrt(squared_distance(last, next));
    times.push_back(t);
    lengths.push_back(length);
    std::swap(last, next);
  }
  const double half = 0.5 * begin + 0.5 * end;
  if (!(length > 0) || times.size() < 2) return half;
  const auto farther = std::lower_bound(lengths.begin(), lengths.end() - 1, 0.5 * length);
  auto at = std::min<std::ptrdiff_t>(farther - lengths.begin(), static_cast<std::ptrdiff_t>(times.size()) - 2);
  if (at > 0 && 0.5 * length - lengths[at - 1] < lengths[at] - 0.5 * length) --at;
  return times[at];
}

}  // namespace clearance
