// Configurations reduced side by side.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/evaluate/evaluate.h"
#include "engine/reduce/box_cull.h"
#include "engine/reduce/reduction.h"

namespace clearance {

/// Reduces a block of configurations at a time: boxes are compared for all of them at once, and what their reductions
/// ask for next is answered together, so that lanes find many pairs of the same two hulls. Each worker has its own.
class ConfigurationBlock {
 public:
  /// How many configurations a block has at most, so that its memory is bounded, and the time until others may have
  /// their turn. \param by_tree see NearPairs. \param with_boxes those of all bodies are made beforehand
  static std::uint64_t most(const Scene& scene, const Plan& plan, bool by_tree, bool with_boxes, int workers);

  /// \param boxes must outlive this, as must the others.
  ConfigurationBlock(const Scene& scene, const Plan& plan, const EvaluateOptions& options,
                     const Reduction::Boxes& boxes, std::uint64_t most);

  bool has_begun() const { return !placed_.empty(); }
  /// \param placed configurations [first, first + placed.size()) of the plan; must stay until rows are taken.
  void begin(std::span<const BodyPoses> placed, std::uint64_t first);
  /// Goes on until the slice is over. Returns true once all are reduced.
  bool advance(WorkMeter& meter);
  /// Hands out the rows of each configuration, and how many pairs were evaluated in all.
  std::uint64_t end(std::span<std::vector<Row>> rows);

 private:
  bool ask(WorkMeter& meter);
  bool ask(std::size_t i, WorkMeter& meter);
  void take();

  const Plan& plan_;
  bool compares_boxes_;  // of all pairs beforehand
  BoxCull cull_;
  Evaluator evaluator_;
  std::vector<Reduction> reductions_;
  std::span<const BodyPoses> placed_;
  std::uint64_t first_ = 0;
  std::span<const double> gaps_;  // (configurations, pairs)
  std::vector<BodyPair> room_;
  bool is_asked_ = false;
  std::vector<PlacedBodies> asked_;
  std::vector<std::size_t> asked_end_;  // of each configuration: in asked_
  std::vector<PairAnswer> answers_;     // (asked_.size(),) and more
};

}  // namespace clearance
