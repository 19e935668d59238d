// How fast the points of a link go and how fast the link turns, joint by joint: the same text for a CPU and for a GPU
// thread (docs/bounds.md, "Motion").
#pragma once

#include <cstdint>

#include "engine/robot/kinematics_step.h"

namespace clearance {

/// How fast a body moves.
struct Twist {
  Vec3d turn{0, 0, 0};   ///< radians in a unit of time, about that axis
  Vec3d shift{0, 0, 0};  ///< metres in a unit of time, of the body's origin
};

/// What one position moves on a path.
struct Mover {
  std::uint32_t column = 0;
  bool turns = false;  ///< else it slides
  double scale = 1;    ///< the joint moves by so much a unit of the position: |multiplier| of a mimic joint
  double reach = 1;    ///< metres a radian: no point is farther from the axis, sliding joints at 0; 1 of what slides
  double reach_travel = 0;  ///< and so much farther for each metre of travel
};

/// Rounding of the sums below, and of the constants that they are made of, which err by a few 2^-53 of their size.
inline constexpr double kMotionSlack = 1 + 0x1p-30;

/// Of points while positions change uniformly, in a unit of time. Rounded up.
struct MotionRates {
  double speed = 0;         ///< metres: none goes faster
  double acceleration = 0;  ///< metres: none is accelerated by more
  double turn = 0;          ///< radians: what carries them turns no faster

  /// Of the same points where what they move before (`outer`, of which all rates are about these points) moves, too.
  MotionRates within(const MotionRates& outer) const;
};

/// Metres that a mover takes a point along at most, for a change of 1.
CLEARANCE_HD inline double way_of_mover(const Mover& mover, double travel) {
  return (mover.reach + mover.reach_travel * travel) * mover.scale * kMotionSlack;
}

/// \param movers of the path, the nearest to who sees the points first. \param change of each position in a unit of
/// time, by column, >= 0. \param travel, beyond as MotionPath::rates() has them
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

/// The axis that a step turns about, in its link's own frame: still^-1 turning is (0, axis).
CLEARANCE_HD inline Vec3d axis_of_step(const KinematicStep& step) {
  const Quaternion<double>& q = step.still;
  const Quaternion<double> axis = product(Quaternion<double>{q.w, -q.x, -q.y, -q.z}, step.turning);
  return {axis.x, axis.y, axis.z};
}

/// How fast a step's link moves. \param from, to where what carries it is, and the link. \param axis axis_of_step().
/// \param change of a position in a unit of time, by column
template <class Change>
CLEARANCE_HD inline Twist twist_of_step(const KinematicStep& step, const Vec3d& axis,
                                        const KinematicFrame<double>& from, const Twist& carrier,
                                        const KinematicFrame<double>& to, const Change& change) {
  using Kind = KinematicStep::Kind;
  Twist own{carrier.turn, carrier.shift + cross(carrier.turn, to.t - from.t)};
  if (step.kind == Kind::kFixed) return own;
  const double first = (step.mimics ? step.multiplier : 1) * change(step.column);
  if (step.kind == Kind::kTurning) own.turn += turned(to.q, axis) * first;
  if (step.kind == Kind::kSliding) own.shift += turned(from.q, step.along[0]) * first;
  if (step.kind != Kind::kPlanar) return own;
  own.shift += turned(from.q, step.along[0] * first + step.along[1] * change(step.column + 1));
  own.turn += turned(to.q, axis) * change(step.column + 2);
  return own;
}

}  // namespace clearance
