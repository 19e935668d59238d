// Bounds on the distance of two links throughout a block of positions, from a plane that separates them in its middle,
// or from a point that both hold there (docs/trust/bounds_covers.md, "Planes of a table").
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/vec.h"
#include "engine/cover/hull_planes.h"
#include "engine/hull/convex_part.h"
#include "engine/joint_table/joint_table_maker.h"
#include "engine/pose/placed.h"
#include "engine/robot/link_twists.h"
#include "engine/robot/motion_path.h"

namespace clearance {

class BlockPlanes {
 public:
  /// \param pair must outlive this object
  /// \param travel largest |position| of a sliding joint, metres
  BlockPlanes(const TablePair& pair, double travel);

  /// Takes the size of the blocks.
  /// \param half halves of the widths, by column of the pair
  void take_size(std::span<const double> half);
  /// Takes the middle of a block.
  /// \param poses (links,) of the robot
  void take_middle(std::span<const Pose> poses);
  /// Lower bound on the distance of two parts throughout the block, in metres; meaningful if positive.
  /// \param n about a unit vector, from a towards b
  double gap(const ConvexPart& a, const PoseMatrix& pose_a, const ConvexPart& b, const PoseMatrix& pose_b,
             const Vec3d& n) const;
  /// Radius of a ball that two parts of the links hold throughout the block, in metres; meaningful if positive.
  /// \param index_a, index_b of the parts in their links
  /// \param point likely to be in both in the middle, world axes
  double shared(std::size_t index_a, const PoseMatrix& pose_a, std::size_t index_b, const PoseMatrix& pose_b,
                const Vec3d& point) const;

 private:
  const TablePair& pair_;
  const double travel_;
  const LinkTwists twists_;
  const MotionPath a_from_b_, b_from_a_, a_, b_;  // relative to the other link, and to the root
  std::vector<HullPlanes> planes_a_, planes_b_;   // of the parts; empty for round ones
  double error_ = 0;                              // of the links' places, metres
  bool moves_b_ = false;                          // seen from a; otherwise a moves, seen from b
  double bend_ = 0;                               // bound on what velocities leave out, metres
  std::vector<double> change_;                    // by column of the robot
  std::vector<Twist> links_;
  std::vector<double> half_;       // by column of the pair
  std::array<Twist, 2> movement_;  // of the moving link in the other's frame until the block's end, by column
};

}  // namespace clearance
