// How fast the bodies of pairs can come nearer during a motion: docs/bounds.md, "Motion".
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "engine/motion/body_motion.h"
#include "engine/motion/motion_arrays.h"
#include "engine/motion/motion_step.h"
#include "engine/robot/link_twists.h"
#include "engine/robot/motion_path.h"
#include "engine/selection/body_poses.h"
#include "engine/selection/plan.h"

namespace clearance {

/// What the start and the end of one motion say: made by MotionBounds::take().
struct MovingBodies {
  std::uint64_t motion = 0;                   ///< of the plan: configurations 2 motion and 2 motion + 1
  std::vector<BodyMotion> given;              ///< of the bodies whose poses the query gives
  std::vector<std::vector<double>> along;     ///< of each of Plan::motions, by column: q1 - q0, rounded
  std::vector<std::vector<double>> change;    ///< likewise: |q1 - q0|, rounded up
  std::vector<std::vector<double>> rounding;  ///< likewise: how far q(t) may be off as computed
  std::vector<double> travel;                 ///< of each of Plan::motions: Kinematics::travel(), of both ends
  std::vector<MotionRates> chains;            ///< of each chain of MotionBounds
  std::vector<double> chain_errors;           ///< likewise: how far at() may put the points from their places
  std::vector<double> chain_turns;            ///< likewise: radians that it may turn what carries them, by its time
  std::vector<double> errors;                 ///< of each of Plan::moved: ConfigurationPoses::Block::errors
  bool half_turn = false;                     ///< one of `given` is_half_turn()
  std::vector<std::uint8_t> end_facts;        ///< of the links in Plan::bodies: LinkFact bits of both ends; empty: 0
};

/// Which joints and poses move the bodies of each pair before each other, once for a query. Immutable.
class MotionBounds {
 public:
  /// Both must outlive this.
  MotionBounds(const Scene& scene, const Plan& plan);

  void take(std::uint64_t motion, MovingBodies& moving) const;
  /// \param position of the pair in the plan. \param placed at any time of the motion
  /// Metres in a unit of time, of each of Plan::moved: a pair's speed is no more than the sum of its bodies'.
  void speeds(const MovingBodies& moving, const BodyPoses& placed, std::vector<double>& speeds) const;
  /// Of a body in Plan::moved; kNone: it is not moved.
  std::uint32_t slot(std::uint32_t body) const { return slot_[body]; }
  PairRates rates(std::uint64_t position, BodyPair pair, const MovingBodies& moving, const BodyPoses& placed) const;
  /// How fast a body moves before the eyes of another one; kNone: of the world. \param twists of each of Plan::moved
  Twist twist_before(std::uint32_t seer, std::uint32_t body, std::span<const Twist> twists,
                     const BodyPoses& placed) const;
  /// The same as plain arrays. False where poses move bodies, or a robot that is carried by another one moves: no
  /// kernel knows such chains.
  bool flatten(MotionArrays& arrays) const;

 private:
  static constexpr std::uint32_t kStill = ~std::uint32_t{0};  // a chain that nothing moves
  // What moves a body before its carrier: a pose that the query gives, or joints of a robot.
  struct Link {
    std::uint32_t given = kNone;                // of MovingBodies::given
    std::uint32_t robot = kNone, link = kNone;  // of Plan::motions, and of that robot
    std::uint32_t body = kNone;
    LinkBall ball;             // of the points, in its axes; of the first one of a chain
    double offset = 0;         // metres from its origin to that of the one before
    MotionPath path;           // of a robot's link: from its root
    PlacementError error;      // likewise, of `ball`
    std::uint32_t slides = 0;  // likewise: joints of the path that slide
  };
  using Chain = std::vector<Link>;  // the nearest to the points first
  // Two bodies before each other's eyes: of one of these views each bound holds. A chain moves each body.
  struct View {
    std::uint32_t a = kStill, b = kStill, seer = kNone;
  };
  struct Views {
    View view[3];
    std::uint32_t count = 1;
  };

  Chain chain_of(std::uint32_t body) const;
  void take_views(std::uint64_t position, BodyPair pair);
  Views view_of_carrier(std::uint32_t a, std::uint32_t b, std::size_t shared);
  Views views_in_robot(const Chain& a, const Chain& b, std::size_t shared);
  std::uint32_t add_chain(Chain chain);
  std::uint32_t chain_before(std::uint32_t chain, std::size_t shared);
  MotionRates rates_of(const Chain& chain, const MovingBodies& moving, double* error, double* turn_error) const;
  void take_joints(std::size_t robot, MovingBodies& moving) const;
  const Kinematics& kinematics(const Link& link) const { return plan_.motions[link.robot].robot().kinematics; }
  double turn_uncertainty(std::uint32_t body, const BodyPoses& placed) const;
  double drift_of(std::uint32_t body, const MovingBodies& moving, const BodyPoses& placed) const;

  const Scene& scene_;
  const Plan& plan_;
  std::vector<std::uint32_t> slot_;  // by body
  std::vector<Chain> chains_;
  std::vector<std::uint32_t> chain_of_body_;                               // by body: from the world, or kStill
  std::map<std::pair<std::uint32_t, std::size_t>, std::uint32_t> before_;  // chains without their last links
  std::map<std::uint64_t, Views> views_;  // of pairs, by position, that share what moves them
};

}  // namespace clearance
