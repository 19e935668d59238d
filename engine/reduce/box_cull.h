// Pairs that boxes alone prove to be beyond max_distance, a block of pairs and configurations at a time.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/broad/box_columns.h"
#include "engine/evaluate/evaluate.h"

namespace clearance {

/// box_gap() of blocks of pairs in blocks of configurations, side by side. Each worker has its own.
class BoxCull {
 public:
  /// \param scene, boxes, columns must outlive this; both hold the boxes of all bodies in the snapshot.
  BoxCull(const Scene& scene, std::span<const Aabb> boxes, const BoxColumns& columns)
      : scene_(scene), boxes_(boxes), columns_(columns) {}

  /// \param placed configurations of the plan that follow each other. Returns (placed.size(), pairs.size()), valid
  /// until the next call.
  std::span<const double> gaps(std::span<const BodyPair> pairs, std::span<const BodyPoses> placed);

 private:
  struct Side {  // a body in all configurations: its boxes, or the one that they share
    const Aabb* box;
    BoxColumnsView columns;
  };
  void gaps_where_they_are(std::span<const BodyPair> pairs);
  void gaps_across(std::span<const BodyPair> pairs, std::span<const BodyPoses> placed);
  Side side(std::uint32_t body, std::span<const BodyPoses> placed);

  const Scene& scene_;
  std::span<const Aabb> boxes_;
  const BoxColumns& columns_;
  std::vector<double> gaps_, row_;
  std::uint64_t first_ = ~std::uint64_t{0};  // BodyPoses::number() of the block's first
  std::vector<BoxColumns> moved_;            // boxes of a moved body, in all configurations of the block
  std::vector<std::uint32_t> moved_at_;      // of each body: index into moved_, or kNone
  std::vector<std::uint32_t> moved_bodies_;  // those that have one
};

/// Writes rows that boxes alone answer, kBeyond, from row `first` on: what write_row() makes of beyond_answer().
/// \param gaps, flags (pairs.size(),) `flags` may be null: none.
void write_beyond_rows(const ReplyView& reply, std::uint64_t first, std::span<const BodyPair> pairs,
                       std::uint32_t configuration, const double* gaps, const std::uint16_t* flags);

}  // namespace clearance
