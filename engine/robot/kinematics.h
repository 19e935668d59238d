// Joint positions to poses of links, with a bound on how far each link is from where the exact numbers put it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "engine/robot/kinematics_step.h"
#include "engine/robot/robot.h"
#include "wire/types.h"

namespace clearance {

/// One instruction set's version of place_batch(); all give the same bits.
struct KinematicKernel {
  std::string_view name;  ///< "avx512", "avx2", "baseline", "scalar"
  void (*run)(const KinematicBatch&);
};
/// Those that this machine can run, the fastest first.
std::span<const KinematicKernel> kinematic_kernels();

/// How far any point of a link may be from where reals put it, in metres: a sum of what holds for all configurations,
/// what grows with how far its sliding joints are out, and what grows with how far the robot's base is from the origin.
struct PlacementError {
  double fixed = 0, per_travel = 0, per_distance = 0;
  double turn = 0;  ///< radians that the link may be turned by: `fixed` counts it for the points farthest out

  /// \param travel largest |position| of a sliding or planar joint on the way to the link, metres; 0 if there is none.
  /// \param distance |t| of the pose that the link's root was given, metres
  double at(double travel, double distance) const;
};

/// A robot's joints as steps. Immutable; any number of threads may use one.
///
/// What is exact: the numbers of the URDF as float64, its roll, pitch and yaw, axes of length 1, mimic joints, sine and
/// cosine in reals; the poses of the roots as design's poses are (M(q)/|q|^2). The poses that come out are float64, and
/// error() says how far each is off (docs/bounds.md, "Kinematics").
class Kinematics {
 public:
  explicit Kinematics(const RobotModel& robot);

  std::size_t columns() const { return columns_; }
  std::size_t links() const { return nodes_.size(); }
  /// Links whose poses are given: the base, then the children of floating joints in the order of the joints.
  const std::vector<std::uint32_t>& roots() const { return roots_; }
  /// Which of them a link hangs on.
  std::uint32_t root_of(std::uint32_t link) const;
  /// What places the other links, each after what carries it.
  const std::vector<KinematicStep>& steps() const { return steps_; }
  /// Which of them places a link; null: it is a root.
  const KinematicStep* step_of(std::uint32_t link) const {
    const std::uint32_t frame = nodes_[link].frame;
    return frame < roots_.size() ? nullptr : &steps_[frame - roots_.size()];
  }
  /// The link whose frame carries what a step places.
  std::uint32_t carrier_of(const KinematicStep& step) const {
    return step.from < roots_.size() ? roots_[step.from] : steps_[step.from - roots_.size()].link;
  }

  /// Poses of all links. \param positions (K, columns()), radians and metres. \param roots X_w of each of roots(); none
  /// may be kBad. \param poses (K, links()) X_w; those of a bad configuration are NaN, but for roots. \param status
  /// (K,) kOk, or kBadPose where a position is NaN or beyond 1e6.
  void place(std::span<const double> positions, std::span<const Pose> roots, std::span<Pose> poses,
             std::span<Status> status, const KinematicKernel& kernel = kinematic_kernels()[0]) const;

  /// Of points of a link up to `radius` metres from its origin.
  PlacementError error(std::uint32_t link, double radius) const;
  /// The same of how two links of one robot are to each other: only what the joints between them make. An exact
  /// distance of theirs differs by no more from that of the poses. Of links under different roots, the sum of both.
  PlacementError error_between(std::uint32_t a, double radius_a, std::uint32_t b, double radius_b) const;
  /// The travel of a configuration, of all joints. \param positions (columns(),); one that is no number or beyond
  /// kMaxPosition places no link, and counts for nothing
  double travel(std::span<const double> positions) const;
  /// The travel of each link: of the joints on the way to it, as PlacementError needs it. \param links (links(),)
  void travels(std::span<const double> positions, std::span<double> links) const;
  /// Metres: how far the link's farthest point can be from its root, sliding joints at 0.
  double reach(std::uint32_t link, double radius) const;

 private:
  // Rounding terms of one step, and how long it is; lengths in metres, `_travel` for each metre of travel.
  struct StepError {
    double turn = 0;  // radians
    double length = 0, length_travel = 0, shift = 0, shift_travel = 0;
  };
  // A link's frame: step `step`, or a root.
  struct Node {
    std::uint32_t frame = 0;  // root, or roots + step
    double length = 0, length_travel = 0;
  };

  StepError error_of(const KinematicStep& step, double inexact_turn, double inexact_shift, double inexact_along) const;
  PlacementError error_along(std::uint32_t link, std::uint32_t from_frame, double radius) const;
  std::uint32_t carrier(std::uint32_t frame) const { return steps_[frame - roots_.size()].from; }
  friend class KinematicsBuilder;

  std::size_t columns_ = 0;
  bool slides_ = false;  // some joint slides or is planar
  std::vector<std::uint32_t> roots_;
  std::vector<KinematicStep> steps_;
  std::vector<StepError> step_errors_;
  std::vector<Node> nodes_;  // by link
};

}  // namespace clearance
