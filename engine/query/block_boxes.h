// Boxes of moved bodies and of their pieces in many configurations, side by side.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/broad/box_columns.h"
#include "engine/query/placement.h"

namespace clearance {

/// What Placement::make_boxes() makes of each configuration, bit for bit, of bodies that are known exactly. Each worker
/// has its own.
class BlockBoxes {
 public:
  /// Both must outlive this. \param plan without doubts
  BlockBoxes(const Scene& scene, const Plan& plan);

  void make(std::span<const Placement> placed);
  std::size_t size() const { return count_; }  ///< configurations
  bool moves(std::uint32_t body) const { return slot_[body] != kNone; }
  /// Of a moved body: (size(),); empty (low > high) where it has no usable pose.
  BoxColumnsView body(std::uint32_t body) const { return bodies_[slot_[body]].view(); }
  /// Of one of its pieces; good where the body has a usable pose.
  BoxColumnsView piece(std::uint32_t body, std::uint32_t piece) const {
    return pieces_[first_piece_[slot_[body]] + piece].view();
  }

 private:
  const Scene& scene_;
  const Plan& plan_;
  std::size_t count_ = 0;
  std::vector<std::uint32_t> slot_;         // of each body, or kNone
  std::vector<std::uint32_t> first_piece_;  // of each moved body
  std::vector<BoxColumns> bodies_, pieces_;
  std::vector<double> poses_;  // (12, configurations): R row by row, t
};

}  // namespace clearance
