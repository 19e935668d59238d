// Poses of the bodies of a query at times of its motions.
#pragma once

#include <span>
#include <vector>

#include "engine/motion/motion_bounds.h"
#include "engine/robot/link_twists.h"
#include "engine/selection/configuration_poses.h"

namespace clearance {

/// The middle of a span of a motion. At a single time the velocities of curves are exact, and not those of a chord.
struct Instant {
  const MovingBodies* moving;
  double begin, end;  ///< in [0, 1]
  double time() const { return 0.5 * begin + 0.5 * end; }
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
  /// Makes twists() those of other rates of curves than at(): (MovingBodies::curves,).
  void follow(std::size_t k, std::span<const double> slopes);
  /// Velocities of bodies at instant k of the last at(); along curves for a span only.
  /// \param placed the bodies placed at that instant
  /// \param twists (Plan::moved,) world axes, rounded
  void twists(std::size_t k, const BodyPoses& placed, std::span<Twist> twists) const;

 private:
  void take_row(std::size_t k);
  void take_given(std::size_t k);
  void take_end_rows(const MovingBodies& moving);
  void take_twists(std::size_t motion, std::size_t at);

  const Plan& plan_;
  std::vector<LinkTwists> robots_;      // for each of Plan::motions
  std::vector<std::uint32_t> place_;    // for each of Plan::moved: index in Plan::bodies, or kNone
  std::vector<std::uint32_t> carrier_;  // likewise: index of its parent in Plan::moved, or kNone
  std::vector<Instant> instants_;
  std::vector<Twist> twists_;                     // (instants, Plan::bodies) of links, relative to their roots
  std::vector<Twist> links_;                      // of all links of a robot
  std::vector<double> rows_;                      // (instants, joints)
  std::size_t columns_ = 0;                       // MovingBodies::curves
  std::vector<double> slopes_, slopes_of_robot_;  // (instants, columns_); by column of a robot
  CurveSpan span_;
  std::vector<Pose> poses_;
  std::vector<std::uint8_t> facts_;
  std::vector<double> travels_;  // (instants, Plan::bodies)
  LinkMotion::LinkScratch scratch_;
};

}  // namespace clearance
