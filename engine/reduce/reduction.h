// Reduced answers of one configuration: pairs within a distance, the nearest of every body, or the minimum.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "engine/evaluate/evaluate.h"
#include "engine/narrow/group.h"
#include "engine/reduce/box_cull.h"
#include "engine/reduce/near_pairs.h"
#include "engine/selection/columns.h"
#include "engine/selection/plan.h"

namespace clearance {

/// The answer of Reduce::kAny if every pair is proved to be beyond its margin.
PairAnswer beyond_all_margins(const Plan& plan);

/// Works in stages of independent units, so that several threads can share a large configuration.
///
/// First, the pair with the least box distance of each group is evaluated (a group is the pairs of a body, or all).
/// Then every pair whose boxes are within the upper bound found so. A pair left out has a lower bound above it: it
/// neither wins nor lowers the interval (lower_with_box()), and the result depends neither on order nor on which far
/// pairs are left out. Unless a depth is requested, the first overlapping pair wins, and later pairs are left out too.
/// Reduce::kAny knows its cut-offs and needs no seeds; the first pair within its margin ends it.
class Reduction {
 public:
  enum Stage { kSeedScan, kSeeds, kScan, kCandidates, kDone };

  /// Boxes of all bodies; must outlive this.
  struct Boxes {
    std::span<const Aabb> all;  ///< in the snapshot; may be empty
    const BoxColumns& columns;  ///< of `all`
    const NearPairs& near_pairs;
  };
  /// \param workers that may run units of one stage at a time
  Reduction(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options, const Boxes& boxes,
            int workers);

  /// Begins another configuration.
  void begin();
  Stage stage() const { return stage_; }
  std::uint64_t units() const;
  /// Whether the current stage is worth several threads.
  /// \param light an answer takes less than 1 us instead of 10
  bool worth_threads(bool light) const;
  /// Runs one unit of the current stage. Returns true at its end, or false if the slice is over; the same worker then
  /// resumes it. The poses must be configured (BodyPoses::configure()).
  bool run(std::uint64_t unit, int worker, const BodyPoses& placement, WorkMeter& meter);
  /// Ends the stage after all its units.
  void end_stage();

  /// These replace run() for one worker whose gaps and answers are computed elsewhere, with those of other
  /// configurations (configuration_block.h). Runs a scan.
  /// \param gaps of all pairs' boxes, in order
  void scan(std::span<const double> gaps, const BodyPoses& placement);
  /// Scans some pairs alone. Of Reduce::kAny, they must contain all that are not proved to be beyond their margins; of
  /// Reduce::kMin and kNearest, all that may win or lower the interval of a group whose row is used.
  /// \param positions ascending
  void scan(std::span<const std::uint64_t> positions, const BodyPoses& placement);
  /// Appends the seeds or candidates to evaluate next; take() receives their answers in that order. Returns false if
  /// none are left.
  bool collect_pairs(const BodyPoses& placement, std::vector<PlacedBodies>& to_evaluate);
  void take(std::span<const PairAnswer> answers);
  /// Replaces `rows` by those of the configuration, once the stage is kDone.
  void take_rows(std::uint32_t configuration, const BodyPoses& placement, std::vector<Row>& rows);
  std::uint64_t evaluated() const;  ///< pairs of this configuration

 private:
  using Seed = TreeSearch::Seed;
  struct WorkerState {
    WorkerState(const engine::Scene& scene, const Plan& plan, const EvaluateOptions& options, const Boxes& boxes)
        : evaluator(scene, options), cull(scene, boxes.all, boxes.columns), search(scene, plan, boxes.near_pairs) {}

    std::vector<Seed> seed;                 // by group
    std::vector<std::uint64_t> unusable;    // by group: position of the first pair without usable poses, or kNoPair
    std::vector<std::uint64_t> candidates;  // positions
    std::vector<Seed> order;
    std::uint64_t evaluated = 0;  // pairs
    std::vector<BodyPair> pairs;  // storage for PairList::slice()
    std::vector<PlacedBodies> to_evaluate;
    std::uint64_t first = 0, end = 0, step = 0;  // of the positions being evaluated; step is 0 between units
    double cut_off = 0;                          // of the next pairs
    std::vector<double> gaps;
    std::vector<std::uint32_t> near;
    Evaluator evaluator;
    BoxCull cull;
    TreeSearch search;
  };
  struct GroupResult {
    CandidateRank best;
    const PairAnswer* winner = nullptr;
    double lower = std::numeric_limits<double>::infinity();  // least of all
    std::uint64_t lower_place = CandidateRank::kNowhere;     // position of the first pair with it
  };
  bool per_body() const { return plan_.query.reduce == Reduce::kNearest; }
  bool within() const { return plan_.query.reduce == Reduce::kWithin; }
  bool any() const { return plan_.query.reduce == Reduce::kAny; }
  /// No reduction: a row for each pair.
  bool each() const { return plan_.query.reduce == Reduce::kNone; }
  /// Whether the cut-offs are known before the scan.
  bool needs_no_seed() const { return within() || any() || each() || options_.reference; }
  double cut_off(std::uint64_t position) const { return any() ? plan_.margins.of(position) : plan_.query.max_distance; }
  /// Whether pairs after an overlapping one neither win nor lower the interval.
  bool stops_at_overlap() const {
    return plan_.query.reduce == Reduce::kMin && !options_.limits.signed_distance && !options_.reference;
  }
  /// Whether one pair, overlapping or within its margin, may decide the configuration.
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
  void collect_pairs(WorkerState& worker, const BodyPoses& placement, std::vector<PlacedBodies>& to_evaluate);
  bool take(WorkerState& worker);
  std::vector<PairAnswer>& answers() { return stage_ == kSeeds ? seed_answers_ : candidate_answers_; }
  void collect_seeds();
  void find_cutoffs();
  void collect_candidates();
  void sort_candidates(const BodyPoses& placement);
  void leave_out_far(WorkerState& worker);
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
  std::vector<GroupResult> group_results(const BodyPoses& placement) const;
  Row group_row(std::uint32_t g, const GroupResult& group, std::uint32_t configuration,
                const BodyPoses& placement) const;
  Row unusable_row(std::uint64_t position, std::uint32_t configuration, const BodyPoses& placement) const;
  void widen(Row& row, double lower, const BodyPoses& placement) const;

  static constexpr std::uint64_t kBlock = 4096;                 // pairs whose boxes one unit compares
  static constexpr std::size_t kMostSeeds = 4;                  // pairs of hulls that are all evaluated at first
  static constexpr std::uint64_t kUnitsPerScan = kBlock / 128;  // of work: boxes are compared eight at a time
  static constexpr std::uint64_t kProbes = 64;                  // bodies whose pairs one unit finds in a tree
  static constexpr std::uint64_t kTreeBlocks = 8;               // or blocks of a tree in one unit
  static constexpr std::uint64_t kEvaluate = 256;               // pairs that one unit evaluates
  static constexpr std::uint64_t kNoPair = ~std::uint64_t{0};
  const engine::Scene& scene_;
  const Plan& plan_;
  EvaluateOptions options_;
  std::size_t groups_;
  const NearPairs& near_pairs_;
  bool have_boxes_, by_tree_;
  std::size_t most_seeds_;  // positions of a minimum that are all evaluated at first, side by side
  Stage stage_ = kDone;
  std::uint64_t decided_by_ = kNoPair;  // first unit that decided the stage; written concurrently
  std::vector<WorkerState> workers_;
  std::vector<std::uint64_t> unusable_;            // as in WorkerState, over all workers
  std::vector<double> cutoff_;                     // by group
  std::span<const double> gaps_;                   // of all pairs, given to scan()
  std::vector<double> candidate_gaps_;             // of candidates_ if sorted, otherwise empty
  std::vector<std::uint64_t> seeds_, candidates_;  // positions, ascending
  std::vector<BodyPair> seed_pairs_, candidate_pairs_;
  std::vector<PairAnswer> seed_answers_, candidate_answers_;
};

}  // namespace clearance
