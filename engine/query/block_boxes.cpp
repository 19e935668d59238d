#include "engine/query/block_boxes.h"

#include <cassert>

namespace clearance {

BlockBoxes::BlockBoxes(const Scene& scene, const Plan& plan) : scene_(scene), plan_(plan) {
  slot_.assign(scene.bodies().size(), kNone);
  std::uint32_t pieces = 0;
  for (const std::uint32_t b : plan.moved) {
    slot_[b] = static_cast<std::uint32_t>(first_piece_.size());
    first_piece_.push_back(pieces);
    pieces += static_cast<std::uint32_t>(scene.bodies()[b].pieces.size());
  }
  bodies_.resize(first_piece_.size());
  pieces_.resize(pieces);
}

void BlockBoxes::make(std::span<const Placement> placed) {
  assert(plan_.doubts.empty());
  count_ = placed.size();
  poses_.resize(12 * count_);
  PoseColumnsView at;
  for (std::size_t i = 0; i < 12; ++i) at.column[i] = poses_.data() + i * count_;
  for (const std::uint32_t b : plan_.moved) {
    for (std::size_t k = 0; k < count_; ++k) {
      const PlacedPose& pose = placed[k][b].pose;
      double* const to = poses_.data() + k;
      for (std::size_t r = 0; r < 3; ++r) {
        to[3 * r * count_] = pose.R_wb.row[r].x;
        to[(3 * r + 1) * count_] = pose.R_wb.row[r].y;
        to[(3 * r + 2) * count_] = pose.R_wb.row[r].z;
      }
      to[9 * count_] = pose.t_w.x;
      to[10 * count_] = pose.t_w.y;
      to[11 * count_] = pose.t_w.z;
    }
    const Body& body = scene_.bodies()[b];
    BoxColumns& whole = bodies_[slot_[b]];
    whole.resize(count_);
    for (std::size_t k = 0; k < count_; ++k) whole.set(k, kEmptyBox);
    for (std::size_t i = 0; i < body.pieces.size(); ++i) {
      BoxColumns& piece = pieces_[first_piece_[slot_[b]] + i];
      piece.resize(count_);
      certify_boxes(*body.pieces[i], at, piece);
      join_boxes(piece, whole);
    }
    for (std::size_t k = 0; k < count_; ++k)
      if (placed[k][b].status != Status::kOk || body.cloud == CloudState::kEmpty) whole.set(k, kEmptyBox);
  }
}

}  // namespace clearance
