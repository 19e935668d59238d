// Compiled with -ffp-contract=off: a fused multiply-add outside the derivation would void it.
#include "engine/narrow/certify.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "engine/hull/primitive.h"
#include "engine/narrow/overlap.h"

namespace clearance {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
// The double just below or above a value of T, so that a conversion never tightens a bound. A double is returned as it
// is, since its own rounding is part of the error terms.
double round_down(double x) {
  return x;
}
double round_up(double x) {
  return x;
}
double round_down(const DoubleDouble& x) {
  return std::nextafter(x.hi, -kInf);
}
double round_up(const DoubleDouble& x) {
  return std::nextafter(x.hi, kInf);
}

template <class T>
Vec3d to_double(const Vec3<T>& v) {
  return cast<double>(v);
}

// D = t_b - t_a. In double-double the difference of two doubles is exact.
Vec3<double> difference(const Vec3d& b, const Vec3d& a, double) {
  return b - a;
}
Vec3<DoubleDouble> difference(const Vec3d& b, const Vec3d& a, DoubleDouble) {
  return {dd::two_sum(b.x, -a.x), dd::two_sum(b.y, -a.y), dd::two_sum(b.z, -a.z)};
}

double sum(double a, double b, double) {
  return a + b;
}
DoubleDouble sum(double a, double b, DoubleDouble) {
  return dd::two_sum(a, b);
}

}  // namespace

template <class T>
SupportPoint<T> CorePoints<T>::farthest(const Vec3<T>& n) {
  if (found_.empty()) return support(*part_, n);
  const FarthestPoint<T> far = clearance::farthest(*part_->primitive, n);
  const auto same = [&](const Vec3<T>& p) { return p.x == far.point.x && p.y == far.point.y && p.z == far.point.z; };
  const auto known = std::find_if(found_.begin(), found_.end(), same);
  const auto index = static_cast<std::uint32_t>(known - found_.begin());
  if (known == found_.end()) found_.push_back(far.point);
  return {index, far.value};
}

template <class T>
PlacedPair<T>::PlacedPair(const ConvexPart& part_a, const Mat3<T>& R_a, const Vec3d& t_a, const ConvexPart& part_b,
                          const Mat3<T>& R_b, const Vec3d& t_b)
    : a(&part_a),
      b(&part_b),
      R_wa(R_a),
      R_wb(R_b),
      R(R_a.transpose_times(R_b)),
      D(R_a.transpose_times(difference(t_b, t_a, T()))),
      points_a(part_a),
      points_b(part_b) {
  radius = sum(part_a.radius, part_b.radius, T());
  scale = pair_scale<double>(to_double(D), part_a.rho, part_b.rho, part_a.radius + part_b.radius);
}

template <class T>
double PlacedPair<T>::error(double units) const {
  if (is_round()) units += kRoundUnits;
  return rounding_error(units * Arithmetic<T>::kUnit / Arithmetic<double>::kUnit, scale);
}

template <class T>
double certify_lower(const PlacedPair<T>& pair, const T& gap, const T& length) {
  if (!(length > T(0))) return -kInf;
  const double lower = round_down(lower_from_gap(gap, length, pair.radius, T(pair.lower_error())));
  return std::isnan(lower) ? -kInf : lower;
}

template <class T>
double certify_lower(const PlacedPair<T>& pair, const Vec3<T>& direction) {
  const Vec3<T> n = rescaled(direction);
  const SupportPoint<T> sa = support(*pair.a, n);
  const SupportPoint<T> sb = support(*pair.b, -pair.R.transpose_times(n));
  return certify_lower(pair, dot(n, pair.D) - (sa.value + sb.value), norm(n));
}

template <class T>
Witness certify_upper(const PlacedPair<T>& pair, const Simplex<T>& proposed) {
  assert(proposed.size >= 0 && proposed.size <= 4);
  Simplex<T> simplex = proposed;
  if (simplex.size == 0) {
    simplex.size = 1;
    simplex.vertex[0].a = simplex.vertex[0].b = 0;
  }
  assert(std::all_of(simplex.vertex, simplex.vertex + simplex.size,
                     [&](const auto& v) { return v.a < pair.points_a.size() && v.b < pair.points_b.size(); }));
  for (int i = 0; i < simplex.size; ++i)
    simplex.vertex[i].w = pair.cso_vertex(simplex.vertex[i].a, simplex.vertex[i].b);
  const CsoPoint<T> point(
      simplex, pair.R_wa, [&](std::uint32_t k) { return pair.points_a[k]; }, pair.R_wb,
      [&](std::uint32_t k) { return pair.points_b[k]; });
  const double upper = round_up(upper_from_point(norm(point.w), pair.radius, T(pair.upper_error())));
  return {std::isnan(upper) ? kInf : upper, to_double(point.core_a), to_double(point.core_b),
          to_double(point.separation), norm(to_double(point.w))};
}

// Along its normal the half-space reaches to 0, and along every other direction without end. No other gap is larger, so
// that the gap that certify_lower() proves is an upper bound, too.
template <class T>
PlaneBounds certify_plane(const PlacedPair<T>& pair, bool signed_distance) {
  assert(is_half_space(*pair.a) && !is_half_space(*pair.b));
  const Vec3<T> n{T(0), T(0), T(1)};
  const SupportPoint<T> deepest = pair.points_b.farthest(-pair.R.transpose_times(n));
  const T gap = pair.D.z - deepest.value, error(pair.lower_error());
  const Vec3<T> p_b = pair.points_b[deepest.index], p = pair.R * p_b + pair.D;
  const bool common = !signed_distance && !(p.z > T(0));
  const Vec3<T> foot = common ? p : Vec3<T>{p.x, p.y, T(0)}, separation = p - foot;
  PlaneBounds out;
  out.bounds = {round_down(lower_from_gap(gap, T(1), pair.radius, error)),
                round_up(upper_from_point(gap, pair.radius, error))};
  if (std::isnan(out.bounds.lower) || std::isnan(out.bounds.upper)) out.bounds = {-kInf, kInf};
  out.nearest = {out.bounds.upper, to_double(pair.R_wa * foot), to_double(pair.R_wb * p_b),
                 to_double(pair.R_wa * separation), norm(to_double(separation))};
  return out;
}

template <class T>
double certify_ball(const PlacedPair<T>& pair, std::span<const CsoVertex<T>> vertices,
                    std::span<const CsoFace<T>> faces) {
  assert(std::all_of(faces.begin(), faces.end(), [&](const CsoFace<T>& face) {
    return std::all_of(face.vertex.begin(), face.vertex.end(), [&](std::uint32_t v) { return v < vertices.size(); });
  }));
  std::vector<Vec3<T>> w(vertices.size());
  for (std::size_t i = 0; i < w.size(); ++i) w[i] = pair.cso_vertex(vertices[i].a, vertices[i].b);
  const ProvedBall<T> proved(w.data(), faces.data(), faces.size(), T(pair.scale));
  if (!proved) return -kInf;
  const double radius = round_down(proved.ball - T(pair.ball_error()));
  return radius > 0 ? radius : -kInf;
}

double certify_overlap(const ConvexPart& a, const ConvexPart& b, double ball) {
  assert(ball > 0);
  return upper_of_overlap(a.radius, b.radius, ball);
}

#define CLEARANCE_INSTANTIATE(T)                                           \
  template class CorePoints<T>;                                            \
  template struct PlacedPair<T>;                                           \
  template double certify_lower(const PlacedPair<T>&, const T&, const T&); \
  template double certify_lower(const PlacedPair<T>&, const Vec3<T>&);     \
  template Witness certify_upper(const PlacedPair<T>&, const Simplex<T>&); \
  template PlaneBounds certify_plane(const PlacedPair<T>&, bool);          \
  template double certify_ball(const PlacedPair<T>&, std::span<const CsoVertex<T>>, std::span<const CsoFace<T>>)
CLEARANCE_INSTANTIATE(double);
CLEARANCE_INSTANTIATE(DoubleDouble);
#undef CLEARANCE_INSTANTIATE

}  // namespace clearance
