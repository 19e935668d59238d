// Reduced answers of one configuration: pairs within a distance, the nearest of every body, the least of all.
#pragma once

#include <cstdint>
#include <vector>

#include "columns.h"
#include "evaluate.h"
#include "plan.h"

namespace clearance {

/// Works in stages, each a number of independent units, so that a large configuration can be sliced and spread over threads
/// and a small one run by one thread. First the pair of least box distance of each group is evaluated (a group: the pairs of
/// a body, or all); then every pair whose boxes are not farther than the upper bound found so. A pair left out has
/// lower > that upper bound, so that it can neither win nor lower the interval (see lower_with_box()): a result depends
/// neither on order nor on which of the far pairs are left out.
class Reduction {
 public:
  enum Stage { kSeedScan, kSeeds, kScan, kCandidates, kDone };

  /// \param workers how many may run units of one stage at a time.
  Reduction(const Scene& scene, const Plan& plan, const EvaluateOptions& options, int workers);

  /// Begins anew for another configuration.
  void begin();
  Stage stage() const { return stage_; }
  std::uint64_t units() const;
  /// Runs one unit of the current stage. The placement must be configured.
  void run(std::uint64_t unit, int worker, const Placement& placement);
  /// Ends the stage after all its units.
  void end_stage();
  /// The rows, once the stage is kDone. \param placement of the configuration.
  std::vector<Row> rows(std::uint32_t configuration, const Placement& placement);
  std::uint64_t evaluated() const { return seeds_.size() + candidates_.size(); }

 private:
  struct Seed {
    double gap;
    std::uint64_t position;
    friend auto operator<=>(const Seed&, const Seed&) = default;
  };
  struct WorkerState {
    WorkerState(const Scene& scene, const EvaluateOptions& options) : evaluator(scene, options) {}

    std::vector<Seed> seed;                  // of each group
    std::vector<std::uint8_t> incomplete;    // of each group
    std::vector<std::uint64_t> candidates;   // positions
    std::vector<BodyPair> room;
    std::vector<PlacedBodies> asked;
    Evaluator evaluator;
  };
  bool per_body() const { return plan_.query.reduce == Reduce::kNearest; }
  bool within() const { return plan_.query.reduce == Reduce::kWithin; }
  template <class Visit>
  void for_groups(BodyPair pair, Visit visit) const;
  void seed_scan(std::uint64_t block, WorkerState& worker, const Placement& placement);
  void scan(std::uint64_t block, WorkerState& worker, const Placement& placement);
  void scan_by_broad_phase(WorkerState& worker, const Placement& placement);

  const Scene& scene_;
  const Plan& plan_;
  EvaluateOptions options_;
  std::size_t groups_;
  bool by_broad_phase_;  ///< all pairs within a distance: found without looking at each
  Stage stage_ = kDone;
  std::vector<WorkerState> workers_;
  std::vector<std::uint8_t> incomplete_;
  std::vector<double> cutoff_;                   // of each group
  std::vector<std::uint64_t> seeds_, candidates_;  // positions, ascending
  std::vector<PairAnswer> seed_answers_, candidate_answers_;
};

}  // namespace clearance
