// Bounds on the speed of a link's points and its rotation, joint by joint, from the same source for a CPU and a GPU
// thread (docs/trust/bounds_robots.md, "Paths of points").
#pragma once

#include <cstdint>

#include "engine/robot/kinematics_step.h"

namespace clearance {

/// Velocity of a body, over a scalar or a SIMD pack.
template <class T>
struct TwistOf {
  Vec3<T> turn{T(0.0), T(0.0), T(0.0)};   ///< angular velocity, radians per unit of time
  Vec3<T> shift{T(0.0), T(0.0), T(0.0)};  ///< velocity of the body's origin, metres per unit of time
};
using Twist = TwistOf<double>;

/// Effect of one position on a path.
struct Mover {
  std::uint32_t column = 0;
  bool turns = false;       ///< whether it turns rather than slides
  double scale = 1;         ///< motion of the joint per unit of the position: |multiplier| of a mimic joint
  double reach = 1;         ///< metres per radian: maximum distance from the axis, sliding joints at 0; 1 if sliding
  double reach_travel = 0;  ///< increase of `reach` per metre of travel
};

/// Covers the rounding of the sums below and of their constants, whose relative errors are a few 2^-53.
inline constexpr double kMotionSlack = 1 + 0x1p-30;

/// Bounds for points while positions change uniformly, per unit of time. Rounded up.
struct MotionRates {
  double speed = 0;         ///< bound on the speed, metres
  double acceleration = 0;  ///< bound on the acceleration, metres
  double turn = 0;          ///< bound on the angular speed of their frame, radians

  /// Combines the rates with those of a moving outer frame (`outer`, whose rates are for the same points).
  MotionRates within(const MotionRates& outer) const;
};

/// Bound on the displacement of a point by a mover for a change of 1, in metres.
CLEARANCE_HD inline double way_of_mover(const Mover& mover, double travel) {
  return (mover.reach + mover.reach_travel * travel) * mover.scale * kMotionSlack;
}

/// \param movers movers of the path, the nearest to the observing frame first
/// \param change change of each position per unit of time, by column, >= 0
/// \param travel, beyond as in MotionPath::rates()
template <class Change>
CLEARANCE_HD inline MotionRates rates_of_path(const Mover* movers, std::size_t count, const Change& change,
                                              double travel, double beyond) {
  MotionRates sum;
  for (std::size_t i = 0; i < count; ++i) {
    const Mover& mover = movers[i];
    const double by = change(mover.column), turn = mover.turns ? mover.scale * by : 0;
    const double speed = (way_of_mover(mover, travel) + (mover.turns ? mover.scale * beyond : 0)) * by;
    sum.speed += speed;
    sum.acceleration += speed * (turn + 2 * sum.turn);
    sum.turn += turn;
  }
  return {sum.speed * kMotionSlack, sum.acceleration * kMotionSlack, sum.turn * kMotionSlack};
}

/// Returns the axis of a turning step in its link's frame: still^-1 turning is (0, axis).
CLEARANCE_HD inline Vec3d axis_of_step(const KinematicStep& step) {
  const Quaternion<double>& q = step.still;
  const Quaternion<double> axis = product(Quaternion<double>{q.w, -q.x, -q.y, -q.z}, step.turning);
  return {axis.x, axis.y, axis.z};
}

/// Returns the velocity of a step's link.
/// \param from, to poses of the parent and of the link
/// \param axis axis_of_step()
/// \param change change of each position per unit of time, by column
template <class T, class Change>
CLEARANCE_INLINE TwistOf<T> twist_of_step(const KinematicStep& step, const Vec3d& axis, const KinematicFrame<T>& from,
                                          const TwistOf<T>& carrier, const KinematicFrame<T>& to,
                                          const Change& change) {
  using Kind = KinematicStep::Kind;
  using detail::constant;
  TwistOf<T> own{carrier.turn, carrier.shift + cross(carrier.turn, to.t - from.t)};
  if (step.kind == Kind::kFixed) return own;
  const T first((step.mimics ? step.multiplier : 1) * change(step.column));
  if (step.kind == Kind::kTurning) own.turn += turned(to.q, constant<T>(axis)) * first;
  if (step.kind == Kind::kSliding) own.shift += turned(from.q, constant<T>(step.along[0])) * first;
  if (step.kind != Kind::kPlanar) return own;
  own.shift +=
      turned(from.q, constant<T>(step.along[0]) * first + constant<T>(step.along[1]) * T(change(step.column + 1)));
  own.turn += turned(to.q, constant<T>(axis)) * T(change(step.column + 2));
  return own;
}

}  // namespace clearance
