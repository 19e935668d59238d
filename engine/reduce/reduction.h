// Reduced answers of one configuration: pairs within a distance, the nearest of every body, the least of all.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/evaluate/evaluate.h"
#include "engine/reduce/box_cull.h"
#include "engine/reduce/near_pairs.h"
#include "engine/selection/columns.h"
#include "engine/selection/plan.h"

namespace clearance {

/// What Reduce::kAny answers where each pair is proved farther than its margin.
PairAnswer beyond_all_margins(const Plan& plan);

/// Works in stages, each a number of independent units, so that a large configuration can be sliced and spread over
/// threads and a small one run by one thread. First the pair of least box distance of each group is evaluated (a group:
/// the pairs of a body, or all); then every pair whose boxes are not farther than the upper bound found so. A pair left
/// out has lower > that upper bound, so that it can neither win nor lower the interval (see lower_with_box()): a result
/// depends neither on order nor on which of the far pairs are left out. Of all pairs the first that overlaps wins where
/// no depth is asked for: pairs behind it are left out as well. Reduce::kAny has its cut-offs beforehand and needs no
/// seeds; there the first pair within its margin ends it.
class Reduction {
 public:
  enum Stage { kSeedScan, kSeeds, kScan, kCandidates, kDone };

  /// \param boxes where the pairs' boxes are; must outlive this. \param workers how many may run units of one stage at
  /// a time.
  struct Boxes {
    std::span<const Aabb> all;  ///< in the snapshot; empty: not made
    const BoxColumns& columns;  ///< the same
    const NearPairs& near_pairs;
  };
  Reduction(const Scene& scene, const Plan& plan, const EvaluateOptions& options, const Boxes& boxes, int workers);

  /// Begins anew for another configuration.
  void begin();
  Stage stage() const { return stage_; }
  std::uint64_t units() const;
  /// Whether the current stage is so much work that several threads pay. \param light an answer takes well under 1 us,
  /// not 10.
  bool worth_threads(bool light) const;
  /// Runs one unit of the current stage until the slice is over. Returns true at its end; else the same worker goes on
  /// with it. The placement must be configured.
  bool run(std::uint64_t unit, int worker, const BodyPoses& placement, WorkMeter& meter);
  /// Ends the stage after all its units.
  void end_stage();

  /// A stage of one worker as one unit, whose boxes and answers come from outside, so that those of many configurations
  /// are found together (configuration_block.h). In place of run(): of a scan,
  /// \param gaps of all pairs' boxes, in order
  void scan(std::span<const double> gaps, const BodyPoses& placement);
  /// ... and of seeds and candidates: appends those that are answered next. False: none are left. Their answers, in
  /// that order, go to take() before it is called again.
  bool ask(const BodyPoses& placement, std::vector<PlacedBodies>& asked);
  void take(std::span<const PairAnswer> answers);
  /// The rows, once the stage is kDone. \param placement of the configuration.
  std::vector<Row> rows(std::uint32_t configuration, const BodyPoses& placement);
  std::uint64_t evaluated() const;  ///< pairs, of this configuration

 private:
  using Seed = TreeSearch::Seed;
  struct WorkerState {
    WorkerState(const Scene& scene, const Plan& plan, const EvaluateOptions& options, const Boxes& boxes)
        : evaluator(scene, options), cull(scene, boxes.all, boxes.columns), search(scene, plan, boxes.near_pairs) {}

    std::vector<Seed> seed;                 // of each group
    std::vector<std::uint64_t> unusable;    // position of each group's first pair without usable poses, or kNobody
    std::vector<std::uint64_t> candidates;  // positions
    std::vector<Seed> order;
    std::uint64_t evaluated = 0;  // pairs
    std::vector<BodyPair> room;
    std::vector<PlacedBodies> asked;
    std::uint64_t first = 0, end = 0, step = 0;  // of the positions that are being answered; step 0: none of a unit
    double cut_off = 0;                          // of pairs that are asked next, where they have one
    std::vector<double> gaps;
    std::vector<std::uint32_t> near;
    Evaluator evaluator;
    BoxCull cull;
    TreeSearch search;
  };
  bool per_body() const { return plan_.query.reduce == Reduce::kNearest; }
  bool within() const { return plan_.query.reduce == Reduce::kWithin; }
  bool any() const { return plan_.query.reduce == Reduce::kAny; }
  /// Whether every pair's cut-off is known beforehand: nothing has to be found before the scan.
  bool stands_alone() const { return within() || any() || options_.reference; }
  double cut_off(std::uint64_t position) const { return any() ? plan_.margins.of(position) : plan_.query.max_distance; }
  /// Whether pairs behind one that overlaps neither win nor lower the interval.
  bool stops_at_overlap() const {
    return plan_.query.reduce == Reduce::kMin && !options_.limits.signed_distance && !options_.reference;
  }
  /// Whether one pair may decide the configuration: that, or one within its margin.
  bool stops_early() const { return stops_at_overlap() || (any() && !options_.reference); }
  bool decides(std::uint64_t position, const PairAnswer& answer) const {
    return any() ? answer.upper <= plan_.margins.of(position) : answer.status == Status::kOverlap;
  }
  template <class Visit>
  void for_groups(BodyPair pair, Visit visit) const {
    if (!per_body()) return visit(0u);
    if (pair.a < groups_) visit(pair.a);
    if (pair.b < groups_) visit(pair.b);
  }
  bool answer(std::uint64_t unit, WorkerState& worker, const BodyPoses& placement, WorkMeter& meter);
  void begin_answers(std::uint64_t begin, std::uint64_t end, std::uint64_t at_first, WorkerState& worker) const;
  void ask(WorkerState& worker, const BodyPoses& placement, std::vector<PlacedBodies>& asked);
  bool take(WorkerState& worker);
  std::vector<PairAnswer>& answers() { return stage_ == kSeeds ? seed_answers_ : candidate_answers_; }
  void sort_candidates(const BodyPoses& placement);
  void leave_out_far(WorkerState& worker, double far);
  void offer(std::uint64_t begin, std::span<const BodyPair> pairs, std::span<const double> gap, WorkerState& worker,
             const BodyPoses& placement) const;
  void offer(std::uint64_t position, BodyPair pair, double gap, WorkerState& worker, const BodyPoses& placement) const;
  std::span<const double> gaps(std::span<const BodyPair> pairs, WorkerState& worker, const BodyPoses& placement) const;
  void scan_block(std::uint64_t block, WorkerState& worker, const BodyPoses& placement) const;
  void seed_scan_by_tree(std::uint64_t block, WorkerState& worker, const BodyPoses& placement) const;
  void scan_by_tree(std::uint64_t block, WorkerState& worker, const BodyPoses& placement) const;
  void scan_unplaced(WorkerState& worker, const BodyPoses& placement) const;
  Row row_of(BodyPair pair, const PairAnswer& answer, std::uint32_t configuration, const BodyPoses& placement) const;
  Row decision(std::uint32_t configuration, const BodyPoses& placement) const;
  Row unusable_row(std::uint64_t position, std::uint32_t configuration, const BodyPoses& placement) const;
  void widen(Row& row, double lower, const BodyPoses& placement) const;

  static constexpr std::uint64_t kNobody = ~std::uint64_t{0};
  const Scene& scene_;
  const Plan& plan_;
  EvaluateOptions options_;
  std::size_t groups_;
  const NearPairs& near_pairs_;
  bool have_boxes_, by_tree_;
  Stage stage_ = kDone;
  std::uint64_t decided_by_ = kNobody;  // the first unit that has decided the stage; others write it meanwhile
  std::vector<WorkerState> workers_;
  std::vector<std::uint64_t> unusable_;            // as WorkerState has it, of all workers
  std::vector<double> cutoff_;                     // of each group
  std::span<const double> gaps_;                   // of all pairs, where they came from outside
  std::vector<double> candidate_gaps_;             // of candidates_ that are in their order; empty: they are not
  std::vector<std::uint64_t> seeds_, candidates_;  // positions, ascending
  std::vector<BodyPair> seed_pairs_, candidate_pairs_;
  std::vector<PairAnswer> seed_answers_, candidate_answers_;
};

}  // namespace clearance
