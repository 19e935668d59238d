// Bounds on the speed at which bodies of a pair approach during a motion: docs/trust/bounds_robots.md, "Motion".
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "engine/motion/motion_arrays.h"
#include "engine/motion/motion_step.h"
#include "engine/robot/link_twists.h"
#include "engine/robot/motion_path.h"
#include "engine/selection/body_motion.h"
#include "engine/selection/body_poses.h"
#include "engine/selection/curve_sides.h"
#include "engine/selection/joint_curve.h"
#include "engine/selection/plan.h"

namespace clearance {

/// A body's growth in a span, in the units of MotionRates, as JointSpan. Its slope is until either end.
struct GrowthSpan {
  double slope[2] = {0, 0};
  double change = 0, bend = 0;
};

/// Data derived from the control points of one motion by MotionBounds::take().
struct MovingBodies {
  std::uint64_t motion = 0;  ///< index in the plan
  /// Of Plan::joints, of three coordinates of each given body, and of their growths if there are any. None for straight
  /// motions.
  std::vector<JointCurve> curves;
  std::vector<BodyMotion> given;              ///< for the bodies whose poses the query gives; their rotation in curves
  std::vector<MotionRates> given_rates;       ///< likewise, of their positions along curves, in the span
  std::vector<JointCurve> growths;            ///< likewise, metres; none if no body grows
  std::vector<GrowthSpan> growth;             ///< likewise, in the span
  std::vector<std::vector<double>> along;     ///< for each of Plan::motions, by column: q1 - q0, rounded
  std::vector<std::vector<double>> change;    ///< likewise: |q1 - q0|, rounded up; of curves, by take_sides()
  std::vector<std::vector<double>> bend;      ///< likewise, of curves by take_sides(); 0 for straight motions
  std::vector<std::vector<double>> rounding;  ///< likewise: bound on the error of q(t) as computed
  std::vector<double> travel;                 ///< for each of Plan::motions: Kinematics::travel(), of control points
  std::vector<MotionRates> chains;            ///< for each chain of MotionBounds
  CurveSides sides;                           ///< of `curves`, after MotionBounds::take_sides()
  /// For each chain, in metres, only after take_sides(): bounds on the distance of the points from their places at the
  /// time, and on that distance where the progress is 0.
  std::vector<double> chain_ways, chain_rests;
  std::vector<double> chain_errors;     ///< likewise: bound on the error of the points' places in at()
  std::vector<double> chain_turns;      ///< likewise: bound on the carrier's rotation error, in radians
  std::vector<double> errors;           ///< for each of Plan::moved: ConfigurationPoses::PoseBlock::errors
  bool half_turn = false;               ///< one of `given` is_half_turn()
  std::vector<std::uint8_t> end_facts;  ///< LinkFact bits of the motion, for links in Plan::bodies; empty if 0
};

/// How much both bodies of a pair are grown in a span, in metres: together, as GrowthSpan. Rounded outward.
struct PairGrowth {
  double least = 0, most = 0;  ///< where it is evaluated
  double slope[2] = {0, 0};
  double change = 0, bend = 0;
  bool any() const { return most > 0 || change > 0; }
};

/// The joints and poses that move the bodies of each pair relative to each other, computed once per query.
class MotionBounds {
 public:
  /// Both must outlive this.
  /// \param all_pairs whether to call take_views() for all pairs
  MotionBounds(const engine::Scene& scene, const Plan& plan, bool all_pairs = true);
  /// Finds reference bodies before which a pair moves less than before the world. To be called before take().
  /// \param position of the pair in the plan
  void take_views(std::uint64_t position);

  /// With the rates of the whole motion if it is straight. Curves have rates after take_sides().
  void take(std::uint64_t motion, MovingBodies& moving) const;
  /// Sets the rates of curves on both sides of a time in a span: docs/trust/bounds_robots.md, "Sides of a time". They
  /// are by progress, and each side is a unit of it. Straight motions have the same rates in all spans.
  void take_sides(double begin, double time, double end, MovingBodies& moving) const;
  /// Bound on a pair's approach where the progress is 0, in metres. After take_sides().
  /// \param seer PairRates::seer
  double rest(std::uint64_t position, BodyPair pair, const MovingBodies& moving, std::uint32_t seer) const;
  /// Growth of a pair in the span.
  /// \param time in the span
  PairGrowth growth(BodyPair pair, const MovingBodies& moving, double time) const;
  /// Speed bound of each of Plan::moved, growth included, in metres per unit of time. A pair's speed is at most the sum
  /// of its bodies'.
  /// \param placed at any time of the motion
  void speeds(const MovingBodies& moving, const BodyPoses& placed, std::vector<double>& speeds) const;
  /// Index of a body in Plan::moved, or kNone if it is not moved.
  std::uint32_t slot(std::uint32_t body) const { return slot_[body]; }
  /// \param position of the pair in the plan
  PairRates rates(std::uint64_t position, BodyPair pair, const MovingBodies& moving, const BodyPoses& placed) const;
  /// Twist of a body relative to another one, or to the world if `seer` is kNone.
  /// \param twists of each of Plan::moved
  Twist twist_before(std::uint32_t seer, std::uint32_t body, std::span<const Twist> twists,
                     const BodyPoses& placed) const;
  /// Writes the same data as plain arrays. Returns false if poses move bodies, or if a robot carried by another one
  /// moves: kernels do not support such chains.
  bool flatten(MotionArrays& arrays) const;

 private:
  static constexpr std::uint32_t kStill = ~std::uint32_t{0};  // a chain that nothing moves
  // Source of a body's motion relative to its carrier: a pose that the query gives, or joints of a robot.
  struct Link {
    std::uint32_t given = kNone;                // index in MovingBodies::given
    std::uint32_t robot = kNone, link = kNone;  // index in Plan::motions; link of that robot
    std::uint32_t body = kNone;
    LinkBall ball;             // around the points, in the link's axes; for the first link of a chain only
    double offset = 0;         // metres from its origin to that of the previous link
    MotionPath path;           // for a robot's link: from its root
    PlacementError error;      // likewise, of `ball`
    std::uint32_t slides = 0;  // likewise: number of sliding joints in the path
  };
  using Chain = std::vector<Link>;  // nearest to the points first
  // Two bodies relative to a reference body, each moved by a chain. A pair has several views; the bounds of each hold.
  struct View {
    std::uint32_t a = kStill, b = kStill, seer = kNone;
  };
  struct Views {
    View view[3];
    std::uint32_t count = 1;
  };

  Chain chain_of(std::uint32_t body) const;
  void take_views(std::uint64_t position, BodyPair pair);
  void take_all_views();
  Views view_of_carrier(std::uint32_t a, std::uint32_t b, std::size_t shared);
  Views views_in_robot(const Chain& a, const Chain& b, std::size_t shared);
  std::uint32_t add_chain(Chain chain);
  std::uint32_t chain_before(std::uint32_t chain, std::size_t shared);
  MotionRates rates_of(const Chain& chain, const MovingBodies& moving, double* error, double* turn_error) const;
  MotionRates rates_of_given(const Link& link, bool is_first, double reach, const MovingBodies& moving) const;
  void take_given(MovingBodies& moving) const;
  void take_curves(MovingBodies& moving) const;
  void take_joints(std::size_t robot, MovingBodies& moving) const;
  /// \param span_of JointSpan of a CurveSides::Curve
  template <class SpanOf>
  void take_parts(MovingBodies& moving, const SpanOf& span_of) const;
  void take_rates(MovingBodies& moving) const;
  const Kinematics& kinematics(const Link& link) const { return plan_.motions[link.robot].robot().kinematics; }
  static MotionRates rates_of_chain(std::uint32_t chain, const MovingBodies& moving);
  double turn_uncertainty(std::uint32_t body, const BodyPoses& placed) const;
  double drift_of(std::uint32_t body, const MovingBodies& moving, const BodyPoses& placed) const;

  const engine::Scene& scene_;
  const Plan& plan_;
  std::vector<std::uint32_t> slot_;      // by body
  std::vector<std::uint32_t> given_of_;  // by body: index in MovingBodies::given, or kNone
  std::vector<Chain> chains_;
  std::vector<std::uint32_t> chain_of_body_;                               // by body: relative to the world, or kStill
  std::map<std::pair<std::uint32_t, std::size_t>, std::uint32_t> before_;  // chains without their last links
  std::map<std::uint64_t, Views> views_;  // by pair position; shared by pairs with the same movers
  std::vector<std::uint8_t> has_views_;   // by pair position; empty if all have been taken
};

}  // namespace clearance
