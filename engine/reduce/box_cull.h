// Rejects pairs by their boxes, in blocks of pairs and configurations.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/broad/box_columns.h"
#include "engine/evaluate/evaluate.h"

namespace clearance {

/// Computes box_gap() of blocks of pairs in blocks of configurations. Each worker has its own.
class BoxCull {
 public:
  /// \param scene, boxes, columns must outlive this; both hold the boxes of all bodies in the snapshot
  BoxCull(const engine::Scene& scene, std::span<const Aabb> boxes, const BoxColumns& columns)
      : scene_(scene), boxes_(boxes), columns_(columns) {}

  /// Returns (placed.size(), pairs.size()) gaps, valid until the next call.
  /// \param placed consecutive configurations of the plan
  std::span<const double> gaps(std::span<const BodyPair> pairs, std::span<const BodyPoses> placed);

 private:
  struct BodyBoxes {  // a body's boxes in all configurations, or its only box
    const Aabb* box;
    BoxColumnsView columns;
  };
  void gaps_where_they_are(std::span<const BodyPair> pairs);
  void gaps_across(std::span<const BodyPair> pairs, std::span<const BodyPoses> placed);
  BodyBoxes side(std::uint32_t body, std::span<const BodyPoses> placed);

  const engine::Scene& scene_;
  std::span<const Aabb> boxes_;
  const BoxColumns& columns_;
  std::vector<double> gaps_, row_;
  std::uint64_t first_ = ~std::uint64_t{0};  // BodyPoses::number() of the block's first
  std::vector<BoxColumns> moved_;            // boxes of a moved body in all configurations of the block
  std::vector<std::uint32_t> moved_at_;      // by body: index into moved_, or kNone
  std::vector<std::uint32_t> moved_bodies_;  // bodies in moved_
};

/// Writes kBeyond rows of pairs rejected by their boxes, from row `first` on, as write_row() does for beyond_answer().
/// \param gaps (pairs.size(),)
/// \param flags (pairs.size(),) or null
void write_beyond_rows(const ReplyView& reply, std::uint64_t first, std::span<const BodyPair> pairs,
                       std::uint32_t configuration, const double* gaps, const std::uint16_t* flags);

}  // namespace clearance
