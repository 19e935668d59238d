// A validated query with its pairs and its size.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "engine/scene/link_motion.h"
#include "engine/selection/margins.h"
#include "engine/selection/pair_lister.h"
#include "engine/selection/query.h"
#include "engine/state/pose_store.h"
#include "engine/uncertainty/pose_uncertainty.h"

namespace clearance {

/// A query, copied and resolved for one snapshot.
struct Plan {
  QueryView query;                       ///< its spans point into the members below
  std::vector<std::uint32_t> bodies;     ///< (M,) bodies of the query, then the links of `motions`
  std::size_t given_bodies = 0;          ///< number of `bodies` with poses in `configurations`
  std::span<const Pose> configurations;  ///< (K, given_bodies); the caller's memory until they are kept
  std::vector<Pose> kept_configurations;
  std::vector<std::uint32_t> joints;  ///< (J,)
  std::span<const double> positions;  ///< (K, J); likewise
  std::vector<double> kept_positions;
  std::span<const double> growths;  ///< (K, given_bodies) of motions, or empty; likewise
  std::vector<double> kept_growths;
  std::span<const double> velocities, twists;  ///< (K, J) and (K, given_bodies, 6), or empty; likewise
  std::vector<double> kept_velocities, kept_twists;
  std::vector<double> weights;       ///< of the joints, for kFieldFreeScale
  std::vector<double> speed_errors;  ///< (J + 2 given_bodies,), or empty
  std::vector<LinkMotion> motions;   ///< of each robot moved by the joints
  std::vector<std::uint32_t> moved;  ///< bodies and their followers, parents first
  std::shared_ptr<const PoseSnapshot> snapshot;
  PairList pairs;
  Margins margins;  ///< of the pairs, for Reduce::kAny and motions
  QuerySize size;
  std::int64_t begun_ns = 0;                   ///< monotonic_ns() that ages of poses refer to
  std::vector<PoseUncertainty> uncertainties;  ///< by body in the snapshot, at begun_ns; empty if all are exact
  std::uint64_t round = 0;                     ///< number of earlier answers

  /// Unique number of a configuration in a round, as key of data cached for it.
  std::uint64_t number(std::uint64_t configuration) const { return round * size.configurations + configuration; }
  /// Replaces the configurations by those of a query. Throws QueryError unless they are as many numbers, and for
  /// growths or turns that are not accepted.
  void take_configurations(const QueryView& requested);
  /// Copies configurations, positions and growths from the caller's memory.
  void keep_configurations();
};

/// Makes a plan in slices.
class Planner {
 public:
  /// Checks the query. Throws QueryError.
  /// \param query its data must outlive this; configurations must stay until Plan::keep_configurations()
  /// \param scene must outlive this
  /// \param with_configurations false for sizes and pairs only
  Planner(const QueryView& query, const engine::Scene& scene, std::shared_ptr<const PoseSnapshot> snapshot,
          std::uint64_t max_rows, bool with_configurations);
  /// Lists pairs until the slice is over. Returns true once the plan is complete. Throws QueryError.
  bool advance(WorkMeter& meter);
  /// The plan, after advance() has returned true.
  Plan& plan() { return plan_; }
  const Plan& plan() const { return plan_; }

 private:
  void compute_size();

  Plan plan_;
  const engine::Scene& scene_;
  std::uint64_t max_rows_;
  std::optional<PairLister> lister_;  // none once all pairs are listed
};

/// Makes a plan at once.
Plan make_plan(const QueryView& query, const engine::Scene& scene, std::shared_ptr<const PoseSnapshot> snapshot,
               std::uint64_t max_rows, bool with_configurations);

}  // namespace clearance
