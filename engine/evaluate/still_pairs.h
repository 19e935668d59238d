// Pairs of a decision whose bodies both stay: evaluated once for all configurations.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/evaluate/evaluate.h"
#include "engine/selection/body_poses.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Finds out which of these pairs are beyond their margins. Belongs to one job and its snapshot.
class StillPairs {
 public:
  /// Returns null if a query has no such pairs.
  /// \param scene, plan, boxes must outlive this
  /// \param boxes as of BodyPoses
  static std::unique_ptr<StillPairs> find(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options,
                                          std::span<const Aabb> boxes);

  /// Continues until the slice is over. Returns true once all pairs are evaluated.
  bool advance(WorkMeter& meter);
  bool is_done() const { return is_done_; }
  /// Positions of the pairs that are beyond their margins, ascending, once all are evaluated.
  std::span<const std::uint64_t> beyond() const { return beyond_; }
  /// Number of pairs evaluated, the others have separate boxes.
  std::uint64_t evaluated() const { return near_.size(); }

 private:
  StillPairs(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options, std::span<const Aabb> boxes,
             std::span<const std::uint64_t> positions);

  const BodyPoses placement_;
  Evaluator evaluator_;
  std::vector<std::uint64_t> near_, beyond_;  // positions
  std::vector<PlacedBodies> to_evaluate_;     // of near_
  std::vector<PairAnswer> answers_;           // likewise
  bool is_done_ = false;
};

}  // namespace clearance
