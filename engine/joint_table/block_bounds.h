// Bounds on the distance of two links throughout blocks of positions (docs/trust/bounds_covers.md, "Cells of a table").
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "engine/joint_table/block_planes.h"
#include "engine/joint_table/joint_table_maker.h"
#include "engine/joint_table/mesh_gap.h"
#include "engine/narrow/part_batch.h"
#include "engine/pose/placed.h"
#include "engine/scene/scene.h"

namespace clearance {

/// Reuses its memory. Not thread-safe.
class BlockBounds {
 public:
  static constexpr double kFar = JointTable::kUnit * TableCell::kNoHigh;  ///< greater distances are not distinguished
  static constexpr double kDeep = 0.03;                                   ///< nor deeper overlaps; metres
  static constexpr double kPrecision = 8;                                 ///< a distance to 1 / kPrecision suffices

  /// Of the signed distance, in metres.
  struct Bounds {
    double lower, upper;  ///< in the middle
    double least, most;   ///< throughout the block
  };
  /// Size of blocks.
  struct Size {
    std::span<const double> half;  ///< of the widths, by column of the pair
    double way;                    ///< bound on the movement of a link relative to the other one, in metres
    bool is_last;                  ///< no block is halved any more, so that planes are worth their time
  };

  /// \param pair must outlive this object
  /// \param travel largest |position| of a sliding joint, metres
  BlockBounds(const TablePair& pair, double travel);

  bool has_mesh() const { return has_mesh_; }
  void take_size(const Size& size) {
    way_ = size.way;
    is_last_ = size.is_last;
    planes_.take_size(size.half);
  }
  /// \param positions (blocks, columns of the robot) of the middles
  std::span<const Bounds> of(std::span<const double> positions);

 private:
  void evaluate_meshes();
  void evaluate_parts();
  void narrow(const PartTask& task, const Vec3d& normal, const Vec3d& middle, Bounds& bounds);
  Bounds around(double lower, double upper) const {
    return {lower, upper, lower - (way_ + error_), upper + (way_ + error_)};
  }

  const TablePair& pair_;
  const Kinematics& robot_;
  const double error_;  // of the poses' distance, from their exact one
  double way_ = 0;
  bool is_last_ = false, has_mesh_ = false;
  std::vector<Bounds> bounds_;
  std::vector<Pose> poses_;
  std::vector<Status> status_;
  std::vector<PoseMatrix> places_;
  std::vector<PartTask> tasks_;
  std::vector<Body> bodies_;  // both links
  MeshGapSearch mesh_gaps_;
  BlockPlanes planes_;
};

}  // namespace clearance
