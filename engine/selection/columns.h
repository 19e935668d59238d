// Writes answers to the caller's columns. For host and device.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/narrow/answer.h"
#include "engine/selection/query.h"

namespace clearance {

/// Second derivatives of one row. NaN where there are none.
struct SecondOrderRow {
  double rate = __builtin_nan("");           ///< m/s
  double curvature = __builtin_nan("");      ///< m/s^2
  double smooth_radius = __builtin_nan("");  ///< metres
  double rate_lower = -__builtin_inf();      ///< m/s
  double rate_upper = __builtin_inf();       ///< m/s
  std::vector<double> hessian_joints{};      ///< (J, J), or empty if not requested
};

/// An answer with its pair, its configuration and the origins of the bodies.
struct Row {
  BodyPair pair;
  std::uint32_t configuration = 0;
  PairAnswer answer;
  Vec3d origin_a{0, 0, 0}, origin_b{0, 0, 0};  ///< world frame
  BodyPair pair_lower{kNone, kNone};           ///< pair of the answer's lower bound
  std::vector<double> gradient_joints{};       ///< (J,), or empty if not requested
  SecondOrderRow second{};
};

namespace detail {

// One coordinate at a time: a loop would pass a sum through memory, and wait for it there.
CLEARANCE_HD inline void write(double* column, std::uint64_t index, const Vec3d& v) {
  column[3 * index] = v.x;
  column[3 * index + 1] = v.y;
  column[3 * index + 2] = v.z;
}

// The nearest float on the outer side of x, so that the interval only grows.
CLEARANCE_HD inline float float_below(double x) {
#ifdef __CUDA_ARCH__
  return __double2float_rd(x);
#endif
  const float f = static_cast<float>(x);
  return f > x ? nextafterf(f, -__builtin_inff()) : f;
}
CLEARANCE_HD inline float float_above(double x) {
#ifdef __CUDA_ARCH__
  return __double2float_ru(x);
#endif
  const float f = static_cast<float>(x);
  return f < x ? nextafterf(f, __builtin_inff()) : f;
}

/// A float32 interval that contains the answer's.
struct OuterBounds {
  float lower, upper;

  CLEARANCE_HD explicit OuterBounds(const PairAnswer& a) : lower(float_below(a.lower)), upper(float_above(a.upper)) {
    if (!(lower <= a.lower)) lower = -__builtin_inff();  // if rounding is broken
    if (!(upper >= a.upper)) upper = __builtin_inff();
  }
};

CLEARANCE_HD inline void write(float* column, std::uint64_t index, const Vec3d& v) {
  column[3 * index] = static_cast<float>(v.x);
  column[3 * index + 1] = static_cast<float>(v.y);
  column[3 * index + 2] = static_cast<float>(v.z);
}

// d distance / d twist (angular in world axes; linear of the body's origin): the distance is n . (p_b - p_a), and each
// point moves with its body. It stays 0 for overlapping bodies without a depth.
CLEARANCE_HD inline void write_gradient(double* g, const PairAnswer& a) {
  const bool flat = a.status == Status::kOverlap && a.distance == 0;
  const Vec3d turn_a = -cross(a.point_a, a.normal), turn_b = cross(a.point_b, a.normal);
  for (int k = 0; k < 3; ++k) {
    g[k] = flat ? 0 : turn_a[k];
    g[3 + k] = flat ? 0 : -a.normal[k];
    g[6 + k] = flat ? 0 : turn_b[k];
    g[9 + k] = flat ? 0 : a.normal[k];
  }
}

// Of a row of Reduce::kAny. Whether a pair that is proved within its margin overlaps makes no difference.
CLEARANCE_HD inline Status verdict_of(Status status) {
  return status == Status::kOverlap || status == Status::kContact ? Status::kOk : status;
}

}  // namespace detail

/// Writes one row of the columns of kDefaultFields, kFieldBounds and kFieldVerdict that exist.
CLEARANCE_HD inline void write_interval(const ReplyView& reply, std::uint64_t index, const PairAnswer& a) {
  if (reply.distance) reply.distance[index] = a.distance;
  if (reply.lower) reply.lower[index] = a.lower;
  if (reply.upper) reply.upper[index] = a.upper;
  if (reply.status) reply.status[index] = static_cast<std::uint8_t>(a.status);
  if (reply.verdict) reply.verdict[index] = static_cast<std::uint8_t>(detail::verdict_of(a.status));
  if (!reply.bounds) return;
  const detail::OuterBounds bounds(a);
  reply.bounds[2 * index] = bounds.lower;
  reply.bounds[2 * index + 1] = bounds.upper;
}

/// Writes one row of every column that exists, except gradient_joints and those of second order.
/// \param origin_a, origin_b of the bodies, world frame
CLEARANCE_HD inline void write_row(const ReplyView& reply, std::uint64_t index, BodyPair pair,
                                   std::uint32_t configuration, const PairAnswer& a, const Vec3d& origin_a,
                                   const Vec3d& origin_b) {
  write_interval(reply, index, a);
  if (reply.flags) reply.flags[index] = a.flags;
  if (reply.point_a) detail::write(reply.point_a, index, origin_a + a.point_a);
  if (reply.point_b) detail::write(reply.point_b, index, origin_b + a.point_b);
  if (reply.normal) detail::write(reply.normal, index, a.normal);
  if (reply.parts) {
    reply.parts[2 * index] = a.part_a;
    reply.parts[2 * index + 1] = a.part_b;
  }
  if (reply.gradient) detail::write_gradient(reply.gradient + 12 * index, a);
  if (reply.pair) reply.pair[index] = pair;
  if (reply.pair_lower) reply.pair_lower[index] = pair;
  if (reply.configuration) reply.configuration[index] = configuration;
  if (reply.points32) {
    detail::write(reply.points32, 2 * index, a.point_a);
    detail::write(reply.points32, 2 * index + 1, a.point_b);
  }
}
inline void write_second_order(const ReplyView& reply, std::uint64_t index, const SecondOrderRow& row) {
  if (reply.rate) reply.rate[index] = row.rate;
  if (reply.curvature) reply.curvature[index] = row.curvature;
  if (reply.smooth_radius) reply.smooth_radius[index] = row.smooth_radius;
  if (reply.rate_bounds) {
    reply.rate_bounds[2 * index] = row.rate_lower;
    reply.rate_bounds[2 * index + 1] = row.rate_upper;
  }
  if (!reply.hessian_joints) return;
  const std::size_t size = std::size_t{reply.joints} * reply.joints;
  double* const out = reply.hessian_joints + index * size;
  std::fill_n(out, size, __builtin_nan(""));
  std::copy(row.hessian_joints.begin(), row.hessian_joints.end(), out);
}
inline void write_row(const ReplyView& reply, std::uint64_t index, const Row& row) {
  write_row(reply, index, row.pair, row.configuration, row.answer, row.origin_a, row.origin_b);
  if (reply.pair_lower) reply.pair_lower[index] = row.pair_lower;
  if (reply.gradient_joints)
    std::copy(row.gradient_joints.begin(), row.gradient_joints.end(), reply.gradient_joints + index * reply.joints);
  write_second_order(reply, index, row.second);
}

}  // namespace clearance
