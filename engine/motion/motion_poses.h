// Poses of the bodies of a query at times of its motions.
#pragma once

#include <span>
#include <vector>

#include "engine/motion/motion_bounds.h"
#include "engine/robot/link_twists.h"
#include "engine/selection/configuration_poses.h"

namespace clearance {

/// A time of a motion, in a span of it.
struct Instant {
  const MovingBodies* moving;
  double begin, time, end;  ///< ascending, in [0, 1]
};

/// Counterpart of ConfigurationPoses for times of motions. Each worker has its own.
class MotionPoses {
 public:
  /// \param plan must outlive this; has configurations
  explicit MotionPoses(const Plan& plan);

  /// Sets MovingBodies::end_facts.
  void find_end_facts(MovingBodies& moving);
  /// Poses and facts, without errors, at some instants; valid until the next call.
  ConfigurationPoses::PoseBlock at(std::span<const Instant> instants);
  /// Number of sides of a span with velocities of their own: 2 along curves, otherwise 1.
  int sides() const { return sides_; }
  /// Velocities of bodies at instant k of the last at(), on one side of its span: along curves those of CurveSides'
  /// chord, by progress.
  /// \param placed the bodies placed at that instant
  /// \param twists (Plan::moved,) world axes, rounded
  void twists(std::size_t k, int side, const BodyPoses& placed, std::span<Twist> twists) const;

 private:
  void take_row(std::size_t k);
  void take_given(std::size_t k);
  void take_end_rows(const MovingBodies& moving);
  void take_twists(std::size_t motion, std::size_t at);
  std::size_t slot(std::size_t k, int side) const {
    return static_cast<std::size_t>(sides_) * k + static_cast<std::size_t>(sides_ > 1 ? side : 0);
  }

  const Plan& plan_;
  std::vector<LinkTwists> robots_;      // for each of Plan::motions
  std::vector<std::uint32_t> place_;    // for each of Plan::moved: index in Plan::bodies, or kNone
  std::vector<std::uint32_t> carrier_;  // likewise: index of its parent in Plan::moved, or kNone
  std::vector<Instant> instants_;
  int sides_ = 1;                                 // see sides()
  std::vector<Twist> twists_;                     // (instants, sides_, Plan::bodies) of links, relative to their roots
  std::vector<Twist> links_;                      // of all links of a robot
  std::vector<double> rows_;                      // (instants, joints)
  std::size_t columns_ = 0;                       // MovingBodies::curves
  std::vector<double> slopes_, slopes_of_robot_;  // (instants, sides_, columns_); by column of a robot
  CurveSides curve_sides_;
  std::vector<Pose> poses_;
  std::vector<std::uint8_t> facts_;
  std::vector<double> travels_;  // (instants, Plan::bodies)
  LinkMotion::LinkScratch scratch_;
};

}  // namespace clearance
