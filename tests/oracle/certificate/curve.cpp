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

}  // namespace

bool Curve::is_still() const {
  return std::all_of(points_.begin(), points_.end(), [&](const Dyadic& p) { return p == points_.front(); });
}

Dyadic Curve::at(double time) const {
  return polar(points_, time, time, 0);
}

std::vector<Dyadic> Curve::way(double time, double end) const {
  const Dyadic place = at(time);
  std::vector<Dyadic> way;
  for (std::size_t k = 0; k < points_.size(); ++k) way.push_back(polar(points_, time, end, k) - place);
  return way;
}

}  // namespace clearance::certificate_oracle
