// Derivative of distances by the positions of a query's joints.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/evaluate/joint_gradient_step.h"
#include "engine/selection/body_poses.h"

namespace clearance {

/// Computes derivatives from witness points and the axes of joints. A joint moves everything that its link carries,
/// including bodies and robots that follow it. One per job, shared by its workers.
class JointGradient {
 public:
  /// \param scene, plan outlive this.
  JointGradient(const engine::Scene& scene, const Plan& plan);
  /// \param joints whose positions change
  /// \param bodies that they may move
  JointGradient(const engine::Scene& scene, const PoseSnapshot& snapshot, std::span<const std::uint32_t> joints,
                std::span<const std::uint32_t> bodies);

  /// \param out (J,) in the order of Plan::joints: write_joint_gradient()
  void write(const BodyPoses& placement, BodyPair pair, const PairAnswer& answer, double* out) const;
  /// Its `link` and `carrier` are bodies.
  const std::vector<JointMover>& movers() const { return movers_; }
  /// (bodies,) the nearest mover that carries each, or kNone.
  const std::vector<std::uint32_t>& mover_of() const { return mover_of_; }
  /// The body below a body: for a link the previous link, otherwise its parent, or kNone.
  std::uint32_t carrier_of(std::uint32_t body) const;

 private:
  void find_mover(std::uint32_t body, std::span<const std::uint32_t> at_of_joint);
  std::uint32_t add_mover(std::uint32_t body, std::uint32_t above, std::span<const std::uint32_t> at_of_joint);

  const engine::Scene& scene_;
  const PoseSnapshot& snapshot_;
  std::size_t joints_;
  std::vector<JointMover> movers_;
  std::vector<std::uint32_t> mover_of_;  // by body
};

}  // namespace clearance
