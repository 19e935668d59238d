// Forward kinematics, with a bound on each link's deviation from exact arithmetic.
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

/// Kinematics for one instruction set; all versions give the same bits.
struct KinematicKernel {
  std::string_view name;  ///< "avx512", "avx2", "baseline", "scalar"
  KinematicFunctions of;
};
/// Returns the versions that this machine can run, the fastest first.
std::span<const KinematicKernel> kinematic_kernels();

/// Bound on the deviation of any point of a link from its position in exact arithmetic, in metres: the sum of a
/// constant, a term that grows with the travel of its sliding joints, and one that grows with the distance of the
/// robot's base.
struct PlacementError {
  double fixed = 0, per_travel = 0, per_distance = 0;
  double turn = 0;  ///< bound on the link's rotation error, radians; `fixed` includes it for the farthest points

  /// \param travel largest |position| of a sliding or planar joint between root and link, metres; 0 if there is none
  /// \param distance |t| of the root's pose, metres
  double at(double travel, double distance) const;
};

/// A robot's joints as steps. Immutable and thread-safe.
///
/// The exact reference takes the numbers of the URDF as float64, with its roll, pitch and yaw, axes of length 1, mimic
/// joints, sine and cosine in real arithmetic, and the rotations of the roots' poses as M(q)/|q|^2. The resulting poses
/// are float64, and error() bounds their deviation from it (docs/trust/bounds_robots.md, "Kinematics").
class Kinematics {
 public:
  explicit Kinematics(const RobotModel& robot);

  std::size_t columns() const { return columns_; }
  std::size_t links() const { return nodes_.size(); }
  /// Links with given poses: the base, then the children of floating joints in the order of the joints.
  const std::vector<std::uint32_t>& roots() const { return roots_; }
  /// Returns the root of a link.
  std::uint32_t root_of(std::uint32_t link) const;
  /// Steps that place the other links, each after the step of its parent.
  const std::vector<KinematicStep>& steps() const { return steps_; }
  /// Returns the step that places a link, or null for a root.
  const KinematicStep* step_of(std::uint32_t link) const {
    const std::uint32_t frame = nodes_[link].frame;
    return frame < roots_.size() ? nullptr : &steps_[frame - roots_.size()];
  }
  /// Returns the parent link of a step.
  std::uint32_t carrier_of(const KinematicStep& step) const {
    return step.from < roots_.size() ? roots_[step.from] : steps_[step.from - roots_.size()].link;
  }

  /// Computes the poses of all links.
  /// \param positions (K, columns()), radians and metres
  /// \param roots X_w of each of roots(), none of them kBad; empty if all are the identity
  /// \param poses (K, links()) X_w; NaN for a bad configuration, except for roots
  /// \param status (K,) kOk, or kBadPose if a position is NaN or beyond 1e6
  void place(std::span<const double> positions, std::span<const Pose> roots, std::span<Pose> poses,
             std::span<Status> status, const KinematicKernel& kernel = kinematic_kernels()[0]) const;

  /// Returns the error of points of a link within `radius` metres of its origin.
  PlacementError error(std::uint32_t link, double radius) const;
  /// Returns the relative error of two links, due to the joints between them. It bounds the difference between their
  /// exact distance and that of the poses. For links under different roots, the sum of both errors.
  PlacementError error_between(std::uint32_t a, double radius_a, std::uint32_t b, double radius_b) const;
  /// Returns the travel of a configuration over all joints.
  /// \param positions (columns(),); NaN and positions beyond kMaxPosition place no link, and are ignored
  double travel(std::span<const double> positions) const;
  /// Computes the travel of each link, over the joints from its root, for PlacementError.
  /// \param links (links(),) results
  void travels(std::span<const double> positions, std::span<double> links) const;
  /// Returns a bound on the distance of the link's points from its root with sliding joints at 0, in metres.
  double reach(std::uint32_t link, double radius) const;

 private:
  // Rounding terms and length of one step; lengths in metres, `_travel` per metre of travel.
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
  bool slides_ = false;  // whether a joint slides or is planar
  std::vector<std::uint32_t> roots_;
  std::vector<KinematicStep> steps_;
  std::vector<StepError> step_errors_;
  std::vector<Node> nodes_;  // by link
};

}  // namespace clearance
