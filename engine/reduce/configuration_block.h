// Reduces several configurations together.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/evaluate/evaluate.h"
#include "engine/reduce/box_cull.h"
#include "engine/reduce/reduction.h"

namespace clearance {

/// Compares the boxes of a whole block of configurations at once, and evaluates the pairs of all its reductions
/// together, so that lanes share the same two hulls. Each worker has its own.
class ConfigurationBlock {
 public:
  /// Limit on the configurations of a block, which bounds its memory and the time of a slice.
  /// \param by_tree see NearPairs
  /// \param with_boxes whether boxes of all bodies exist
  static std::uint64_t most(const engine::Scene& scene, const Plan& plan, bool by_tree, bool with_boxes, int workers);

  /// The arguments must outlive this.
  ConfigurationBlock(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options,
                     const Reduction::Boxes& boxes, std::uint64_t most);

  bool has_begun() const { return !placed_.empty(); }
  /// \param placed configurations [first, first + placed.size()) of the plan; must stay valid until end()
  void begin(std::span<const BodyPoses> placed, std::uint64_t first);
  /// The same for some configurations, each with the pairs that are left to evaluate (Reduction::scan()).
  /// \param open its spans must stay valid until end()
  void begin(std::span<const BodyPoses> placed, std::span<const std::uint64_t> configurations,
             std::span<const std::span<const std::uint64_t>> open);
  /// Continues until the slice is over. Returns true once all are reduced.
  bool advance(WorkMeter& meter);
  /// Returns the number of evaluated pairs, and replaces `rows` by those of each configuration.
  std::uint64_t end(std::span<std::vector<Row>> rows);

 private:
  bool collect_pairs(WorkMeter& meter);
  bool collect_pairs(std::size_t i, WorkMeter& meter);
  void take();

  const Plan& plan_;
  bool compares_boxes_;  // of all pairs first
  BoxCull cull_;
  Evaluator evaluator_;
  std::vector<Reduction> reductions_;
  std::span<const BodyPoses> placed_;
  std::vector<std::uint64_t> configurations_;         // of placed_
  std::vector<std::span<const std::uint64_t>> open_;  // likewise, or empty for all pairs
  std::span<const double> gaps_;                      // (configurations, pairs)
  std::vector<BodyPair> pairs_;
  bool is_evaluating_ = false;
  std::vector<PlacedBodies> to_evaluate_;
  std::vector<std::size_t> evaluated_end_;  // by configuration: end in to_evaluate_
  std::vector<PairAnswer> answers_;         // (to_evaluate_.size(),) and more
};

}  // namespace clearance
