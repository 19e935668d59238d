// How a pair's distance changes with the positions of a query's joints.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/narrow/answer.h"
#include "engine/query/placement.h"

namespace clearance {

/// The derivative of distances by the query's joints, from witness points and the joints' axes where they are. A joint
/// moves what its link carries, bodies and robots that follow it too. Of one job; read by all its workers.
class JointGradient {
 public:
  /// \param scene, plan outlive this.
  JointGradient(const Scene& scene, const Plan& plan);

  /// \param out (J,) metres a radian or metre, in the order of Plan::joints; 0 for a joint that moves neither body, or
  /// both alike, and where bodies overlap without a depth being asked for; NaN where there are no witness points
  void write(const Placement& placement, BodyPair pair, const PairAnswer& answer, double* out) const;

 private:
  // A joint that the query moves, or one that mimics it.
  struct Mover {
    const SceneRobot* robot;
    const KinematicStep* step;
    std::array<std::uint32_t, 3> at;  // in `out`, of each of its columns; kNone: the query leaves it
    Vec3d axis;                       // that it turns about, in the axes of its link
    std::uint32_t above;              // in movers_: the next one on the way to the root, or kNone
    std::uint32_t depth;              // how many are above
  };

  std::uint32_t carrier_of(std::uint32_t body) const;
  void find_mover(std::uint32_t body, std::span<const std::uint32_t> at_of_joint);
  std::uint32_t add_mover(std::uint32_t body, std::uint32_t above, std::span<const std::uint32_t> at_of_joint);
  void add(const Mover& mover, const Placement& placement, std::uint32_t body, const Vec3d& point, const Vec3d& normal,
           double* out) const;

  const Scene& scene_;
  const PoseSnapshot& snapshot_;
  std::size_t joints_;
  std::vector<Mover> movers_;
  std::vector<std::uint32_t> mover_of_;  // of each body: the nearest one that carries it, or kNone
};

}  // namespace clearance
