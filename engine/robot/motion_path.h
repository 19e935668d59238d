// How far points of a link can get when joint positions change: docs/bounds.md, "Motion".
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/robot/kinematics.h"
#include "engine/robot/motion_path_step.h"

namespace clearance {

/// Points that move with a link: all within `radius` of `centre`; link axes, metres.
struct LinkBall {
  Vec3d centre{0, 0, 0};
  double radius = 0;
};

/// The joints that move a link's points as somebody else sees them, the nearest to him first. Bounds are rounded up,
/// and hold for the joints in reals.
class MotionPath {
 public:
  MotionPath() = default;
  /// As seen from the link's root.
  MotionPath(const Kinematics& robot, std::uint32_t link, const LinkBall& points);
  /// As seen from another link under the same root.
  MotionPath(const Kinematics& robot, std::uint32_t seen_from, std::uint32_t link, const LinkBall& points);

  const std::vector<Mover>& movers() const { return movers_; }
  /// Metres: no point's way is longer while positions change by no more than `change` (columns(), >= 0).
  /// \param travel largest |position| of a sliding joint meanwhile (Kinematics::travel()), metres
  double way(std::span<const double> change, double travel) const;
  /// How fast that is while each position changes uniformly by `change` in a unit of time.
  /// \param beyond metres: points may lie so far out of the ball that the path was made for
  MotionRates rates(std::span<const double> change, double travel, double beyond = 0) const;
  /// The same for one mover and a change of 1.
  static double way_of(const Mover& mover, double travel);

 private:
  friend class MotionPathBuilder;
  friend std::vector<MotionPath> paths_between(const Kinematics&, std::uint32_t, const LinkBall&, std::uint32_t,
                                               const LinkBall&);
  friend std::array<MotionPath, 2> paths_from_fork(const Kinematics&, std::uint32_t, const LinkBall&, std::uint32_t,
                                                   const LinkBall&);
  std::vector<Mover> movers_;
};

/// Paths of which each bounds how much nearer two links can come: what the least of their ways is holds. Seen from
/// either link, and the sum of both as seen from what carries both; under different roots, which stand still, from the
/// roots.
std::vector<MotionPath> paths_between(const Kinematics& robot, std::uint32_t a, const LinkBall& points_a,
                                      std::uint32_t b, const LinkBall& points_b);

/// The link whose frame is the last that carries two links under one root; of links under two, the first one's root.
std::uint32_t fork_of(const Kinematics& robot, std::uint32_t a, std::uint32_t b);

/// The two paths of the last of these: of a's points and of b's, as seen from what carries both, or from their roots.
std::array<MotionPath, 2> paths_from_fork(const Kinematics& robot, std::uint32_t a, const LinkBall& points_a,
                                          std::uint32_t b, const LinkBall& points_b);

}  // namespace clearance
