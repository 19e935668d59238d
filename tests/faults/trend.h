// Linear fit of samples, to detect growth.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace clearance::faults {

struct Trend {
  double slope = 0;           ///< by least squares
  double standard_error = 0;  ///< of the slope
};

/// Zero for fewer than three samples.
inline Trend trend_of(const std::vector<double>& x, const std::vector<double>& y) {
  Trend trend;
  const auto n = static_cast<double>(x.size());
  if (x.size() < 3) return trend;
  double mean_x = 0, mean_y = 0, xx = 0, xy = 0, rest = 0;
  for (std::size_t i = 0; i < x.size(); ++i) mean_x += x[i] / n, mean_y += y[i] / n;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xx += (x[i] - mean_x) * (x[i] - mean_x);
    xy += (x[i] - mean_x) * (y[i] - mean_y);
  }
  if (xx <= 0) return trend;
  trend.slope = xy / xx;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double off = y[i] - mean_y - trend.slope * (x[i] - mean_x);
    rest += off * off;
  }
  trend.standard_error = std::sqrt(rest / (n - 2) / xx);
  return trend;
}

}  // namespace clearance::faults
