// Bounds on the slack of moved bodies in all states of a query.
#pragma once

#include <span>
#include <vector>

#include "engine/scene/scene.h"
#include "engine/selection/plan.h"

namespace clearance {

/// The greatest uncertainty that bodies have in any state of a plan, as BodyPoses would compute it.
class SlackBounds {
 public:
  /// Limit on the travel of joints that slide without limits of their own, in metres.
  static constexpr double kMostTravel = 16;
  /// Limit on the distance of a body with given poses from the frame that carries it, in metres: kMostTravel, or twice
  /// its distance in the snapshot.
  static double most_distance(const Pose& in_snapshot);

  SlackBounds(const engine::Scene& scene, const Plan& plan);

  /// Bound on the distance of a moved body's origin from that of the frame that carries it, in metres.
  double farthest(std::size_t moved) const { return farthest_[moved]; }
  /// Bound on the slack of a pair of bodies, moved or not.
  Slack of(BodyPair pair) const;

 private:
  const PoseUncertainty& uncertainty(std::uint32_t body) const;

  const Plan& plan_;
  std::vector<std::uint32_t> slot_;             // by body: index in Plan::moved, or kNone
  std::vector<double> farthest_;                // by moved body
  std::vector<PoseUncertainty> uncertainties_;  // likewise; empty if all bodies are exact
};

/// Limit on the position of a column that slides: that of the joint, or kMostTravel.
double most_travel(const RobotColumn& column);

}  // namespace clearance
