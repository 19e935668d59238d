// Bodies that a query moves by given poses during its motions, for decisions by covers.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/decision/cover_plan.h"
#include "engine/decision/span_rates.h"
#include "engine/selection/body_motion.h"
#include "engine/selection/joint_curve.h"
#include "engine/selection/plan.h"

namespace clearance {

/// The given bodies of one motion at a time. Reusable memory.
class GivenMotions {
 public:
  /// \param plan must outlive this
  explicit GivenMotions(const Plan& plan) : plan_(plan), spans_(plan.given_bodies) {}

  /// Takes a motion's poses and growths. Returns false if the bounds do not hold for them.
  /// \param covers of the plan
  bool begin(const CoverPlan& covers, std::uint64_t motion);
  /// Sum of the bodies' ways in a straight motion, metres and radians, with growths.
  double length() const;
  /// Appends three coordinates of each body, and their growths, to the curves of a motion's joints. Call before the
  /// functions below, for motions along curves alone.
  void append_to(std::vector<JointCurve>& curves);

  /// Writes the poses at a time, with unit quaternions.
  void place(double time, std::span<const JointCurve> curves, Pose* poses) const;
  /// Takes a span of time of curves, or all times of straight motions if it is empty.
  /// \param columns of all curves, as append_to() has ordered them
  void take_span(std::span<const JointSpan> columns, std::vector<SpanRates::Given>& given);
  /// Velocity in the axes that the poses are in.
  /// \param X the body's pose
  Twist twist(std::uint32_t body, const Pose& X) const;
  /// Upper bound on a body's growth in [middle - half, middle + half], in metres.
  /// \param body index in Plan::bodies; others than given bodies do not grow
  double growth(std::uint32_t body, double middle, double half) const;
  /// Lower bound on it at a time, in metres.
  double least_growth(std::uint32_t body, double time) const;

 private:
  struct Span {
    Vec3d shift{0, 0, 0};
    double growth = 0;  // change per unit of time
  };

  const Plan& plan_;
  std::size_t first_ = 0;            // of the motion's configurations
  std::vector<BodyMotion> motions_;  // along curves, of the rotation alone
  std::vector<JointCurve> growths_;  // none if no body grows
  std::vector<Span> spans_;          // by body
  std::vector<Pose> poses_;
};

}  // namespace clearance
