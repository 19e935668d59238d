// Pairs of a query whose bodies both stay: evaluated once for all configurations.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/evaluate/evaluate.h"
#include "engine/selection/body_poses.h"
#include "engine/selection/plan.h"

namespace clearance {

/// Bounds on the distance of a pair that stays, in metres.
struct StillBounds {
  std::uint64_t position;
  double lower, upper;
};

/// Finds out which of these pairs are beyond their margins, or, for distances, bounds them. Belongs to one job and its
/// snapshot.
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
  /// Positions of the pairs that need no further evaluation, ascending, once all are evaluated: of a decision those
  /// beyond their margins, of distances those of bounds(): without an upper bound only for the least distance of all.
  std::span<const std::uint64_t> known() const { return known_; }
  /// Bounds for distances, in the order of known().
  std::span<const StillBounds> bounds() const { return bounds_; }
  /// Number of pairs evaluated; the boxes of the others suffice.
  std::uint64_t evaluated() const { return near_.size(); }

 private:
  StillPairs(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options, std::span<const Aabb> boxes,
             std::span<const std::uint64_t> positions);
  void find_near(const engine::Scene& scene, const Plan& plan, std::span<const std::uint64_t> positions);

  const bool decides_, finds_least_;
  const BodyPoses placement_;
  Evaluator evaluator_;
  std::vector<std::uint64_t> near_, known_;  // positions
  std::vector<StillBounds> bounds_;
  std::vector<PlacedBodies> to_evaluate_;  // of near_
  std::vector<PairAnswer> answers_;        // likewise
  bool is_done_ = false;
};

}  // namespace clearance
