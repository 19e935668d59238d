// Distances of hulls by the affine hulls of their points, in any arithmetic: an oracle of derivatives.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "tests/engine/robot/exact_robot.h"

namespace clearance::exact {

using test::Real;
using test::RealFrame;
using RealPoint = Vec3<Real>;

// Points of two cores, at most three of each, whose affine hulls are nearest.
struct Spans {
  std::vector<Vec3d> a, b;
};

template <class T>
Vec3<T> moved(const RealFrame& X, const Vec3d& v) {
  T out[3];
  for (int i = 0; i < 3; ++i)
    out[i] = static_cast<T>(Real(X.R[i][0] * v.x + X.R[i][1] * v.y + X.R[i][2] * v.z + X.t.x[i]));
  return {out[0], out[1], out[2]};
}

// Distance of the affine hulls of points, and the least weight of a point in the nearest ones. Gauss on the normal
// equations of |r + W z|.
template <class T>
T distance_of(const std::vector<Vec3<T>>& a, const std::vector<Vec3<T>>& b, double* least_weight = nullptr) {
  std::vector<Vec3<T>> w;
  for (std::size_t i = 1; i < b.size(); ++i) w.push_back(b[i] - b[0]);
  for (std::size_t i = 1; i < a.size(); ++i) w.push_back(a[0] - a[i]);
  const Vec3<T> r = b[0] - a[0];
  const std::size_t n = w.size();
  T m[4][5];
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) m[i][j] = dot(w[i], w[j]);
    m[i][n] = -dot(w[i], r);
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) {
      if (i == j) continue;
      const T f = m[j][i] / m[i][i];
      for (std::size_t k = 0; k <= n; ++k) m[j][k] -= f * m[i][k];
    }
  Vec3<T> nearest = r;
  T left_b(1), left_a(1);
  double least = 1;
  for (std::size_t i = 0; i < n; ++i) {
    const T z = m[i][n] / m[i][i];
    nearest = nearest + w[i] * z;
    (i + 1 < b.size() ? left_b : left_a) -= z;
    least = std::min(least, static_cast<double>(z));
  }
  if (least_weight) *least_weight = std::min({least, static_cast<double>(left_a), static_cast<double>(left_b)});
  using std::sqrt;
  const T square = dot(nearest, nearest);
  return sqrt(square);
}

inline void subsets(const std::vector<Vec3d>& points, std::size_t most, std::vector<std::vector<std::size_t>>& out) {
  const std::size_t n = points.size();
  for (std::size_t i = 0; i < n; ++i) {
    out.push_back({i});
    for (std::size_t j = i + 1; most > 1 && j < n; ++j) {
      out.push_back({i, j});
      for (std::size_t k = j + 1; most > 2 && k < n; ++k) out.push_back({i, j, k});
    }
  }
}

// Calls visit(spans, distance, least weight) for vertices, edges and triangles of two sets of points, which include the
// hulls' own.
template <class Visit>
void for_each_spans(const std::vector<Vec3d>& a, const RealFrame& X_a, const std::vector<Vec3d>& b,
                    const RealFrame& X_b, Visit&& visit) {
  std::vector<Vec3d> at_a, at_b;
  for (const Vec3d& v : a) at_a.push_back(moved<double>(X_a, v));
  for (const Vec3d& v : b) at_b.push_back(moved<double>(X_b, v));
  std::vector<std::vector<std::size_t>> of_a, of_b;
  subsets(a, 3, of_a);
  subsets(b, 3, of_b);
  for (const auto& i : of_a)
    for (const auto& j : of_b) {
      if (i.size() + j.size() > 4) continue;
      Spans s;
      std::vector<Vec3d> p, q;
      for (const std::size_t k : i) p.push_back(at_a[k]), s.a.push_back(a[k]);
      for (const std::size_t k : j) q.push_back(at_b[k]), s.b.push_back(b[k]);
      double weight = 0;
      const double d = distance_of(p, q, &weight);
      visit(s, d, weight);
    }
}

// The nearest spans of two hulls.
inline Spans nearest_spans(const std::vector<Vec3d>& a, const RealFrame& X_a, const std::vector<Vec3d>& b,
                           const RealFrame& X_b) {
  Spans best;
  double least = std::numeric_limits<double>::infinity();
  for_each_spans(a, X_a, b, X_b, [&](const Spans& s, double d, double weight) {
    // Of equal ones that with the fewest points counts: it came first, or its weights are not above 0.
    if (weight > 1e-9 && d < least - 1e-12) least = d, best = s;
  });
  return best;
}

inline Real real_distance(const Spans& s, const RealFrame& X_a, const RealFrame& X_b) {
  std::vector<RealPoint> a, b;
  for (const Vec3d& v : s.a) a.push_back(moved<Real>(X_a, v));
  for (const Vec3d& v : s.b) b.push_back(moved<Real>(X_b, v));
  return distance_of(a, b);
}

}  // namespace clearance::exact
