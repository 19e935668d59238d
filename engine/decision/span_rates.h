// Rates at which the bodies of a query can move during its motions, for decisions by covers.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/cover/cover.h"
#include "engine/decision/kernel/decision_view.h"
#include "engine/robot/link_twists.h"
#include "engine/robot/motion_path.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Bounds on the movement of balls' centres and of bodies' points, from the changes of a motion's positions. For links
/// of robots whose roots stay, for bodies with given poses, and for bodies fixed to either. Immutable.
class SpanRates {
 public:
  /// Positions of motions beyond this are left to the exact engine. Radians or metres.
  static constexpr double kMostPosition = 64;
  /// Motions of given bodies with a greater BodyMotion::turn_error() are left to it, too.
  static constexpr double kGivenTurnError = 0x1p-44;

  /// A moved body with a cover.
  struct Source {
    std::uint32_t body;   ///< index in the decided bodies
    std::uint32_t robot;  ///< of its link in Plan::motions; kNone if a given pose moves it
    std::uint32_t link;
    LinkBall ball;                ///< of its points and of its balls' centres, in the frame of the link or of that pose
    MotionPath path;              ///< of that ball, from the link's root
    std::uint32_t given = kNone;  ///< index of the pose that moves it, in Plan::bodies
    double farthest = 0;          ///< metres: bound on that pose's translation
  };
  /// Rates per unit of time, without rounding of the twists.
  struct Rates {
    MotionRates motion;
    double twist_error = 0;  ///< metres
  };
  /// Movement of a given body in a span, per unit of time: metres, radians, metres as JointSpan::bend.
  struct Given {
    double shift = 0, turn = 0, bend = 0;
  };
  /// Movers of a point relative to a frame, or a given body.
  struct Path {
    std::uint32_t robot = 0;
    std::vector<Mover> movers;
    std::uint32_t given = kNone;
    double reach = 0;  ///< of the points, from the given body's origin
  };
  /// A pair relative to a reference body.
  struct View {
    Path a, b;
    std::uint32_t seer = kNone;
  };
  /// Rates of a pair, relative to a reference body.
  struct PairRates {
    double speed = 0, acceleration = 0;
    std::uint32_t seer = kNone;  ///< index of the reference body, whose twist is subtracted; kNone is the frame
  };

  /// \param sources of all bodies with covers
  SpanRates(const Plan& plan, std::span<const Source> sources, std::uint32_t body_count);

  /// Of the columns of each of Plan::motions.
  struct Changes {
    std::vector<std::vector<double>> change;  ///< |q1 - q0|, rounded up; JointSpan::change of curves
    std::vector<std::vector<double>> bend;    ///< JointSpan::bend of curves; empty for straight motions
    std::vector<Given> given;                 ///< of the given bodies
  };
  Rates of(std::uint32_t body, const Changes& changes) const;
  /// Finds the movers of a pair, which takes longer than the rates of many motions.
  std::vector<View> views_of(const MovedPair& pair) const;
  PairRates of_pair(std::span<const View> views, const Changes& changes) const;
  /// Bound on the distance of a body's points from their places, since q(t) is rounded. Metres.
  static double rounding(const Plan& plan, const Source& source);

 private:
  struct Body {
    const Kinematics* robot = nullptr;  ///< null without a cover, and for bodies that no link moves
    std::uint32_t link = kNone;
    LinkBall ball;
    Path path;
    double turn_error = 0, error = 0, reach = 0;
  };
  void take_given(const Plan& plan, const Source& source);
  MotionRates rates(const Path& path, const Changes& changes) const;

  std::vector<double> travel_;  // of each of Plan::motions
  std::vector<Body> bodies_;
};

}  // namespace clearance
