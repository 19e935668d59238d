// How a pair's distance changes with the positions of a query's joints.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/evaluate/joint_gradient_step.h"
#include "engine/selection/body_poses.h"

namespace clearance {

/// The derivative of distances by the query's joints, from witness points and the joints' axes where they are. A joint
/// moves what its link carries, bodies and robots that follow it too. Of one job; read by all its workers.
class JointGradient {
 public:
  /// \param scene, plan outlive this.
  JointGradient(const Scene& scene, const Plan& plan);

  /// \param out (J,) in the order of Plan::joints: write_joint_gradient()
  void write(const BodyPoses& placement, BodyPair pair, const PairAnswer& answer, double* out) const;
  /// Its `link` and `carrier` are bodies.
  const std::vector<JointMover>& movers() const { return movers_; }
  /// (bodies,) the nearest one that carries each, or kNone
  const std::vector<std::uint32_t>& mover_of() const { return mover_of_; }

 private:
  std::uint32_t carrier_of(std::uint32_t body) const;
  void find_mover(std::uint32_t body, std::span<const std::uint32_t> at_of_joint);
  std::uint32_t add_mover(std::uint32_t body, std::uint32_t above, std::span<const std::uint32_t> at_of_joint);

  const Scene& scene_;
  const PoseSnapshot& snapshot_;
  std::size_t joints_;
  std::vector<JointMover> movers_;
  std::vector<std::uint32_t> mover_of_;  // of each body: the nearest one that carries it, or kNone
};

}  // namespace clearance
