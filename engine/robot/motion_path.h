// Bounds on the motion of a link's points for changing joint positions (docs/trust/bounds_robots.md, "Paths of
// points").
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/robot/kinematics.h"
#include "engine/robot/motion_path_step.h"

namespace clearance {

/// Ball that contains points of a link; link axes, metres.
struct LinkBall {
  Vec3d centre{0, 0, 0};
  double radius = 0;
};

/// The joints that move a link's points relative to an observing frame, the nearest to that frame first. Bounds are
/// rounded up, and hold for the joints in real arithmetic.
class MotionPath {
 public:
  MotionPath() = default;
  /// Relative to the link's root.
  MotionPath(const Kinematics& robot, std::uint32_t link, const LinkBall& points);
  /// Relative to another link under the same root.
  MotionPath(const Kinematics& robot, std::uint32_t seen_from, std::uint32_t link, const LinkBall& points);

  const std::vector<Mover>& movers() const { return movers_; }
  /// Bound on the path length of the points while positions change by at most `change` (columns(), >= 0), in metres.
  /// \param travel largest |position| of a sliding joint during the change (Kinematics::travel()), metres
  double way(std::span<const double> change, double travel) const;
  /// Bounds on the rates while each position changes uniformly by `change` per unit of time. The acceleration
  /// that the bends of curves (JointSpan) add is the speed for these.
  /// \param beyond metres: maximum distance of the points from the path's ball
  MotionRates rates(std::span<const double> change, double travel, double beyond = 0) const;
  /// The bound for one mover and a change of 1.
  static double way_of(const Mover& mover, double travel);

 private:
  friend class MotionPathBuilder;
  friend std::vector<MotionPath> paths_between(const Kinematics&, std::uint32_t, const LinkBall&, std::uint32_t,
                                               const LinkBall&);
  friend std::array<MotionPath, 2> paths_from_fork(const Kinematics&, std::uint32_t, const LinkBall&, std::uint32_t,
                                                   const LinkBall&);
  std::vector<Mover> movers_;
};

/// Paths that each bound the decrease of the distance of two links, so that the minimum is valid: relative to either
/// link, and the sum of both relative to their common parent frame. Under different roots, which do not move, relative
/// to the roots.
std::vector<MotionPath> paths_between(const Kinematics& robot, std::uint32_t a, const LinkBall& points_a,
                                      std::uint32_t b, const LinkBall& points_b);

/// Returns the last common ancestor of two links under one root, or the root of the first if the roots differ.
std::uint32_t fork_of(const Kinematics& robot, std::uint32_t a, std::uint32_t b);

/// Returns the two paths whose sum is the last of these: of a's points and of b's, relative to their common ancestor or
/// their roots.
std::array<MotionPath, 2> paths_from_fork(const Kinematics& robot, std::uint32_t a, const LinkBall& points_a,
                                          std::uint32_t b, const LinkBall& points_b);

}  // namespace clearance
