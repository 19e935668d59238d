// Kinematics of states side by side, as the kernel of decisions takes them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/decision/cover_plan.h"
#include "engine/robot/lane_kinematics.h"

namespace clearance {

/// Whether all joints on the way to the links that a motion moves have positions.
bool are_placed(const LinkMotion& motion);

/// Places the bodies of a plan in up to eight states. Each worker has its own.
class StateLanes {
 public:
  /// The arguments must outlive this.
  StateLanes(const CoverPlan& covers, const Plan& plan);

  /// Whether joints alone move the bodies, each by a link of its own.
  bool can_place() const { return can_place_; }
  /// Places states [first, first + count), count <= 8.
  void place(std::uint64_t first, std::size_t count);
  /// Places one state alone, faster. Returns DecisionBatch::poses, valid until the next call.
  const Pose* place_one(std::uint64_t state);
  /// DecisionBatch::frames of place(), and usable and cells of both, valid until the next call.
  const double* const* frames() const { return frames_.data(); }
  const std::uint8_t* usable() const { return usable_; }
  const TableCell* const* cells() const { return cells_.data(); }

 private:
  std::span<const double> find_cells(std::uint64_t state, std::size_t k);

  const CoverPlan& covers_;
  const Plan& plan_;
  bool can_place_ = true;
  std::vector<std::vector<DoubleInLanes>> positions_;  // (columns,) of each robot
  std::vector<LaneKinematics> robots_;
  std::vector<const double*> frames_;  // by body
  std::uint8_t usable_[kMostLanes];
  std::vector<const TableCell*> cells_;  // (kMostLanes, tabled_count)
  // Of one state: (columns,) and (links,) of each robot, and of all bodies.
  std::vector<std::vector<double>> row_;
  std::vector<std::vector<Pose>> links_;
  std::vector<Pose> poses_;
};

}  // namespace clearance
